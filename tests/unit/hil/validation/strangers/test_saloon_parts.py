"""Brakes and tyres of the hydraulic saloon against closed forms."""

import numpy as np
import pytest

from hil.validation.strangers.hydraulic_saloon.brakes import (
    RUN_OUT_PA,
    behind_valve_pa,
    disc_factor,
    drum_factor,
    master_pressure_pa,
    shoe_factor,
)
from hil.validation.strangers.hydraulic_saloon.tyres import brush_forces_n


def test_a_shoe_is_in_balance_about_its_pivot():
    # spreading force at 1.62, normal force at 0.82, friction force mu N at 0.95 radii from the pivot
    for arm in (0.95, -0.95):
        friction = shoe_factor(0.36, 1.62, 0.82, arm)
        normal = friction / 0.36
        assert 1.62 - 0.82 * normal + arm * friction == pytest.approx(0.0, abs=1e-12)


def test_a_drum_answers_friction_more_than_in_proportion_and_a_disc_in_proportion():
    assert disc_factor(0.44) / disc_factor(0.40) == pytest.approx(1.1)
    assert drum_factor(0.44) / drum_factor(0.40) > 1.13
    # exponent of the ratio: each shoe's share times its own
    mu, c, a = 0.37, 0.95, 0.82
    lead, trail = shoe_factor(mu, 1.62, a, c), shoe_factor(mu, 1.62, a, -c)
    slope = (lead * a / (a - mu * c) + trail * a / (a + mu * c)) / (lead + trail)
    numeric = np.log(drum_factor(mu * 1.001) / drum_factor(mu / 1.001)) / (2.0 * np.log(1.001))
    assert numeric == pytest.approx(slope, rel=1e-5)


def test_the_valve_bends_and_the_booster_runs_out():
    assert behind_valve_pa(2e6, 2.6e6, 0.37) == 2e6
    assert behind_valve_pa(4.6e6, 2.6e6, 0.37) == pytest.approx(2.6e6 + 0.37 * 2e6)
    assert master_pressure_pa(10.0) == 0.0
    below, above = np.diff([master_pressure_pa(f) for f in (300.0, 310.0, 500.0, 510.0)])[[0, 2]]
    assert above == pytest.approx(0.2 * below)
    assert master_pressure_pa(500.0) > RUN_OUT_PA


def test_the_brush_has_its_stiffness_its_parabola_and_its_grip():
    load, stiffness, friction = 4000.0, 21.0, 1.0
    small = brush_forces_n(-1e-6, 0.0, load, stiffness, 15.0, friction)[0]
    assert small == pytest.approx(-1e-6 * stiffness * load, rel=1e-4)
    theoretical = 0.05 / 0.95
    part = stiffness * theoretical / (3.0 * friction)
    closed = friction * load * (3.0 * part - 3.0 * part**2 + part**3)
    assert -brush_forces_n(-0.05, 0.0, load, stiffness, 15.0, friction)[0] == pytest.approx(closed, rel=1e-12)
    along, across = brush_forces_n(-0.6, 0.5, load, stiffness, 15.0, friction)
    assert np.hypot(along, across) == pytest.approx(friction * load)
