"""Whatever is on a bus: verdict, report, JSON, page and figure come out, and only checked frames are measured."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from documented import DOCS

from dbc.contract import contract, spec_of
from dbc.e2e import protect
from dbc.frame import BusName, Frame
from dbc.messages import BrakePedal, BrakeStatus
from hil.bench.result import Signals, UnknownSignalError, measure
from hil.bench.run import finish
from hil.bench.run_report import build_report
from hil.bench.virtual import VirtualBench, frame_table, simulate
from hil.errors import Verdict
from hil.log.frames import FrameTable, Recording
from hil.report.html import render_html
from hil.report.text import render_text
from hil.scenario.scenario import load_scenario

MS = 1_000_000


def shortened(duration_s=2.0):
    scenario = load_scenario("stop72")
    return replace(scenario, manoeuvre=replace(scenario.manoeuvre, duration_s=duration_s))


@pytest.fixture(scope="module")
def run():
    """Two seconds of a stop: frames, their times, signals."""
    frames, times = [], []

    def keep(step):
        frames.extend(step.frames)
        times.extend([step.now_ns] * len(step.frames))

    signals = simulate(shortened(), each_tick=keep)
    return frames, times, signals


def with_frames(run, *extra):
    """Signals of the run with further (time in ms of the manoeuvre, frame)."""
    frames, times, signals = run
    start_ns = round(signals.start_s * 1e9)
    rows = list(zip(times, frames, strict=True)) + [(start_ns + t_ms * MS, frame) for t_ms, frame in extra]
    rows.sort(key=lambda row: row[0])
    return Signals(Recording(Path("a"), "test", frame_table([f for _, f in rows], [t for t, _ in rows])))


def reported(signals):
    result = measure(signals)
    report = build_report("t", signals, result, Verdict.PASSED, "", {})
    json.dumps(result.as_json(), allow_nan=False)
    return report, render_text(report) + render_html(report)


def test_timing_on_the_wire_stands_in_the_report(run):
    """A demand is based on wheel speeds of half a cycle before; one pedal frame is 3 ms late."""
    frames, times, _ = run
    late = [k for k, frame in enumerate(frames) if frame.can_id == spec_of(BrakePedal).can_id][50]
    moved = [time_ns + (3 * MS if k == late else 0) for k, time_ns in enumerate(times)]
    numbers = {}
    for name, when in (("even", times), ("late", moved)):
        order = sorted(range(len(frames)), key=when.__getitem__)
        table = frame_table([frames[k] for k in order], [when[k] for k in order])
        report, _ = reported(Signals(Recording(Path("a"), "test", table)))
        numbers[name] = {one.label: one for one in report.numbers}
    assert numbers["even"]["Wheel speed to demand p50 / p99 / max"].value == "5.000 / 5.000 / 5.000"
    assert numbers["even"]["Jitter p50 / p99 / max"].value == "0.000 / 0.000 / 0.000"
    jitter = numbers["late"]["Jitter p50 / p99 / max"]
    assert jitter.value.endswith("/ 3.000")
    assert "BRAKE_PEDAL" in jitter.note


def test_a_reserved_value_with_a_wrong_check_value_is_counted_not_measured(run):
    odd = Frame(BusName.VEHICLE, 0x130, bytes.fromhex("0070000000000000"))
    signals = with_frames(run, (1005, odd))
    _, text = reported(signals)
    assert "RESERVED" not in text
    assert signals.unused == {"BRAKE_STATUS": {"corrupt": 1}}
    assert set(signals.get("BRAKE_STATUS.MODE")[1]) == set(run[2].get("BRAKE_STATUS.MODE")[1])


def test_a_reserved_value_with_a_right_check_value_is_shown_as_such(run):
    signals = run[2]
    at = np.searchsorted(signals.get("BRAKE_STATUS.MODE")[0], 1.0)
    t_s = signals.get("BRAKE_STATUS.MODE")[0][at]
    counter = int(signals.get("BRAKE_STATUS.ALIVE_COUNTER")[1][at])
    spec = spec_of(BrakeStatus)
    data = protect(spec.data_id, bytearray.fromhex("0070000000000000"), counter + 1)
    report, text = reported(with_frames(run, (t_s * 1e3 + 5, Frame(spec.bus, spec.can_id, data))))
    assert "RESERVED 7" in text
    modes = next(lane for lane in report.sections[0].timeline if lane.name == "ECU mode")
    assert [span.severity for span in modes.spans if span.label == "RESERVED 7"] == ["error"]


def test_a_second_senders_frames_do_not_reach_the_measurement(run):
    """Frames with the counter of the one before, and of another sequence; and one of a wrong length."""
    spec = spec_of(BrakePedal)
    t_s, counter = run[2].get("BRAKE_PEDAL.ALIVE_COUNTER")
    extra = []
    for offset, at_s in ((0, 1.0), (7, 1.1)):
        i = int(np.argmin(np.abs(t_s - at_s)))
        data = protect(spec.data_id, bytearray(b"\0\0\xff\x7f" + bytes(4)), int(counter[i] + offset) % 15)
        extra.append((t_s[i] * 1e3 + 4, Frame(spec.bus, spec.can_id, data)))
    extra.append((1200, Frame(spec.bus, spec.can_id, bytes(3))))
    signals = with_frames(run, *extra)
    # the frame after the one of another sequence is out of sequence too: who is right cannot be told
    assert signals.unused == {"BRAKE_PEDAL": {"corrupt": 1, "repeated": 1, "out of sequence": 2}}
    whole, left = run[2].get("BRAKE_PEDAL.PEDAL_TRAVEL_1"), signals.get("BRAKE_PEDAL.PEDAL_TRAVEL_1")
    assert len(left[0]) == len(whole[0]) - 1
    assert left[1].max() == whole[1].max()


def test_messages_without_protection_count_where_their_length_is_right(run):
    short = Frame(BusName.BENCH, 0x20, b"\xff\xff")
    signals = with_frames(run, (500, short))
    assert signals.unused == {"TRUTH_MOTION": {"wrong length": 1}}
    assert len(signals.get("TRUTH_MOTION.SPEED")[0]) == len(run[2].get("TRUTH_MOTION.SPEED")[0])


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_a_recording_of_one_tick_or_none_is_reported(run, rows):
    """Interrupted in the first tick: all frames have one stamp."""
    table = frame_table(run[0][:rows], run[1][:rows]) if rows else FrameTable.empty()
    signals = Signals(Recording(Path("a"), "test", table))
    reported(signals)
    assert measure(signals).bus_load == 0.0


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("BRAKE_STATUS.MOD", "BRAKE_STATUS.MODE"),
        ("TRUTH_MOTION.speed", "TRUTH_MOTION.SPEED"),
        ("WHEEL_SPEED.WHEEL_SPEED_FL", "WHEEL_SPEED_FRONT.WHEEL_SPEED_FL"),
        ("nothing like it", "dbc/brake.dbc"),
    ],
)
def test_an_unknown_signal_is_an_error_with_the_nearest_name(run, name, meant):
    with pytest.raises(UnknownSignalError, match=rf"no signal '{name}'.*{meant}"):
        run[2].get(name)


def test_a_known_signal_that_never_came_is_empty(run):
    assert [len(part) for part in run[2].get("STIMULUS_DRIVER.PEDAL_TRAVEL")] == [0, 0]


def strangers(rng, n):
    """Random frames of every identifier that is ours and of any other, on both buses."""
    known = [spec.can_id for bus in BusName for spec in contract(bus).by_id.values()]
    for _ in range(n):
        can_id = int(rng.choice(known)) if rng.random() < 0.7 else int(rng.integers(0, 0x800))
        bus = BusName.VEHICLE if rng.random() < 0.5 else BusName.BENCH
        yield Frame(bus, can_id, rng.bytes(int(rng.integers(0, 9)) if rng.random() < 0.3 else 8))


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_random_frames_over_all_ids_leave_verdict_and_report(tmp_path, seed):
    rng = np.random.default_rng(seed)
    with VirtualBench(shortened(1.0), tmp_path / "run") as bench:
        bench.start()
        while bench.tick():
            bench.stimulus_node.also_send(strangers(rng, int(rng.integers(0, 4))))
    if seed == 1:  # a page takes a tenth of a second, figure and table a second
        signals = Signals(bench.log)
        reported(signals)
        assert sum(sum(reasons.values()) for reasons in signals.unused.values()) > 50
        return
    outcome = finish(bench, seed, {})
    assert outcome.facts["missing"] == []
    result = json.loads(outcome.json_text())
    assert result["verdict"] == outcome.verdict.value
    documented = DOCS.joinpath("json.md").read_text().split("## `brakebench run --json`")[1].split("\n## ")[0]
    assert [key for key in result if f"`{key}`" not in documented] == []
    for name in ("log", "signals", "figure", "page"):
        assert Path(outcome.facts[name]).stat().st_size > 0
