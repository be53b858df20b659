"""What the reference car's set tells of its suspension: a car that dives, pitches and rolls as the hidden one."""

import tomllib
from math import pi, sqrt

import numpy as np
import pytest

from hil.diagnosis.vehicle.load import load_vehicle
from hil.validation.reference_car.body import LINKS
from hil.validation.reference_car.car import NOMINAL
from hil.validation.reference_car.drive import PER_TICK, drive
from hil.validation.reference_car.files import vehicle_toml
from hil.validation.reference_car.manoeuvres import Manoeuvre
from hil.validation.reference_car.strengths import ROWS, S, Y
from plant.model import Scene, initial_state, replay
from plant.vectors import CUT, INPUT


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


@pytest.mark.parametrize("of", ["brake", "drive"])
def test_links_carry_their_share_of_what_slows_the_body(told, of):
    pads = NOMINAL.brake_gain_front_nm_pa / (NOMINAL.brake_gain_front_nm_pa + NOMINAL.brake_gain_rear_nm_pa)
    share = pads if of == "brake" else 0.5
    wheels = 4.0 * told["wheel_inertia_kg_m2"] / told["rolling_radius_m"] ** 2
    force_n = NOMINAL.mass_kg + wheels  # of all wheels' torques, at 1 m/s2
    front, rear = told[f"suspension_{of}_support_tangent"]
    passed = LINKS * NOMINAL.mass_kg * NOMINAL.cog_height_m / NOMINAL.wheelbase_m
    assert front * share * force_n == pytest.approx(passed, rel=5e-3)
    assert rear * (1.0 - share) * force_n == pytest.approx(passed, rel=5e-3)


@pytest.mark.parametrize(("pressure_pa", "motor_nm"), [(25e5, 0.0), (0.0, -250.0), (25e5, -150.0), (0.0, 250.0)])
def test_a_body_as_told_moves_as_the_hidden_one(told, pressure_pa, motor_nm):
    """One support of the links, for brakes and motors, left 460 in -2 log L under little noise."""
    ticks, begins = 300, 50
    pressure, motor = np.zeros((ticks, 4)), np.zeros((ticks, 4))
    pressure[begins:], motor[begins:] = pressure_pa, motor_nm
    still, held = np.zeros(ticks), np.full(ticks, np.nan)
    step = Manoeuvre("step", 30.0, 350.0, 1, pressure, motor, still, held)
    driven = drive(step, NOMINAL, np.zeros((ROWS, 4)), np.zeros(ROWS), 0, np.zeros((ticks, 2)))
    hidden, outputs = driven.states[::PER_TICK], driven.outputs[::PER_TICK]

    inputs, cut = np.zeros((ticks, INPUT.size)), CUT.zeros()
    inputs[:, INPUT.slice("pressure_pa")] = hidden[:, S.pressure_pa : S.pressure_pa + 4]
    inputs[:, INPUT.slice("motor_torque_nm")] = outputs[:, Y.motor_true_nm : Y.motor_true_nm + 4]
    cut[CUT.slice("pressure")] = cut[CUT.slice("motor_torque")] = 1.0
    vehicle = load_vehicle(told)
    start = initial_state(vehicle.parameters, 30.0, 350.0, 0.6)
    columns = ["wheel_load_n_fl", "wheel_load_n_rl", "pitch_rad"]
    simulated = replay(start, inputs, vehicle.p, columns, Scene(cut=cut))[0][begins - 5 :]
    true = np.column_stack((outputs[:, Y.load_n], outputs[:, Y.load_n + 2], hidden[:, S.pitch_rad]))[begins - 5 :]
    apart = simulated - true
    apart[:, 2] -= apart[0, 2]  # what lift pitches, the hidden sensor has beside this state
    assert (np.sqrt(np.mean(apart**2, axis=0)) < (0.025, 0.025, 0.045) * np.ptp(true, axis=0)).all()
