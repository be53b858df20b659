import dataclasses
import math

import pytest

from ecu.law.blend import ChargePower, blend, fade, ramp_charge_limit, wanted_torque
from ecu.law.friction import friction_torque, gains, pressure_demand

DEMAND = (500.0, 500.0, 200.0, 200.0)
PLENTY = (700.0,) * 4


def shares(parameters, factor=0.7, available=PLENTY, limit_w=500e3, speed=20.0, decel=3.0, blending=None):
    wanted = wanted_torque(DEMAND, factor, available, parameters.motor)
    power = sum(wanted) * speed / 0.308 * parameters.motor.charge_efficiency
    charge = ChargePower(limit_w, limit_w, limit_w)
    return blend(DEMAND, wanted, power, charge, speed, decel, blending or parameters.blend)


def handed_over(parameters, start_w, announced_w, power_w, seconds, dt_s=0.01):
    """What friction and motors count on after each tick."""
    held, history = ChargePower(start_w, start_w, start_w), []
    for _ in range(round(seconds / dt_s)):
        held = ramp_charge_limit(held, announced_w, power_w, parameters.blend, dt_s)
        history.append(held)
    return history


def test_factor_zero_leaves_all_to_friction(parameters):
    result = shares(parameters, 0.0)
    assert result.friction_nm == DEMAND
    assert result.motor_nm == (0.0,) * 4


def test_factor_is_the_motors_share(parameters):
    result = shares(parameters, 0.7)
    assert sum(result.motor_nm) == pytest.approx(0.7 * sum(DEMAND))


@pytest.mark.parametrize("available", [(0.0, 700.0, 700.0, 700.0), (100.0,) * 4, (0.0,) * 4])
@pytest.mark.parametrize("power", [0.0, 20e3, 500e3])
def test_friction_takes_exactly_what_the_motors_cannot(parameters, available, power):
    result = shares(parameters, 0.7, available, power)
    for d, m, f, a in zip(DEMAND, result.motor_nm, result.friction_nm, available, strict=True):
        assert m + f == pytest.approx(d)
        assert m <= a
    assert sum(result.motor_nm) * 20.0 / 0.308 * parameters.motor.charge_efficiency <= power * (1 + 1e-9)


def test_motors_fade_out_before_standstill_and_friction_leads(parameters):
    b = parameters.blend
    assert fade(b.fade_start_mps, b) == 1.0
    assert fade(b.fade_end_mps, b) == 0.0
    middle = 0.5 * (b.fade_start_mps + b.fade_end_mps)
    result = shares(parameters, 0.7, speed=middle, decel=3.0)
    ahead = shares(parameters, 0.7, speed=middle - b.friction_lead_s * 3.0, decel=0.0)
    assert result.friction_nm == pytest.approx(ahead.friction_nm)
    no_lead = shares(parameters, 0.7, speed=middle, blending=dataclasses.replace(b, friction_lead_s=0.0))
    assert sum(result.friction_nm) > sum(no_lead.friction_nm)


def test_an_announced_limit_is_handed_over_friction_first(parameters):
    history = handed_over(parameters, 80e3, 0.0, 50e3, 0.3)
    assert history[0].soon_w == pytest.approx(45e3)  # from the power in use, a tenth of it in a tick
    assert history[9].soon_w == 0.0
    assert [h.now_w for h in history] == sorted((h.now_w for h in history), reverse=True)
    assert all(h.now_w > h.soon_w for h in history[:20])
    area_s = sum(h.now_w - h.soon_w for h in history) * 0.01 / 50e3
    assert area_s == pytest.approx(parameters.blend.friction_lead_s, abs=0.011)
    assert history[-1].now_w < 1e3
    back = handed_over(parameters, 0.0, 80e3, 50e3, 0.4)
    assert [h.now_w for h in back] == sorted(h.now_w for h in back)
    assert back[-1].now_w == pytest.approx(50e3, rel=0.01)


def test_a_limit_that_does_not_bind_is_followed_at_once(parameters):
    assert handed_over(parameters, 80e3, 60e3, 50e3, 0.01) == [(60e3, 60e3, 60e3)]
    assert handed_over(parameters, 80e3, 0.0, 0.0, 0.01) == [(0.0, 0.0, 0.0)]
    assert handed_over(parameters, 80e3, math.nan, 0.0, 0.01) == [(0.0, 0.0, 0.0)]


def test_a_limit_that_binds_from_the_start_is_never_exceeded(parameters):
    held = ChargePower(1e3, 1e3, 1e3)
    for power_w in range(0, 60_000, 2_000):
        held = ramp_charge_limit(held, 1e3, float(power_w), parameters.blend, 0.01)
        assert max(held) <= 1e3


@pytest.mark.parametrize("dt_s", [0.001, 0.01, 0.02])
def test_the_handing_over_takes_the_same_time_at_any_rate(parameters, dt_s):
    history = handed_over(parameters, 80e3, 20e3, 60e3, 0.2, dt_s)
    assert history[-1].soon_w == 20e3
    assert 20e3 < history[-1].now_w < 28e3


def test_pressure_demand_inverts_the_friction_torque(parameters):
    p = parameters.friction_brake
    for gain in gains(p):
        for torque in (1.0, 100.0, 800.0):
            pressure = pressure_demand(torque, 0.33, gain, p)
            assert friction_torque(pressure, 0.33, gain, p) == pytest.approx(torque)


def test_no_torque_asks_for_no_pressure_and_the_maximum_holds(parameters):
    p = parameters.friction_brake
    assert pressure_demand(0.0, 0.38, gains(p)[0], p) == 0.0
    assert pressure_demand(1e6, 0.38, gains(p)[0], p) == p.pressure_max_pa
