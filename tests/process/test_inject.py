"""Faults by hand on a bench of real processes: `brakebench inject` while `brakebench run` drives."""

import numpy as np
import pytest
from processes import alive, children_of, result_of, wait_until

from dbc.messages import BrakeMode
from hil.bench.result import Signals
from hil.faults.catalogue import fault_named

LASTING = "downhill"  # brakes for two minutes: whatever a busy machine delays, the run still goes on


@pytest.fixture
def bench(start, channel, tmp_path):
    """A run that drives: its process, its nodes by command, and what waits for ticks of its recording."""
    process = start("run", LASTING, "--json", "--bus", channel, "--out", "out")
    log = tmp_path / "out" / "recording.log"

    def nodes():
        assert process.poll() is None, process.communicate()
        found = children_of(process.pid)
        return found if {"record", "plant", "ecu"} <= set(found) else None

    found = wait_until(nodes, "recorder, plant and ECU")

    def ticks(number):
        before = log.read_text().count(" 020#") if log.exists() else 0
        wait_until(lambda: log.exists() and log.read_text().count(" 020#") >= before + number, f"{number} ticks")

    ticks(150)
    return process, found, ticks, log


def number(name):
    return fault_named(name).number


@pytest.mark.slow
def test_faults_by_hand_act_in_the_processes_and_are_on_record(bench, brakebench, channel):
    process, nodes, ticks, log = bench

    def inject(*words):
        done = brakebench("inject", *words, "--bus", channel)
        assert "armed: " in done.stderr
        ticks(45)

    inject("signal_value", "--on", "STEERING.STEERING_WHEEL_ANGLE", "--set", "value=1.5", "--for", "0.2")
    inject("silent", "--on", "WHEEL_SPEED_FRONT", "--for", "0.2")
    inject("counter_frozen", "--on", "MOTOR_DEMAND_FRONT", "--for", "0.2")
    inject("motor_dead", "--on", "rl", "--for", "0.3")
    inject("process_stopped", "--on", "ECU", "--for", "0.2")
    inject("process_busy", "--on", "PLANT", "--for", "0.1")
    assert process.poll() is None
    brakebench("inject", "process_killed", "--on", "PLANT", "--bus", channel)
    result = result_of(process, expected=3)
    assert "plant" in result["reason"]
    assert "SIGKILL" in result["reason"]
    assert not any(alive(pid) for pid in nodes.values())

    signals = Signals(log)
    armed = [int(n) for n in signals.get("FAULT_SELECT.FAULT")[1]]
    names = ("signal_value", "silent", "counter_frozen", "process_stopped", "process_busy", "process_killed")
    assert armed == [number(name) for name in names]
    at = dict(zip(names, signals.get("FAULT_SELECT.FAULT")[0], strict=True))

    t_s, angle = signals.get("STEERING.STEERING_WHEEL_ANGLE")
    lying = t_s[np.isclose(angle, 1.5)]
    assert 3 < len(lying) <= 20  # fewer on a machine that skips ticks
    assert lying[0] >= at["signal_value"]
    _, counter = signals.decoded.series("WHEEL_SPEED_FRONT.ALIVE_COUNTER")
    assert np.any(np.diff(counter) % 15 != 1)
    _, counter = signals.decoded.series("MOTOR_DEMAND_FRONT.ALIVE_COUNTER")
    assert (np.diff(counter) % 15 == 0).sum() > 3
    _, state = signals.get("MOTOR_STATUS_REAR.FAULT_RL")
    assert 2.0 in state
    assert state[-1] == 0.0  # mended again
    skipped = signals.get("ECU_TIMING.OVERRUNS")[1][-1], signals.get("PLANT_TIMING.OVERRUNS")[1][-1]
    assert skipped[0] >= 15
    assert skipped[1] >= 8
    t_s, mode = signals.get("BRAKE_STATUS.MODE")
    assert BrakeMode.DEGRADED in mode[t_s > at["silent"]]


@pytest.mark.slow
def test_a_disk_that_is_full_ends_the_recording_not_the_loop(bench, brakebench, channel):
    process, _, _, log = bench
    brakebench("inject", "disk_full", "--bus", channel)
    result = result_of(process, expected=5)
    assert "INCOMPLETE" in result["reason"]
    assert Signals(log).decoded.rejected == 0
    _, mode = Signals(log).get("BRAKE_STATUS.MODE")
    assert mode[-1] == BrakeMode.NORMAL


def test_nobody_there_and_what_is_not_known(brakebench, channel):
    assert "nobody is on" in brakebench("inject", "motor_dead", "--bus", channel, check=2).stderr
    assert "did you mean 'silent'" in brakebench("inject", "silnt", check=2).stderr
    assert "--on: expected message, node or all" in brakebench("inject", "silent", check=2).stderr
    assert "expected NAME=NUMBER" in brakebench("inject", "lost", "--on", "ALL", "--set", "share", check=2).stderr
    assert "signal_noise" in brakebench("inject").stdout
