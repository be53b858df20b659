"""Virtual against real time: differences and ages, on recordings whose answer is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dbc.frame import Frame
from hil.bench.compare import ages_ms, message_latencies, signal_differences
from hil.bench.result import Signals
from hil.bench.virtual import frame_table, simulate
from hil.log.frames import Recording
from hil.scenario.scenario import load_scenario


@pytest.fixture(scope="module")
def run():
    """A short stop: frames and times."""
    frames, times = [], []

    def keep(step):
        frames.extend(step.frames)
        times.extend([step.now_ns] * len(step.frames))

    scenario = load_scenario("stop72")
    scenario = replace(scenario, manoeuvre=replace(scenario.manoeuvre, duration_s=2.5))
    signals = simulate(scenario, each_tick=keep)
    return frames, times, signals


def signals_of(frames, times):
    return Signals(Recording(Path("a"), "test", frame_table(frames, times)))


def test_a_run_does_not_differ_from_itself(run):
    _, _, signals = run
    rows = signal_differences(signals, signals)
    assert len(rows) > 60
    assert all((row.max, row.rms) == (0.0, 0.0) for row in rows)
    assert {row.lag_ms for row in rows} <= {None, 0.0}
    assert "TRUTH_MOTION.SPEED" in {row.signal for row in rows if row.lag_ms == 0.0}


def test_a_signal_that_comes_later_shows_its_lag(run):
    frames, times, signals = run
    late = [t + 20_000_000 * (f.can_id == 0xD0) for f, t in zip(frames, times, strict=True)]
    rows = {row.signal: row for row in signal_differences(signals, signals_of(frames, late))}
    pressure, speed = rows["EHB_PRESSURE_FRONT.PRESSURE_FL"], rows["WHEEL_SPEED_FRONT.WHEEL_SPEED_FL"]
    assert pressure.lag_ms == pytest.approx(20.0, abs=1.0)
    assert pressure.rms_aligned < 0.2 * pressure.rms
    assert speed.rms == 0.0


def test_ages_are_five_milliseconds_in_virtual_time(run):
    _, _, signals = run
    rows = message_latencies(signals, signals)
    assert {(row.receiver, row.message) for row in rows} >= {("ECU", "BRAKE_PEDAL"), ("PLANT", "MOTOR_DEMAND_REAR")}
    for row in rows:
        assert (row.real_ms.p50, row.real_ms.max) == (5.0, 5.0), row
        assert row.real_ms == row.virtual_ms


def test_an_age_counts_from_the_frame_that_was_used(run):
    frames, times, _ = run
    # a receiver that is 12 ms late with all it reports
    late = [t + 12_000_000 * (f.can_id == 56) for f, t in zip(frames, times, strict=True)]
    assert ages_ms(signals_of(frames, late), "BRAKE_PEDAL", "ECU_RECEPTION.COUNTER_BRAKE_PEDAL").p50 == 17.0


def test_a_message_nobody_sent_has_no_age(run):
    frames, times, _ = run
    kept = [(f, t) for f, t in zip(frames, times, strict=True) if f.can_id != 0xA0]
    silent = signals_of(*map(list, zip(*kept, strict=True)))
    assert ages_ms(silent, "BRAKE_PEDAL", "ECU_RECEPTION.COUNTER_BRAKE_PEDAL").p50 is None
    assert isinstance(frames[0], Frame)
    assert np.isfinite(silent.start_s)
