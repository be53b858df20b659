"""The controller against the vehicle, in virtual time: what the driver gets."""

import dataclasses
import math

import numpy as np
import pytest

from dbc.bench_messages import PhysicalFault
from dbc.messages import BrakeMode
from ecu.law import estimator
from ecu.law.joint import layout
from hil.scenario.parameters import override
from hil.validation.reproduce import runs
from plant.manoeuvre import Manoeuvre, SpeedPhase
from plant.road import RoadSegment


@pytest.fixture(scope="module")
def car():
    return runs.plant_parameters()


def two_stops(seconds=16.0):
    """From 20 m/s to 4 m/s, up to 20 m/s again, and to rest."""
    return Manoeuvre(
        20.0,
        seconds,
        pedal=((1.5, 0.0), (1.8, 0.6), (6.5, 0.6), (6.6, 0.0), (13.0, 0.0), (13.3, 0.6)),
        speed_phases=(SpeedPhase(0.0, 1.5, 20.0), SpeedPhase(6.7, 13.0, 20.0)),
        initial_pad_friction=0.7 * 0.38,
    )


def steady(run, start_s, end_s):
    return (run.time_s > start_s) & (run.time_s < end_s)


def test_weak_pads_are_found_and_compensated(car, parameters):
    weak = override(car, {"pad": {"a_1_ks": 0.7 * car.pad.a_1_ks}}, "weak pads")
    run = runs.drive(two_stops(), weak, parameters, seed=1)
    learned = steady(run, 3.0, 6.0)
    error = run.estimated_friction[learned] / run.pad_friction[learned] - 1.0
    assert np.abs(error).max() < 0.05
    second = steady(run, 13.9, 15.9)
    assert -run.acceleration_mps2[second].mean() == pytest.approx(run.demanded_mps2[second].mean(), rel=0.03)

    off = dataclasses.replace(parameters, compensation=dataclasses.replace(parameters.compensation, enabled=False))
    run = runs.drive(two_stops(), weak, off, seed=1)
    lack = 1.0 + run.acceleration_mps2[second].mean() / run.demanded_mps2[second].mean()
    assert 0.15 < lack < 0.4


@pytest.mark.parametrize(
    ("wheels", "depth_mps2", "above_one_s"), [(0b0001, 1.0, 0.0), (0b0011, 1.6, 0.1), (0b1111, 2.6, 0.1)]
)
def test_friction_takes_over_from_failed_motors(car, parameters, wheels, depth_mps2, above_one_s):
    fault = runs.Fault(PhysicalFault.MOTOR_DEAD, wheels, at_s=3.0)
    manoeuvre = Manoeuvre(20.0, 5.0, pedal=((1.0, 0.0), (1.3, 0.6)), speed_phases=(SpeedPhase(0.0, 1.0, 20.0),))
    run = runs.drive(manoeuvre, car, parameters, seed=2, blending=0.7, faults=(fault,))
    lack = (run.demanded_mps2 + run.acceleration_mps2)[steady(run, 2.99, 4.9)]
    assert lack.max() < depth_mps2
    assert 0.01 * (lack > 1.0).sum() <= above_one_s + 1e-9
    assert 0.01 * (lack > 0.3).sum() <= 0.15
    assert np.abs(lack[100:]).max() < 0.1


def test_a_slippery_patch_is_told_from_the_pads(car, parameters):
    road = (RoadSegment(-1e9), RoadSegment(60.0, 0.17, 0.17), RoadSegment(68.0))
    manoeuvre = Manoeuvre(
        20.0, 8.0, pedal=((1.0, 0.0), (1.3, 0.6)), speed_phases=(SpeedPhase(0.0, 1.0, 20.0),), road=road
    )
    frozen = override(parameters, {"compensation": {"road_correction": False}}, "frozen road")
    errors = []
    for ecu in (parameters, frozen):
        run = runs.drive(manoeuvre, car, ecu, seed=3)
        braking = (run.demanded_mps2 > 0.1) & (run.speed_mps > 1.5)
        errors.append(np.sqrt(np.mean((run.estimated_torque_nm - run.wheel_torque_nm)[braking, 0] ** 2)))
    assert errors[0] < 25.0
    assert errors[0] < 0.4 * errors[1]


@pytest.mark.parametrize("factor", [0.0, 0.8, 1.2])
def test_a_wheel_that_does_not_turn_as_the_car_moves_is_left_out_and_reported(car, parameters, monkeypatch, factor):
    manoeuvre = Manoeuvre(20.0, 6.0, pedal=((1.0, 0.0), (1.3, 0.5)), speed_phases=(SpeedPhase(0.0, 1.0, 20.0),))
    whole = estimator.measured

    def broken(*arguments):
        z = whole(*arguments)
        z[layout.WHEEL + 2] *= factor
        return z

    monkeypatch.setattr(estimator, "measured", broken)
    run = runs.drive(manoeuvre, car, parameters, seed=5)
    braking = steady(run, 2.0, 5.5)
    assert set(run.mode[braking]) == {float(BrakeMode.DEGRADED)}
    assert run.estimated_speed_mps[braking] == pytest.approx(run.speed_mps[braking], rel=0.03)


def test_the_same_frames_give_the_same_bytes(car, parameters):
    manoeuvre = Manoeuvre(20.0, 2.0, pedal=((0.5, 0.0), (0.8, 0.6)))
    first, second = (runs.drive(manoeuvre, car, parameters, seed=4, blending=0.5) for _ in range(2))
    assert first.pressure_demand_pa.tobytes() == second.pressure_demand_pa.tobytes()
    assert first.observer.tobytes() == second.observer.tobytes()


def test_finds_its_speed_after_driving_off_and_keeps_it_on_ice(car, parameters):
    away = Manoeuvre(0.0, 8.0, speed_phases=(SpeedPhase(0.0, 8.0, 15.0),), end_after_standstill_s=None)
    run = runs.drive(away, car, parameters, seed=6)
    assert set(run.mode) == {float(BrakeMode.NORMAL)}
    late = run.time_s > 5.0
    assert run.estimated_speed_mps[late] == pytest.approx(run.speed_mps[late], rel=0.02)

    ice = Manoeuvre(
        20.0, 4.0, pedal=((1.0, 0.0), (1.3, 0.7)), speed_phases=(SpeedPhase(0.0, 1.0, 20.0),),
        road=(RoadSegment(-1e9), RoadSegment(30.0, 0.1, 0.1)),
    )  # fmt: skip
    run = runs.drive(ice, car, parameters, seed=6)
    assert run.estimated_speed_mps == pytest.approx(run.speed_mps, abs=1.0)


@pytest.mark.parametrize(("from_s", "learned"), [(0.5, 1.0 / 0.7), (4.0, 1.0)])
@pytest.mark.parametrize("lost", [False, True])
def test_without_a_believable_acceleration_the_wheels_are_followed_and_nothing_is_learned(
    car, parameters, monkeypatch, from_s, learned, lost
):
    """A sensor that sticks while coasting (nothing known of the pads yet) or in the first of two stops, or is lost."""
    weak = override(car, {"pad": {"a_1_ks": 0.7 * car.pad.a_1_ks}}, "weak pads")
    whole, stuck_at, ticks = estimator.measured, [], [0]

    def broken(*arguments):
        z = whole(*arguments)
        ticks[0] += 1
        if ticks[0] * 0.01 - 1.1 > from_s:  # the first second finds the demands followed
            stuck_at.append(z[layout.AX])
            z[layout.AX] = math.nan if lost else stuck_at[0]
        return z

    monkeypatch.setattr(estimator, "measured", broken)
    run = runs.drive(two_stops(), weak, parameters, seed=1)
    assert run.estimated_speed_mps == pytest.approx(run.speed_mps, abs=0.25)
    second = steady(run, 13.9, 15.9)
    error = run.estimated_friction[second] / (learned * run.pad_friction[second]) - 1.0
    assert np.abs(error).max() < 0.15
    assert np.ptp(run.estimated_friction[run.time_s > 7.0], axis=0).max() == 0.0
    if not lost:
        assert run.mode[-1] == BrakeMode.DEGRADED
