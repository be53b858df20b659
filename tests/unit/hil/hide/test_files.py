"""What the hidden car's set tells of its suspension: a car that dives, pitches and rolls as the hidden one."""

import tomllib
from math import pi, sqrt

import pytest

from hil.hide.body import LINKS
from hil.hide.car import NOMINAL
from hil.hide.files import vehicle_toml


@pytest.fixture
def told():
    return tomllib.loads(vehicle_toml())


def stiffness(told):
    """Pitch stiffness, N m/rad, of two springs an axle."""
    front_m, rear_m = told["cog_to_front_axle_m"], told["wheelbase_m"] - told["cog_to_front_axle_m"]
    front, rear = told["suspension_ride_rate_n_m"]
    return 2.0 * (front * front_m**2 + rear * rear_m**2)


def test_springs_dive_by_what_the_links_do_not_carry(told):
    dive = (1.0 - LINKS) * told["mass_kg"] * told["cog_height_m"] / stiffness(told)
    assert dive == pytest.approx(NOMINAL.dive_rad_s2_m, rel=1e-3)


def test_the_body_pitches_at_its_frequency_and_is_damped_as_it_is(told):
    inertia = told["vehicle_pitch_inertia_kg_m2"]
    assert sqrt(stiffness(told) / inertia) / (2.0 * pi) == pytest.approx(NOMINAL.pitch_frequency_hz, rel=1e-3)
    front_m, rear_m = told["cog_to_front_axle_m"], told["wheelbase_m"] - told["cog_to_front_axle_m"]
    front, rear = told["suspension_damping_ns_m"]
    damping = 2.0 * (front * front_m**2 + rear * rear_m**2)
    assert damping / (2.0 * sqrt(stiffness(told) * inertia)) == pytest.approx(NOMINAL.pitch_damping, rel=5e-3)


def test_it_rolls_as_much_and_moves_load_across_by_weight(told):
    track_m = told["track_m"]
    by_axle = [
        bar + 0.5 * spring * track_m**2
        for bar, spring in zip(told["suspension_anti_roll_nm_rad"], told["suspension_ride_rate_n_m"], strict=True)
    ]
    assert told["mass_kg"] * told["cog_height_m"] / sum(by_axle) == pytest.approx(NOMINAL.roll_rad_s2_m, rel=1e-3)
    weight = 1.0 - told["cog_to_front_axle_m"] / told["wheelbase_m"]
    assert by_axle[0] / sum(by_axle) == pytest.approx(weight, rel=1e-3)


def test_links_carry_their_share_between_pads_and_motors_alone(told):
    front, rear = told["suspension_brake_support_tangent"]
    most = LINKS * NOMINAL.cog_height_m / NOMINAL.wheelbase_m
    pads = NOMINAL.brake_gain_front_nm_pa / (NOMINAL.brake_gain_front_nm_pa + NOMINAL.brake_gain_rear_nm_pa)
    off = told["suspension_brake_support_tangent_tolerance"]
    for tangent, share in ((front, pads), (front, 0.5), (rear, 1.0 - pads), (rear, 0.5)):
        assert abs(tangent - most / share) < 1.2 * off
