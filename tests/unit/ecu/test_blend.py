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


@pytest.fixture
def simple(parameters):
    """Fades from 3 to 1 m/s, friction half a second ahead; a limit changes hands in 1/8 s."""
    return dataclasses.replace(
        parameters.blend, fade_start_mps=3.0, fade_end_mps=1.0, friction_lead_s=0.5, charge_handover_s=0.125
    )


@pytest.mark.parametrize(
    ("speed", "share"), [(4.0, 1.0), (3.0, 1.0), (2.5, 0.75), (1.25, 0.125), (1.0, 0.0), (-2.0, 0.0)]
)
def test_share_left_at_a_speed(simple, speed, share):
    assert fade(speed, simple) == share


def test_what_is_asked_of_each_motor(parameters):
    motor = dataclasses.replace(parameters.motor, torque_max_nm=300.0)
    demand, available = (100.0, 200.0, 400.0, 800.0), (1000.0, 50.0, 1000.0, 1000.0)
    assert wanted_torque(demand, 0.5, available, motor) == (50.0, 50.0, 200.0, 300.0)
    assert wanted_torque(demand[::-1], 0.5, available[::-1], motor) == (300.0, 200.0, 50.0, 50.0)
    assert wanted_torque((80.0,) * 4, 0.5, (10.0, 20.0, 30.0, 35.0), motor) == (10.0, 20.0, 30.0, 35.0)
    assert wanted_torque((900.0,) * 4, 0.5, PLENTY, motor) == (300.0,) * 4
    for factor in (0.0, -0.5):
        assert wanted_torque(demand, factor, available, motor) == (0.0,) * 4
    assert wanted_torque(demand, 1.5, PLENTY, motor) == (150.0, 300.0, 300.0, 300.0)


def ramped(held, announced, power, simple, dt_s=1 / 64):
    return tuple(ramp_charge_limit(ChargePower(*held), announced, power, simple, dt_s))


@pytest.mark.parametrize(
    ("held", "announced", "power", "after"),
    [
        ((100.0, 100.0, 100.0), 80.0, 64.0, (80.0, 80.0, 80.0)),  # does not bind
        ((64.0, 64.0, 64.0), 64.0, 64.0, (64.0, 64.0, 64.0)),
        ((64.0, 64.0, 64.0), 80.0, 64.0, (80.0, 80.0, 80.0)),
        ((2.0, 2.0, 2.0), math.nan, 64.0, (0.0, 2.0 - 2 / 17, 2.0 - 2 / 17 / 17)),
        ((0.0, 0.0, 0.0), 0.0, 0.0, (0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), 0.0, 0.5, (0.0, 0.0, 0.0)),
        # an eighth of the power in a tick; each lag takes a seventeenth of its way
        ((64.0, 64.0, 64.0), 0.0, 64.0, (56.0, 64.0 - 8 / 17, 64.0 - 8 / 17 / 17)),
        ((640.0, 640.0, 640.0), 0.0, 64.0, (56.0, 64.0 - 8 / 17, 64.0 - 8 / 17 / 17)),  # from what is in use
        ((64.0, 64.0, 64.0), 60.0, 64.0, (60.0, 64.0 - 4 / 17, 64.0 - 4 / 17 / 17)),
        ((64.0, 64.0, 64.0), math.nan, 64.0, (56.0, 64.0 - 8 / 17, 64.0 - 8 / 17 / 17)),
        ((0.0, 0.0, 0.0), 100.0, 64.0, (8.0, 8 / 17, 8 / 17 / 17)),
        ((60.0, 0.0, 0.0), 100.0, 64.0, (64.0, 64 / 17, 64 / 17 / 17)),  # no more than is used
        ((64.0, 30.0, 64.0), 64.0, 64.0, (64.0, 32.0, 64.0 - 32 / 17)),
        ((64.0, 64.0, 30.0), 64.0, 64.0, (64.0, 64.0, 32.0)),
        ((30.0, 64.0, 64.0), 64.0, 64.0, (38.0, 64.0 - 26 / 17, 64.0 - 26 / 17 / 17)),
        ((10.0, 20.0, 30.0), 10.0, 64.0, (10.0, 20.0 - 10 / 17, 30.0 - (10.0 + 10 / 17) / 17)),
    ],
)
def test_one_tick_of_a_handing_over(simple, held, announced, power, after):
    assert ramped(held, announced, power, simple) == pytest.approx(after, rel=1e-12)


@pytest.mark.parametrize(
    ("power", "charge", "speed", "deceleration", "motors", "friction"),
    [
        (0.0, (1.0, 1.0, 1.0), 10.0, 2.0, 1.0, 1.0),  # no power: nothing to limit
        (-5.0, (1.0, 1.0, 1.0), 2.0, 0.5, 0.5, 0.375),
        (0.5, (0.25, 9.0, 0.125), 10.0, 2.0, 0.25, 0.5),
        (100.0, (25.0, 9.0, 75.0), 10.0, 2.0, 0.75, 0.25),
        (100.0, (200.0, 9.0, 300.0), 10.0, 2.0, 1.0, 1.0),
        (100.0, (25.0, 9.0, 75.0), 2.0, 1.0, 0.375, 0.0625),
        (100.0, (100.0, 9.0, 100.0), 2.0, -1.0, 0.5, 0.75),
    ],
)
def test_shares_of_one_tick(simple, power, charge, speed, deceleration, motors, friction):
    """Each wheel another demand, and a quarter of it from the motor."""
    demand, wanted = (80.0, 160.0, 320.0, 640.0), (20.0, 40.0, 80.0, 160.0)
    result = blend(demand, wanted, power, ChargePower(*charge), speed, deceleration, simple)
    assert result.motor_nm == tuple(motors * w for w in wanted)
    assert result.friction_nm == tuple(d - friction * w for d, w in zip(demand, wanted, strict=True))
