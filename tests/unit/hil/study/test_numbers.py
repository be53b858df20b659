"""The vehicle's numbers: how strained a model is, and a fit that no single number blocks."""

import numpy as np
import pytest

from hil.study.noise import Frame
from hil.study.numbers import Numbers, strain
from hil.study.prepare import prepare
from hil.study.rig import Rig
from hil.study.table import Log, make_log
from hil.study.vehicle import paper_car
from hil.study.world import nominal

WHEELS = ("fl", "fr", "rl", "rr")
NOISE_PA = 2e3


def test_numbers_within_their_tolerance_strain_nothing():
    rng = np.random.default_rng(3)
    assert strain(np.zeros(50)) == 1.0
    assert strain(0.5 * rng.standard_normal(50)) == 1.0
    assert strain(np.full(50, 2.0)) == pytest.approx(4.0)


def _log() -> Log:
    """A car that brakes by pulses of its motors and of its brakes, both known."""
    t = np.arange(2000) * 0.01
    brakes, pulses = (t % 7.0 > 3.0) & (t % 7.0 < 4.5), t % 4.0 < 1.5
    speed = 33.0 - np.cumsum(0.3 + 1.4 * brakes + 0.6 * pulses) * 0.01
    channels = {f"wheel_speed_{w}_rad_s": speed / 0.308 for w in WHEELS}
    channels |= {"ax_mps2": np.gradient(speed, t), "speed_mps": speed}
    for wheel in WHEELS:
        channels |= {f"pressure_{wheel}_pa": 9e5 * brakes, f"pressure_demand_{wheel}_pa": 9e5 * brakes}
        channels |= {f"motor_torque_{wheel}_nm": -60.0 * pulses, f"motor_torque_demand_{wheel}_nm": -60.0 * pulses}
    return make_log("log", t, channels)


@pytest.mark.slow
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_dead_time_is_found_on_either_side(side):
    """It acts from step to step; a fit that keeps to one side leaves the other to effects."""
    vehicle = paper_car()
    case = prepare([_log()], 0.308)
    base = nominal(vehicle)
    rig = Rig(case, vehicle)
    names = [nuisance.name for nuisance in Numbers(rig, Frame.of(case), vehicle, base, True).nuisances]
    at = names.index("ehb_dead_time_s")
    numbers = Numbers(rig, Frame.of(case), vehicle, base, relinearise=True)
    off = np.where(np.arange(len(names)) == at, side * 0.6, 0.0)
    told = rig.run(base.shifted(numbers.nuisances, off))["pressure"]
    (drive,) = case.drives
    drive.measured["pressure"][:] = told + NOISE_PA * np.random.default_rng(1).standard_normal(told.shape)
    numbers.anew(np.zeros(len(names)))
    model, _ = numbers.fitted(*numbers.fitter.start())
    assert np.sign(model.z[at]) == side  # how much of it is latency, one log leaves open
    left = drive.measured["pressure"] - model.stack["pressure"]
    assert np.sqrt(np.mean(left**2)) < 1.1 * NOISE_PA
