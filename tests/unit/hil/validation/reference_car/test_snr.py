"""What counts as a signature, and what only answers another speed."""

import numpy as np
import pytest

from hil.validation.reference_car.case import Hidden, logs, make_case
from hil.validation.reference_car.snr import difference, whitened

MOTIONS, TORQUES = 6, slice(0, 4)
"""Tracks of the motion (wheels, accelerometer, satellite); then four torques, and all others."""


@pytest.fixture(scope="module")
def energy():
    """Squares of the whitened signature of a grade, by drive: (motion, others), summed over time."""
    case = make_case((Hidden("road_grade", "car", 0.0016),), 3, "medium")
    bare = make_case((), 3, "medium")
    own = logs(bare, clean=True)
    apart = difference(logs(case, clean=True), own)
    found = {}
    for one, a, b in zip(case.drives, apart, own, strict=True):
        rows = len(b["t_s"])
        white = whitened([a], [b], case.noise)
        motion = (white[: MOTIONS * rows].reshape(rows, MOTIONS) ** 2).sum(axis=0)
        found[one.name] = motion, (white[MOTIONS * rows :].reshape(-1, rows) ** 2).sum(axis=1)
    return found


def test_torque_that_holds_the_speed_is_no_signature(energy):
    """It ends with the demand, but later by the motor's lag."""
    motion, others = energy["m07_slalom_stop"]
    assert others[TORQUES].sum() < 0.1 < 1.0 < motion.sum()


def test_a_torque_through_zero_is_at_no_limit(energy):
    """Small triangles: torque is less than demanded, by its lag."""
    motion, _ = energy["m04_triangles"]
    assert motion[4] < 0.1 < 1.0 < motion[:4].sum()


def test_torque_at_constant_power_goes_on_until_it_is_gone(energy):
    motion, others = energy["m08_motor_hard"]
    assert others[TORQUES].sum() < 0.1
    assert motion[4] < 0.7 * motion[:4].sum()


def test_a_grade_shows_at_rest_and_wherever_the_car_rolls(energy):
    assert energy["m01_standstill"][0][4] > 1.0
    assert all(np.sum(motion) > 0.5 for motion, _ in energy.values())
