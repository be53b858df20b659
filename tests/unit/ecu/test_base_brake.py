import itertools

import pytest

from ecu.law import base_brake


def test_sixty_percent_pedal_demands_about_three_point_two(parameters):
    assert base_brake.reference_deceleration(0.6, parameters.pedal) == pytest.approx(3.2, abs=0.02)


def test_pedal_map_is_progressive_and_zero_in_the_free_travel(parameters):
    values = [base_brake.reference_deceleration(i / 100, parameters.pedal) for i in range(101)]
    steps = [b - a for a, b in itertools.pairwise(values)]
    assert values[:6] == [0.0] * 6
    assert all(later >= earlier - 1e-12 for earlier, later in itertools.pairwise(steps))
    assert base_brake.reference_deceleration(1.4, parameters.pedal) == values[-1]


def test_brake_torque_gives_the_demanded_deceleration(parameters):
    v = parameters.vehicle
    torque = base_brake.brake_torque(3.0, 300.0, v.mass_kg, v)
    # Newton for car and wheels: m a = T/r + F_R - 4 I (a/r) / r
    force = torque / v.force_arm_m + 300.0 - 4 * v.wheel_inertia_kg_m2 * 3.0 / v.rolling_radius_m**2
    assert force / v.mass_kg == pytest.approx(3.0)


def test_driving_resistance_at_speed_and_rest(parameters):
    v = parameters.vehicle
    assert base_brake.driving_resistance(20.0, v.mass_kg, v) == pytest.approx(
        0.5 * 1.205 * 0.645 * 400 + 1463 * 9.80665 * 0.011
    )
    assert base_brake.driving_resistance(0.0, v.mass_kg, v) == 0.0


def test_distribution_keeps_the_sum():
    parts = base_brake.distribute(1000.0, 0.7)
    assert parts == (350.0, 350.0, pytest.approx(150.0), pytest.approx(150.0))
