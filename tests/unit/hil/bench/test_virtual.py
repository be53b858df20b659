"""Virtual time: files, determinism, golden run, nodes of one's own."""

import hashlib
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from dbc.frame import BusName, Frame
from hil.bench.bench_run import BenchError, BenchState
from hil.bench.result import Signals, measure
from hil.bench.virtual import VirtualBench, frame_table, simulate
from hil.faults.catalogue import injection
from hil.scenario.scenario import StartOrder, load_scenario

SHORT = """title = "short stop"
blending = 0.5
[start]
speed_mps = 5.0
[driver]
pedal = [[0.2, 0.0], [0.4, 0.6]]
[end]
duration_s = 8.0
after_standstill_s = 0.3
[[faults]]
at_s = 0.8
fault = "motor_dead"
wheels = ["fl"]
"""
RECORD = """
import sys
from pathlib import Path
from hil.scenario.scenario import load_scenario
from hil.bench.virtual import VirtualBench
with VirtualBench(load_scenario(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])) as bench:
    bench.run()
"""


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return load_scenario(str(path))


def recorded(scenario, folder, seed=1, **nodes):
    with VirtualBench(scenario, folder, seed, **nodes) as bench:
        bench.run()
    return bench


def test_a_recording_as_of_two_processes(short, tmp_path):
    bench = recorded(short, tmp_path / "a")
    assert (bench.state, bench.reason, bench.alive_at_end) == (BenchState.FINISHED, "", 2)
    signals = Signals(bench.log)
    result = measure(signals)
    assert (result.frames_lost, result.frames_corrupt, result.overruns) == (0, 0, 0)
    assert (result.lateness_ms.p50, result.lateness_ms.max) == (0.0, 0.0)
    assert 3.0 < result.stop_distance_m < 6.5
    assert signals.decoded.unknown == signals.decoded.rejected == 0
    for name in ("ECU_TIMING.TICK", "PLANT_TIMING.TICK"):
        assert np.all(np.diff(signals.get(name)[1]) == 1.0)


def test_two_fresh_processes_give_the_same_bytes_and_another_seed_others(short, tmp_path):
    runs = {"a": 1, "b": 1, "c": 2}
    command = [sys.executable, "-c", RECORD, short.source]
    processes = [subprocess.Popen([*command, str(tmp_path / name), str(seed)]) for name, seed in runs.items()]
    assert [process.wait(120) for process in processes] == [0, 0, 0]
    digests = [hashlib.sha256((tmp_path / name / "recording.log").read_bytes()).hexdigest() for name in runs]
    assert digests[0] == digests[1] != digests[2]


def test_simulate_gives_what_the_recording_holds(short, tmp_path):
    signals, read = simulate(short), Signals(recorded(short, tmp_path / "a").log)
    names = {name for name in read.decoded.columns if "TIMING" not in name}
    assert set(signals.decoded.columns) == names
    assert signals.start_s == pytest.approx(read.start_s)
    for name in names:
        for ours, theirs in zip(signals.decoded.series(name), read.decoded.series(name), strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-9, rtol=0.0)


def test_fault_and_blending_act_when_the_scenario_says(short):
    signals = simulate(short)
    t_s, state = signals.get("MOTOR_STATUS_FRONT.FAULT_FL")
    assert t_s[np.argmax(state > 1)] == pytest.approx(0.8)
    t_s, alpha = signals.get("STIMULUS_ECU.BLENDING_FACTOR")
    assert t_s[0] < 0.0
    assert set(alpha) == {0.5}
    _, command = signals.get("FAULT_COMMAND.FAULT")
    assert list(command) == [0.0, 0.0, 0.0, 1.0]


class Mute:
    def step(self, now_ns, inbox):
        return []


class Broken:
    def step(self, now_ns, inbox):
        if now_ns > 500_000_000:
            raise ArithmeticError("no more")
        return []


class Stranger:
    def step(self, now_ns, inbox):
        return [Frame(BusName.VEHICLE, 0x7AB, b"")]


@pytest.mark.parametrize(
    ("node", "reason"),
    [
        (Mute(), "the manoeuvre did not start"),
        (Broken(), "ecu raised ArithmeticError at 0.505 s: no more"),
        (Stranger(), "frame 0x7AB with 0 bytes is not this role's to send"),
    ],
)
def test_a_controller_that_fails_breaks_the_run(short, tmp_path, node, reason):
    bench = recorded(short, tmp_path / "a", ecu=node)
    assert bench.state is BenchState.BROKEN
    assert reason in bench.reason
    assert len(Signals(bench.log).get("TRUTH_MOTION.SPEED")[0]) > 0


def test_a_node_that_joins_later_starts_the_manoeuvre_later(short, tmp_path):
    late = replace(short, start_order=StartOrder(ecu_s=2.0))
    # its supply, the battery's frames every 100 ms, has begun before it
    assert simulate(late).start_s == pytest.approx(simulate(short).start_s + 2.0, abs=0.11)


def test_frames_as_columns():
    frames = [Frame(BusName.BENCH, 0x20, b"\x01\x02"), Frame(BusName.VEHICLE, 0x30, bytes(8))]
    table = frame_table(frames, [5, 7])
    assert [table.channels[i] for i in table.channel] == ["bench", "vehicle"]
    assert list(table.length) == [2, 8]
    assert table.data[0].tobytes() == b"\x01\x02" + bytes(6)
    assert (list(table.can_id), list(table.time_ns)) == ([0x20, 0x30], [5, 7])


def test_frames_of_a_scenario_are_lost_in_their_time(tmp_path):
    """Wheel speeds for 100 ms: gone from the recording, and counted by their receiver (its counter: up to 14)."""
    path = tmp_path / "lost.toml"
    path.write_text(
        SHORT + '[[frame_faults]]\nmessages = ["WHEEL_SPEED_FRONT"]\ndrop = 1.0\nfrom_s = 0.5\nuntil_s = 0.6\n'
    )
    lost, whole = (simulate(load_scenario(str(p))) for p in (path, _written(tmp_path / "whole.toml", SHORT)))
    sent, still = (signals.get("WHEEL_SPEED_FRONT.WHEEL_SPEED_FL")[0] for signals in (whole, lost))
    gone = np.setdiff1d(np.round(sent, 3), np.round(still, 3))
    assert gone == pytest.approx(np.arange(0.5, 0.595, 0.01), abs=1e-6)
    assert measure(lost).frames_lost == len(gone)
    assert measure(whole).frames_lost == 0


def _written(path, text):
    path.write_text(text)
    return path


def test_a_plant_that_falls_silent_ends_the_simulation(short):
    with pytest.raises(BenchError, match="said nothing of its motion for 2 s"):
        simulate(short, faults=[injection("process_killed", "PLANT", at_s=0.3)])
