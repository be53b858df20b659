"""Starting and stopping: what a Ctrl-C may cut short, and what not."""

import signal
from time import sleep

import pytest

from hil.rt.process import Child, interrupts_held


@pytest.fixture
def interruptible():
    """Python's own handler: a shell lets what it starts in the background ignore interrupts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_waits_for_the_end_of_the_block():
    done = []

    def interrupted():
        with interrupts_held():
            signal.raise_signal(signal.SIGINT)
            done.append("the block")
        done.append("what follows it")

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done == ["the block"]


def test_who_handled_interrupts_before_hears_of_it():
    heard = []
    before = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    try:
        with interrupts_held():
            signal.raise_signal(signal.SIGINT)
            assert heard == []
        assert heard == [signal.SIGINT]
        with interrupts_held():
            pass
        assert heard == [signal.SIGINT]
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_process_that_is_shutting_down_gets_no_second_signal(tmp_path, monkeypatch):
    """It restores the signal's own action once it shuts down, as a node does, and would die of another one."""
    program = tmp_path / "node"
    program.write_text("#!/bin/sh\ntrap 'trap - TERM; sleep 1; exit 0' TERM\necho up\nwhile :; do sleep 0.05; done\n")
    program.chmod(0o755)
    monkeypatch.setattr("sys.executable", str(program))
    child = Child("node", [], tmp_path / "said")
    while not (tmp_path / "said").read_text():
        sleep(0.01)
    child.ask_to_stop()
    sleep(0.3)
    child.stop()
    assert not child.failed, child.why()
