import dataclasses

import pytest

from ecu.law.compensation import friction_in_use, motor_factor

NOMINAL = 0.38
USED = (NOMINAL,) * 4
FULL = (1.0,) * 4


def test_follows_the_estimate_at_a_limited_rate(parameters):
    p = parameters.compensation
    used = friction_in_use(USED, (0.30, 0.37, 0.38, 0.50), FULL, NOMINAL, p, 0.01)
    step = p.rate_1_s * NOMINAL * 0.01
    assert used == pytest.approx((NOMINAL - step, NOMINAL - step, NOMINAL, NOMINAL + step))
    for _ in range(200):
        used = friction_in_use(used, (0.30, 0.37, 0.38, 0.50), FULL, NOMINAL, p, 0.01)
    assert used == pytest.approx((0.30, 0.37, 0.38, 0.50))


def test_holds_at_no_confidence(parameters):
    held = (0.31, 0.32, 0.33, 0.34)
    assert friction_in_use(held, (0.5,) * 4, (0.0,) * 4, NOMINAL, parameters.compensation, 0.01) == held


def test_authority_bounds_what_an_estimate_can_do(parameters):
    p = parameters.compensation
    low, high = USED, USED
    for _ in range(1000):
        low = friction_in_use(low, (0.01,) * 4, FULL, NOMINAL, p, 0.01)
        high = friction_in_use(high, (1.2,) * 4, FULL, NOMINAL, p, 0.01)
    assert low[0] == pytest.approx(max(NOMINAL * (1 - p.authority), p.friction_lowest))
    assert high[0] == pytest.approx(min(NOMINAL * (1 + p.authority), p.friction_highest))


def test_switched_off_it_uses_the_nominal_friction(parameters):
    p = dataclasses.replace(parameters.compensation, enabled=False)
    assert friction_in_use((0.3,) * 4, (0.3,) * 4, FULL, NOMINAL, p, 0.01) == USED


def test_weak_pads_move_work_to_the_motors_where_blending_is_on(parameters):
    p = parameters.compensation
    weak = (0.7 * NOMINAL,) * 4
    assert motor_factor(0.5, weak, NOMINAL, p) == pytest.approx(
        0.5 * (1 + p.motor_preference * (p.motor_preference_from - 0.7))
    )
    assert motor_factor(0.5, USED, NOMINAL, p) == 0.5
    assert motor_factor(0.0, weak, NOMINAL, p) == 0.0
    assert motor_factor(0.99, (0.1,) * 4, NOMINAL, p) == 1.0
