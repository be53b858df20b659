"""One compiled call gives what its formulas give one after the other."""

import os
import random
import subprocess
import sys

import pytest

from ecu.law import base_brake, blend, compensation, friction
from ecu.law.actuation import actuate
from ecu.law.blend import ChargePower
from ecu.law.types import ZERO


def one_after_the_other(
    used, held, pad, confidence, mass_factor, deceleration, factor, wheel, usable, announced, dt, p
):
    nominal = p.friction_brake.pad_friction
    mu = compensation.friction_in_use(used, pad, confidence, nominal, p.compensation, dt)
    mass = p.vehicle.mass_kg * mass_factor
    speed = wheel * p.vehicle.rolling_radius_m
    resistance = base_brake.driving_resistance(speed, mass, p.vehicle)
    resistance *= min(deceleration / p.pedal.resistance_full_mps2, 1.0)
    torque = base_brake.brake_torque(deceleration, resistance, mass, p.vehicle)
    demand = base_brake.distribute(torque, p.friction_brake.front_share)
    factor_now = compensation.motor_factor(factor, mu, nominal, p.compensation)
    wanted = blend.wanted_torque(demand, factor_now, usable, p.motor)
    fl, fr, rl, rr = wanted  # added as compiled code adds: sum() compensates from Python 3.12 on
    power = (fl + fr + rl + rr) * wheel * p.motor.charge_efficiency
    charge = blend.ramp_charge_limit(held, announced, power, p.blend, dt)
    shares = blend.blend(demand, wanted, power, charge, speed, deceleration, p.blend)
    gains = friction.gains(p.friction_brake)
    return (
        mu,
        charge,
        torque,
        shares.motor_nm,
        friction.pressure_demands(shares.friction_nm, mu, gains, p.friction_brake),
    )


def four(rng, low, high):
    return tuple(rng.uniform(low, high) for _ in range(4))


@pytest.mark.parametrize("seed", range(5))
def test_the_same_to_the_last_bit(parameters, seed):
    rng = random.Random(seed)
    for _ in range(100):
        held = ChargePower(*(rng.choice((0.0, 3e4, rng.uniform(0.0, 1e5))) for _ in range(3)))
        before = four(rng, 0.2, 0.6), held, four(rng, 0.1, 0.7), four(rng, 0.0, 1.0)
        now = rng.uniform(0.8, 1.2), rng.choice((0.0, 8.0 * rng.random())), rng.choice((0.0, 0.7, 1.0))
        wheel = rng.choice((0.0, rng.uniform(0.0, 10.0), rng.uniform(0.0, 150.0)))
        usable, announced = rng.choice((ZERO, four(rng, 0.0, 900.0))), rng.choice((float("nan"), 0.0, 2e4, 3e5))
        done = actuate(*before, *now, wheel, usable, ZERO, announced, 0.01, parameters)
        assert done == one_after_the_other(*before, *now, wheel, usable, announced, 0.01, parameters)


def test_friction_makes_up_for_motors_that_drive(parameters):
    before = (0.4,) * 4, ChargePower(0.0, 0.0, 0.0), (0.4,) * 4, ZERO
    gains, brake = friction.gains(parameters.friction_brake), parameters.friction_brake
    opposing = (100.0, 0.0, 0.0, 50.0)
    alone = actuate(*before, 1.0, 4.0, 0.0, 50.0, ZERO, ZERO, 0.0, 0.01, parameters)
    more = actuate(*before, 1.0, 4.0, 0.0, 50.0, ZERO, opposing, 0.0, 0.01, parameters)
    given = [
        friction.friction_torque(b, 0.4, g, brake) - friction.friction_torque(a, 0.4, g, brake)
        for a, b, g in zip(alone.pressure_pa, more.pressure_pa, gains, strict=True)
    ]
    assert given == pytest.approx(opposing, abs=1e-6)
    released = actuate(*before, 1.0, 0.0, 0.0, 50.0, ZERO, opposing, 0.0, 0.01, parameters)
    assert released.pressure_pa == ZERO


UNCOMPILED = """
from ecu.law.actuation import actuate
from ecu.law.blend import ChargePower
from hil.scenario.scenario import load_scenario
p = load_scenario("stop72").ecu
four = (0.3, 0.4, 0.5, 0.6)
for a in (0.0, 1.234, 7.9):
    held = ChargePower(1e4, 2e4, 3e4)
    done = actuate(four, held, four, four, 1.03, a, 0.7, 55.5, (500.0,) * 4, (1.0,) * 4, 2e4, 0.01, p)
    print([float(v).hex() for part in done for v in (part if isinstance(part, tuple) else (part,))])
"""


@pytest.mark.slow
def test_the_same_uncompiled():
    told = [
        subprocess.run(
            [sys.executable, "-c", UNCOMPILED], env=os.environ | more, capture_output=True, text=True, check=True
        ).stdout
        for more in ({}, {"NUMBA_DISABLE_JIT": "1"})
    ]
    assert told[0] == told[1]
    assert told[0].count("0x") == 3 * 16
