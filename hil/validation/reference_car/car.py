"""The reference car's numbers: what its maker would state, and how far off the true values may be."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

GRAVITY_MPS2 = 9.81

REFERENCE_MU = 0.39832
"""Pad friction for which ``brake_gain_*`` is stated: at rest at 423.15 K with the nominal ``pad_*``."""


class Car(NamedTuple):
    """Numbers of one car, SI. What of them goes into ``vehicle.toml``: `hil.validation.reference_car.files`.

    Tyre: force D sin(C atan(x - E (x - atan(x)))), x = K s / (C D), E = ``tyre_curvature`` +
    ``tyre_curvature_load`` dfz, K = ``slip_stiffness`` Fz (1 + ``slip_stiffness_load`` dfz),
    D = ``tyre_friction`` Fz (1 + ``tyre_friction_load`` dfz), dfz = Fz / 4000 N - 1.
    Brake: torque = ``brake_gain`` mu / 0.398 (p - ``threshold_pressure``), mu and its temperature by Ricciardi et al.,
    equations (3) and (4), with ``pad_a`` to ``pad_epsilon``. ``dive_rad_s2_m``: pitch angle over deceleration by the
    wheels; ``roll_rad_s2_m``: roll angle over lateral acceleration.
    """

    mass_kg: float = 1463.0
    cog_to_front_axle_m: float = 1.20
    wheelbase_m: float = 2.59
    cog_height_m: float = 0.53
    track_m: float = 1.516
    yaw_inertia_kg_m2: float = 1950.0
    drag_coefficient: float = 0.30
    frontal_area_m2: float = 2.15
    lift_front: float = 0.05
    lift_rear: float = 0.08
    air_density_kg_m3: float = 1.205
    rolling_resistance: float = 0.011
    steering_ratio: float = 16.0
    dive_rad_s2_m: float = 0.00231
    pitch_frequency_hz: float = 1.4
    pitch_damping: float = 0.3
    roll_rad_s2_m: float = 0.0063
    rolling_radius_m: float = 0.308
    wheel_inertia_kg_m2: float = 1.5
    slip_stiffness: float = 22.3
    slip_stiffness_load: float = 0.235
    tyre_friction: float = 1.174
    tyre_friction_load: float = -0.14
    tyre_curvature: float = 0.46
    tyre_curvature_load: float = 0.25
    cornering_stiffness: float = 16.8
    relaxation_length_m: float = 0.25
    brake_gain_front_nm_pa: float = 2.128e-4
    brake_gain_rear_nm_pa: float = 8.994e-5
    threshold_pressure_pa: float = 5.0e4
    pad_a_1_ks: float = 3.0139e-5
    pad_b_1_j: float = 9.0166e-7
    pad_c_1_s: float = 4.0e-3
    pad_gamma_front_k_w: float = 0.063333
    pad_gamma_rear_k_w: float = 0.095
    pad_epsilon_w: float = 3.551e4
    disc_heat_front_j_k: float = 3000.0
    disc_heat_rear_j_k: float = 2000.0
    disc_cooling_front_w_k: float = 4.0
    disc_cooling_rear_w_k: float = 2.7
    disc_cooling_speed_front_ws_m_k: float = 0.35
    disc_cooling_speed_rear_ws_m_k: float = 0.23
    ambient_k: float = 293.15
    ehb_frequency_hz: float = 6.0
    ehb_damping: float = 0.9
    ehb_dead_time_s: float = 0.020
    ehb_build_rate_pa_s: float = 2.5e7
    ehb_release_rate_pa_s: float = 4.0e7
    ehb_max_pressure_pa: float = 1.8e7
    motor_time_constant_s: float = 0.008
    motor_rate_limit_nm_s: float = 5000.0
    motor_peak_torque_nm: float = 700.0
    motor_peak_power_w: float = 75000.0
    motor_fade_start_mps: float = 2.7778
    motor_fade_end_mps: float = 0.8333
    motor_copper_loss_w_nm2: float = 0.0137
    motor_winding_resistance_k_w: float = 0.0455
    motor_winding_time_s: float = 60.0
    motor_derating_start_k: float = 393.15
    motor_derating_end_k: float = 423.15
    battery_charge_power_w: float = 80000.0
    battery_capacity_j: float = 1.8e8
    battery_taper_start_soc: float = 0.90
    battery_taper_end_soc: float = 0.95
    imu_cutoff_hz: float = 30.0


TOLERANCE: dict[str, float] = {
    "mass_kg": 15.0,
    "cog_to_front_axle_m": 0.02,
    "cog_height_m": 0.02,
    "yaw_inertia_kg_m2": 100.0,
    "drag_coefficient": 0.012,
    "rolling_resistance": 0.0006,
    "dive_rad_s2_m": 0.00015,
    "pitch_frequency_hz": 0.07,
    "pitch_damping": 0.03,
    "roll_rad_s2_m": 0.0003,
    "rolling_radius_m": 0.0015,
    "wheel_inertia_kg_m2": 0.1,
    "slip_stiffness": 2.2,
    "tyre_friction": 0.05,
    "cornering_stiffness": 2.0,
    "relaxation_length_m": 0.06,
    "brake_gain_front_nm_pa": 0.8e-5,
    "brake_gain_rear_nm_pa": 0.34e-5,
    "threshold_pressure_pa": 1.0e4,
    "pad_epsilon_w": 1500.0,
    "disc_heat_front_j_k": 300.0,
    "disc_heat_rear_j_k": 200.0,
    "disc_cooling_front_w_k": 0.6,
    "disc_cooling_rear_w_k": 0.4,
    "ehb_frequency_hz": 0.3,
    "ehb_damping": 0.05,
    "ehb_dead_time_s": 0.002,
    "motor_time_constant_s": 0.001,
    "battery_charge_power_w": 3000.0,
    "lift_front": 0.03,
    "lift_rear": 0.03,
}
"""Half-width of what the true value may be: two standard deviations, never exceeded."""

NOMINAL = Car()


def true_car(rng: np.random.Generator) -> Car:
    """Draw a car whose numbers lie within their tolerances around the nominal ones."""
    true = {}
    for name in TOLERANCE:
        share = min(max(0.5 * float(rng.standard_normal()), -1.0), 1.0)
        true[name] = getattr(NOMINAL, name) + TOLERANCE[name] * share
    return NOMINAL._replace(**true)


def static_loads(car: Car) -> NDArray[np.float64]:
    """Wheel loads at rest, N: fl, fr, rl, rr."""
    front = 0.5 * car.mass_kg * GRAVITY_MPS2 * (car.wheelbase_m - car.cog_to_front_axle_m) / car.wheelbase_m
    return np.array([front, front, 0.5 * car.mass_kg * GRAVITY_MPS2 - front, 0.5 * car.mass_kg * GRAVITY_MPS2 - front])
