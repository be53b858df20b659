"""Logs into the dataset: demands that the measurement contradicts are left out."""

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.data.log import Log, make_log
from hil.diagnosis.data.prepare import prepare
from plant.vectors import INPUT

WHEELS = ("fl", "fr", "rl", "rr")


def _log(demand: float, measured: float) -> Log:
    """Ten seconds at 20 m/s with a braking pressure in the middle of it."""
    t = np.arange(1000) * 0.01
    braking = (t > 3.0) & (t < 6.0)
    channels = {f"wheel_speed_{w}_rad_s": np.full(1000, 60.0) for w in WHEELS}
    channels |= {f"pressure_{w}_pa": measured * braking for w in WHEELS}
    channels |= {f"pressure_demand_{w}_pa": demand * braking for w in WHEELS}
    return make_log("log", t, channels)


@pytest.mark.parametrize(("demand", "kept"), [(20e5, True), (0.0, False)])
def test_demands_that_no_actuator_followed_are_left_out(demand: float, kept: bool) -> None:
    dataset = prepare([_log(20e5, 20e5), _log(demand, 20e5)], 0.3)
    assert ("pressure" in dataset.groups) is kept
    for drive in dataset.recordings:
        assert drive.log.has("pressure_demand_fl_pa") is kept
        assert any("demands left out" in text for text in drive.log.remarks) is not kept
    assert [drive.number for drive in dataset.recordings] == [0, 1]


def test_released_brakes_contradict_nothing() -> None:
    assert "pressure" in prepare([_log(0.0, 0.0)], 0.3).groups


@pytest.mark.parametrize(("step_s", "between"), [(0.01, 1e4), (0.02, 1.5e4)])
def test_a_demand_is_held_from_row_to_row_and_lies_between_sparse_samples(step_s: float, between: float) -> None:
    """Of a demand that rises by 0.1 bar every 20 ms: a controller with a cycle of 10 ms demands more in between."""
    t = np.arange(0.0, 10.0, step_s)
    rising = 1e4 * np.floor(t / 0.02 + 1e-6)
    channels = {f"wheel_speed_{w}_rad_s": np.full(len(t), 60.0) for w in WHEELS}
    channels |= {f"pressure_{w}_pa": rising for w in WHEELS} | {f"pressure_demand_{w}_pa": rising for w in WHEELS}
    (drive,) = prepare([make_log("log", t, channels)], 0.3).recordings
    demand = drive.inputs[:, INPUT.slice("pressure_demand_pa")][:, 0]
    assert demand[2] == pytest.approx(1e4)
    assert demand[3] == pytest.approx(between)


def test_an_unstated_pressure_is_compared_where_its_demand_is_zero() -> None:
    """Without stated hydraulics an offset still shows while the brakes are released, and between left and right at any
    time."""
    log = _log(20e5, 20e5)
    dataset = prepare([log], 0.3, unstated=("ehb", "motor"))
    (drive,) = dataset.recordings
    t = np.arange(drive.samples) * dataset.sample_s
    for track in ("pressure.mean", "pressure.front-rear"):
        compared = drive.compared[track] > 0.5
        assert compared[(t > 1.1) & (t < 2.9)].all()
        assert not compared[(t > 3.0) & (t < 7.0)].any()
        assert compared[t > 7.1].all()
    assert all((drive.compared[f"pressure.left-right {axle}"][t > 1.1] > 0.5).all() for axle in ("front", "rear"))
    assert "pressure" not in dataset.tracked_actuators
    (drive,) = prepare([log], 0.3).recordings
    assert not drive.compared


def test_left_and_right_with_different_demands_are_not_compared() -> None:
    log = _log(20e5, 20e5)
    uneven = replace(
        log, channels=log.channels | {"pressure_demand_fr_pa": 0.5 * log.channels["pressure_demand_fr_pa"]}
    )
    (drive,) = prepare([uneven], 0.3, unstated=("ehb", "motor")).recordings
    t = np.arange(drive.samples) * drive.stride * 0.01
    front, rear = (drive.compared[f"pressure.left-right {axle}"] > 0.5 for axle in ("front", "rear"))
    assert not front[(t > 3.0) & (t < 7.0)].any()
    assert front[t > 7.1].all()
    assert rear[t > 1.1].all()


@pytest.mark.parametrize(("unasked_s", "kept"), [(0.03, True), (0.45, True), (3.0, False)])
def test_a_release_tail_contradicts_no_demand(unasked_s: float, kept: bool) -> None:
    """Samples above 5 bar just after a demand has gone, in logs whose brakes hardly act otherwise."""
    t = np.arange(1000) * 0.01
    channels = {f"wheel_speed_{w}_rad_s": np.full(len(t), 60.0) for w in WHEELS}
    demand = np.where((t > 1.9) & (t < 2.0), 2e4, 0.0)  # below what counts as released
    demand[(t > 1.97) & (t < 2.0)] = 8e5
    tail = np.where((t > 2.0) & (t < 2.0 + unasked_s), 6e5, 0.0)
    channels |= {f"pressure_{w}_pa": tail for w in WHEELS} | {f"pressure_demand_{w}_pa": demand for w in WHEELS}
    assert ("pressure" in prepare([make_log("log", t, channels)], 0.3).groups) == kept
