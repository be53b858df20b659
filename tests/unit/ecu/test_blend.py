import dataclasses

import pytest

from ecu.law.blend import blend, fade
from ecu.law.friction import friction_torque, gains, pressure_demand

DEMAND = (500.0, 500.0, 200.0, 200.0)
PLENTY = (700.0,) * 4


def shares(parameters, factor=0.7, available=PLENTY, power=500e3, speed=20.0, decel=3.0):
    return blend(DEMAND, factor, available, power, speed, speed / 0.308, decel, parameters.blend, parameters.motor)


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
    ahead = blend(DEMAND, 0.7, PLENTY, 5e5, middle - b.friction_lead_s * 3.0, 10.0, 0.0, b, parameters.motor)
    assert result.friction_nm == pytest.approx(ahead.friction_nm)
    no_lead = dataclasses.replace(b, friction_lead_s=0.0)
    assert sum(result.friction_nm) > sum(
        blend(DEMAND, 0.7, PLENTY, 5e5, middle, 10.0, 3.0, no_lead, parameters.motor).friction_nm
    )


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
