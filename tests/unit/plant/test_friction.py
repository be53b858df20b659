"""Equations (3) and (4), and what the sets must do by the design."""

import math
from importlib import resources

import pytest

from hil.scenario.parameters import load_set
from plant.brake_thermal import disc_temperature_rate
from plant.friction import mu_equilibrium, mu_rate, temperature_rate
from plant.parameters import OstermeyerParameters

A = {"a": 3.0139e-5, "b": 9.0166e-7, "eps": 3.551e4}


def test_equation_3_by_hand(plain):
    # -[1e-6 (5e4 + 3e4) 0.4 - 3e-5 400] = -(0.032 - 0.012)
    assert plain(mu_rate)(0.4, 5e4, 400.0, 3e-5, 1e-6, 3e4) == pytest.approx(-0.02)


def test_equation_4_by_hand(plain):
    # -4e-3 [(400 - 300) - 0.06 5e4] = -4e-3 (100 - 3000)
    assert plain(temperature_rate)(400.0, 5e4, 300.0, 4e-3, 0.06) == pytest.approx(11.6)


@pytest.mark.parametrize("power_w", [0.0, 2e4, 1e5])
def test_friction_rests_at_its_equilibrium(plain, power_w):
    mu = plain(mu_equilibrium)(power_w, 423.15, **A)
    assert plain(mu_rate)(mu, power_w, 423.15, **A) == pytest.approx(0.0, abs=1e-15)
    assert plain(mu_rate)(mu + 0.01, power_w, 423.15, **A) < 0.0


@pytest.mark.parametrize(("power_w", "tau_s"), [(0.0, 31.0), (50e3, 13.0), (100e3, 8.2)])
def test_time_constants_of_set_a(plain, paper_car, power_w, tau_s):
    pad = paper_car.pad
    rate = plain(mu_rate)(1.0, power_w, 0.0, pad.a_1_ks, pad.b_1_j, pad.epsilon_w)
    assert -1.0 / rate == pytest.approx(tau_s, rel=0.02)


def test_rest_friction_of_set_a_at_150_degc(plain, paper_car):
    pad = paper_car.pad
    assert plain(mu_equilibrium)(0.0, 423.15, pad.a_1_ks, pad.b_1_j, pad.epsilon_w) == pytest.approx(0.398, abs=5e-4)


@pytest.mark.parametrize(("name", "rest"), [("b", 0.427), ("c", 0.414)])
def test_other_sets(plain, name, rest):
    path = resources.files("plant").joinpath(f"parameters/pad_{name}.toml")
    pad = load_set(path, OstermeyerParameters)
    assert plain(mu_equilibrium)(0.0, 423.15, pad.a_1_ks, pad.b_1_j, pad.epsilon_w) == pytest.approx(rest, abs=5e-4)


@pytest.mark.parametrize("name", ["b", "c"])
def test_heat_of_the_sets_is_that_of_two_faces(paper_car, name):
    pad = load_set(resources.files("plant").joinpath(f"parameters/pad_{name}.toml"), OstermeyerParameters)
    faces = 2.0 if pad.heating_with_mu else 2.0 * 0.38
    for gamma, capacity in zip(pad.gamma_k_w, paper_car.friction_brake.heat_capacity_j_k, strict=True):
        assert pad.c_1_s * gamma == pytest.approx(faces / capacity, rel=1e-3)


def test_disc_keeps_all_heat_at_ambient_temperature(plain):
    assert plain(disc_temperature_rate)(293.15, 3000.0, 20.0, 293.15, 3000.0, 4.0, 0.35) == pytest.approx(1.0)


def test_disc_cools_faster_at_speed(plain):
    slow, fast = (plain(disc_temperature_rate)(493.15, 0.0, v, 293.15, 3000.0, 4.0, 0.35) for v in (0.0, 30.0))
    assert slow == pytest.approx(-200.0 * 4.0 / 3000.0)
    assert fast == pytest.approx(-200.0 * 14.5 / 3000.0)
    assert not math.isnan(fast)
