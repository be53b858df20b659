"""The equations over a record, against scipy and against where they must settle."""

from dataclasses import replace

import numpy as np
import pytest

from hil.identify.coverage import TRUTHS
from hil.identify.model import HEATINGS, Drive, Pad, Start, brake_of, drive, predict
from plant.friction import mu_equilibrium


@pytest.mark.parametrize("heating", HEATINGS)
def test_follows_scipy_at_a_tight_tolerance(clean, brake, heating):
    record = clean[heating]
    course = predict(drive(record, brake), TRUTHS[heating], Start(0.42, 343.15), heating)
    assert course.torque_nm == pytest.approx(record.torque_nm, abs=0.05)
    assert course.temperature_k == pytest.approx(record.temperature_k, abs=0.02)


@pytest.mark.parametrize("heating", HEATINGS)
def test_settles_where_the_equations_rest(heating):
    pad, power, ambient = Pad(3e-5, 9e-7, 0.05, 0.01, 4e4), 15e3, 293.15
    time = np.arange(0.0, 600.0, 0.1)
    course = predict(
        Drive(time, np.full(time.size, power), np.ones(time.size), ambient), pad, Start(0.3, 300.0), heating
    )
    mu, temperature = course.mu[-1], course.temperature_k[-1]
    heat = power * (mu if heating == "friction" else 1.0)
    assert temperature == pytest.approx(ambient + pad.gamma * heat, rel=1e-6)
    assert mu == pytest.approx(mu_equilibrium(power, temperature, pad.a, pad.b, pad.eps), rel=1e-6)


def test_torque_is_two_pads_times_friction_times_force_at_the_radius(brake):
    assert brake.torque_per_mu_nm(np.array([10e5])) * 0.4 == pytest.approx(2 * 0.4 * 0.97 * 0.00255 * 9.5e5 * 0.108)
    assert replace(brake, pads=1).torque_per_mu_nm(np.array([10e5])) * 2 == brake.torque_per_mu_nm(np.array([10e5]))
    assert brake.force_n(np.array([-1e5, 0.0, 0.5e5])).tolist() == [0.0, 0.0, 0.0]


def test_each_axle_has_its_own_brake(friction_brake):
    front, rear = brake_of(friction_brake, 0), brake_of(friction_brake, 1)
    assert (front.piston_area_m2, rear.piston_area_m2) == friction_brake.piston_area_m2
    assert (front.effective_radius_m, rear.effective_radius_m) == friction_brake.effective_radius_m
