"""Starts of replays: logs that begin on the brakes, as most of a car at rest do."""

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.data.log import make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car
from plant.vectors import P

WHEELS = ("fl", "fr", "rl", "rr")
HELD_PA, NOISE_PA = 10e5, 3e4


@pytest.fixture(scope="module")
def simulator() -> Simulator:
    """A car that stands on its brakes from before the log on, and drives off at 6 s."""
    t, rng = np.arange(1500) * 0.01, np.random.default_rng(5)
    held, speed = t < 6.0, np.clip(1.5 * (t - 6.5), 0.0, None)
    channels = {f"wheel_speed_{w}_rad_s": speed / 0.308 for w in WHEELS}
    channels |= {f"pressure_demand_{w}_pa": HELD_PA * held for w in WHEELS}
    channels |= {f"pressure_{w}_pa": HELD_PA * held + NOISE_PA * rng.standard_normal(len(t)) for w in WHEELS}
    channels |= {f"motor_torque_{w}_nm": 150.0 * ~held for w in WHEELS}
    return Simulator(prepare([make_log("log", t, channels)], 0.308), paper_car())


def test_what_is_asked_at_first_was_asked_before_the_log(simulator):
    """Pressures fell for a dead time, as if nobody had braked before, and a shorter one seemed to be true."""
    begun = simulator.run(nominal(simulator.vehicle))["pressure"][:25]
    assert np.abs(begun - HELD_PA).max() < 2.0 * NOISE_PA
    assert np.abs(begun[10:] - HELD_PA).max() < 0.2 * NOISE_PA


@pytest.mark.parametrize("share", [0.2, 3.0])
def test_a_dead_time_changes_nothing_where_nothing_changes(simulator, share):
    car = nominal(simulator.vehicle)
    p = car.p.copy()
    p[P.ehb_dead_time_s] *= share
    other = simulator.run(replace(car, p=p))["pressure"][:250]
    assert np.abs(other - simulator.run(car)["pressure"][:250]).max() < 1.0
