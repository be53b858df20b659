"""Tyres, actuators and control of the van against closed forms."""

import numpy as np
import pytest

from hil.validation.strangers.brake_by_wire_van.control import (
    FADE_END_MPS,
    MOST_NM,
    MOST_W,
    motor_demand_nm,
    pressure_demands_pa,
)
from hil.validation.strangers.brake_by_wire_van.tyres import USUAL_LOAD_N, forces_n, magic_formula


def test_the_formula_has_its_slope_its_peak_and_falls_beyond():
    slip = np.linspace(0.0, 1.0, 2001)
    force = np.array([magic_formula(s, 17.0, 0.95, 1.72, 0.25) for s in slip])
    assert magic_formula(1e-7, 17.0, 0.95, 1.72, 0.25) == pytest.approx(17e-7, rel=1e-4)
    assert force.max() == pytest.approx(0.95, rel=1e-4)
    assert force[-1] < 0.85 * force.max()


def test_slips_together_share_one_grip():
    alone = forces_n(-0.1, 0.0, USUAL_LOAD_N, 17.0, 12.0, 0.95)[0]
    along, across = forces_n(-0.1, 0.1, USUAL_LOAD_N, 17.0, 12.0, 0.95)
    assert abs(along) < 0.8 * abs(alone)
    assert across > 0.0
    assert np.hypot(along, across) < 0.95 * USUAL_LOAD_N * 1.0001


def test_the_motor_is_asked_within_torque_power_and_fade():
    def settled(asked: float, speed: float) -> float:
        demand = 0.0
        for _ in range(200):
            demand = motor_demand_nm(asked, demand, speed, 0.347)
        return demand

    assert settled(-5000.0, 10.0) == pytest.approx(-MOST_NM)
    assert settled(-5000.0, 30.0) == pytest.approx(-MOST_W * 0.347 / 30.0)
    assert settled(-500.0, FADE_END_MPS) == 0.0
    assert motor_demand_nm(-900.0, 0.0, 10.0, 0.347) == pytest.approx(-50.0)


def test_clamping_makes_the_torque_that_is_left():
    front, rear = pressure_demands_pa(4000.0, 2.5e-4, 1.5e-4)
    assert 2.0 * (front - 5e4) * 2.5e-4 + 2.0 * (rear - 5e4) * 1.5e-4 == pytest.approx(4000.0)
    assert pressure_demands_pa(0.0, 2.5e-4, 1.5e-4) == (0.0, 0.0)
