"""Starting and stopping: what a Ctrl-C may cut short, and what not."""

import signal

import pytest

from hil.rt.process import interrupts_held


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
