"""Bounds of the keys of a vehicle set: what no road vehicle leaves, from a quadricycle (425 kg, EU 168/2013) to a 40 t
truck (96/53/EC). They catch a value in another unit, not a wrong one."""

import re
from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.diagnosis.data.log import UnusableError

Range = tuple[float, float, str]
_LENGTH: Final[Mapping[str, float]] = {"mm": 1e-3, "cm": 1e-2, "inches": 0.0254}
_PER_PRESSURE: Final[Mapping[str, float]] = {"N m/bar": 1e-5, "N m/MPa": 1e-6, "N m/kPa": 1e-3, "N m/psi": 1 / 6894.757}
_PRESSURE: Final[Mapping[str, float]] = {"bar": 1e5, "MPa": 1e6, "kPa": 1e3}
_FREQUENCY: Final[Mapping[str, float]] = {"rad/s": 0.5 / np.pi}
_TIME: Final[Mapping[str, float]] = {"ms": 1e-3}

BOUNDS: Final[Mapping[str, Range]] = {
    "vehicle_mass_kg": (150.0, 60e3, "kg"),
    "wheelbase_m": (1.0, 15.0, "m"),
    "cog_to_front_axle_m": (0.1, 14.0, "m"),
    "cog_to_rear_axle_m": (0.1, 14.0, "m"),
    "front_weight_share": (0.05, 0.95, ""),
    "brake_gain_front": (1e-6, 0.1, "N m/Pa"),
    "brake_gain_rear": (1e-6, 0.1, "N m/Pa"),
    "vehicle_unsprung_mass_kg": (5.0, 6e3, "kg"),
    "vehicle_cog_to_axle_m": (0.1, 14.0, "m"),
    "vehicle_cog_height_m": (0.1, 3.0, "m"),
    "vehicle_track_m": (0.5, 3.0, "m"),
    "vehicle_roll_inertia_kg_m2": (10.0, 3e5, "kg m2"),
    "vehicle_pitch_inertia_kg_m2": (30.0, 2e6, "kg m2"),
    "vehicle_yaw_inertia_kg_m2": (30.0, 2e6, "kg m2"),
    "vehicle_frontal_area_m2": (0.3, 15.0, "m2"),
    "vehicle_drag_coefficient": (0.0, 2.0, ""),
    "vehicle_lift_coefficient": (-5.0, 2.0, ""),
    "vehicle_air_density_kg_m3": (0.5, 2.0, "kg/m3"),
    "vehicle_rolling_resistance": (0.0, 0.1, ""),
    "vehicle_rolling_resistance_speed_s2_m2": (-1e-4, 1e-4, "s2/m2"),
    "vehicle_steering_ratio": (1.0, 60.0, ""),
    "vehicle_slip_angle_share": (0.05, 20.0, ""),
    "suspension_ride_rate_n_m": (1e3, 5e6, "N/m"),
    "suspension_progression_n_m3": (-1e9, 1e9, "N/m3"),
    "suspension_damping_ns_m": (0.0, 5e5, "N s/m"),
    "suspension_anti_roll_nm_rad": (-2e6, 2e7, "N m/rad"),
    "suspension_brake_support_tangent": (-3.0, 3.0, ""),
    "suspension_drive_support_tangent": (-3.0, 3.0, ""),
    "suspension_roll_centre_height_m": (-0.5, 1.5, "m"),
    "wheel_rolling_radius_m": (0.12, 0.8, "m"),
    "wheel_inertia_kg_m2": (0.02, 300.0, "kg m2"),
    "wheel_brake_windup_nm_rad": (100.0, 1e8, "N m/rad"),
    "wheel_brake_windup_time_s": (0.0, 1.0, "s"),
    "ehb_natural_frequency_hz": (0.1, 200.0, "Hz"),
    "ehb_damping_ratio": (0.01, 20.0, ""),
    "ehb_dead_time_s": (0.0, 1.0, "s"),
    "ehb_build_rate_pa_s": (1e5, 1e10, "Pa/s"),
    "ehb_release_rate_pa_s": (1e5, 1e10, "Pa/s"),
    "ehb_max_pressure_pa": (2e5, 1e8, "Pa"),
    "ehb_pedal_free_travel": (0.0, 0.9, ""),
    "ehb_pedal_map_linear_pa": (-1e8, 1e8, "Pa"),
    "ehb_pedal_map_square_pa": (-1e8, 1e8, "Pa"),
    "ehb_pedal_map_cubic_pa": (-1e8, 1e8, "Pa"),
    "friction_brake_piston_area_m2": (1e-5, 0.1, "m2"),
    "friction_brake_effective_radius_m": (0.03, 0.4, "m"),
    "friction_brake_threshold_pressure_pa": (0.0, 3e6, "Pa"),
    "friction_brake_efficiency": (0.3, 1.05, ""),
    "friction_brake_heat_capacity_j_k": (100.0, 2e5, "J/K"),
    "friction_brake_cooling_w_k": (0.0, 500.0, "W/K"),
    "friction_brake_cooling_speed_ws_m_k": (0.0, 50.0, "W s/(m K)"),
    "friction_brake_ambient_k": (220.0, 340.0, "K"),
    "pad_gamma_k_w": (0.0, 10.0, "K/W"),
    "pad_heating_with_mu": (0.0, 1.0, ""),
    "pad_temperature_of_disc": (0.0, 1.0, ""),
    "motor_peak_torque_nm": (1.0, 2e5, "N m"),
    "motor_peak_power_w": (100.0, 2e6, "W"),
    "motor_max_speed_rad_s": (10.0, 5e3, "rad/s"),
    "motor_time_constant_s": (0.0, 2.0, "s"),
    "motor_rate_limit_nm_s": (10.0, 1e8, "N m/s"),
    "motor_fade_end_mps": (0.0, 30.0, "m/s"),
    "motor_fade_start_mps": (0.0, 40.0, "m/s"),
    "motor_torque_constant_nm_a": (1e-3, 200.0, "N m/A"),
    "motor_copper_loss_w_nm2": (0.0, 100.0, "W/(N m)2"),
    "motor_winding_resistance_k_w": (1e-5, 10.0, "K/W"),
    "motor_winding_time_s": (0.1, 1e5, "s"),
    "motor_derating_start_k": (250.0, 2e4, "K"),
    "motor_derating_end_k": (250.0, 2e4, "K"),
    "battery_capacity_j": (1e5, 1e10, "J"),
    "battery_charge_power_w": (0.0, 1e7, "W"),
    "battery_discharge_power_w": (0.0, 1e7, "W"),
    "battery_taper_start_soc": (0.0, 1.0, ""),
    "battery_taper_end_soc": (0.0, 1.05, ""),
    "battery_notice_s": (0.0, 60.0, "s"),
    "sensor_teeth": (4.0, 1e4, ""),
    "sensor_tooth_timeout_s": (1e-3, 10.0, "s"),
    "sensor_wheel_speed_noise": (0.0, 0.5, ""),
    "sensor_imu_cutoff_hz": (0.01, 1e4, "Hz"),
    "sensor_acceleration_offset_mps2": (-20.0, 20.0, "m/s2"),
    "sensor_acceleration_noise_mps2": (0.0, 20.0, "m/s2"),
    "sensor_yaw_rate_offset_rad_s": (-1.0, 1.0, "rad/s"),
    "sensor_yaw_rate_noise_rad_s": (0.0, 1.0, "rad/s"),
    "sensor_pressure_offset_pa": (-1e7, 1e7, "Pa"),
    "sensor_pressure_noise_pa": (0.0, 1e7, "Pa"),
    "sensor_pedal_offset": (-1.0, 1.0, ""),
    "sensor_pedal_noise": (0.0, 1.0, ""),
    "sensor_current_noise_a": (0.0, 1e3, "A"),
    "sensor_steering_noise_rad": (0.0, 1.0, "rad"),
    "tyre_unloaded_radius": (0.12, 0.8, "m"),
    "tyre_fnomin": (200.0, 1e5, "N"),
    "tyre_relaxation_least_m": (1e-3, 2.0, "m"),
    "tyre_low_speed_mps": (0.05, 10.0, "m/s"),
    "tyre_low_speed_damping_ns_m": (0.0, 1e6, "N s/m"),
    "pad_a_1_ks": (1e-12, 1e3, "1/(K s)"),
    "pad_b_1_j": (1e-14, 1e3, "1/J"),
    "pad_c_1_s": (0.0, 1e3, "1/s"),
    "pad_epsilon_w": (1.0, 1e14, "W"),
}
"""Flat name -> least, greatest, unit."""
_TYRE: Final = ((re.compile(r"tyre_l"), (-1.0, 20.0, "")), (re.compile(r"tyre_[pr]"), (-1e3, 1e3, "")))
"""Scale factors and coefficients of the Magic Formula (Pacejka 2012): all of order one to some tens."""
_UNITS: Final[Mapping[str, Mapping[str, float]]] = {
    "N m/Pa": _PER_PRESSURE, "m": _LENGTH, "kg": {"t": 1e3, "lb": 0.45359237}, "Pa": _PRESSURE, "Hz": _FREQUENCY,
    "Pa/s": {f"{unit}/s": factor for unit, factor in _PRESSURE.items()}, "s": _TIME,
    "m2": {"cm2": 1e-4, "mm2": 1e-6}, "W": {"kW": 1e3}, "J": {"kWh": 3.6e6, "MJ": 1e6, "kJ": 1e3},
    "N/m": {"N/mm": 1e3}, "N m/rad": {"N m/deg": 180.0 / np.pi}, "rad/s": {"rpm": np.pi / 30.0},
    "m/s": {"km/h": 1.0 / 3.6}, "N m": {"kN m": 1e3}, "": {"%": 0.01},
}  # fmt: skip
"""Unit of a key -> units that it is often given in by mistake, with their factors."""


def bounds_of(name: str) -> Range:
    """Least and greatest plausible value of a key by its flat name, and its unit; no bounds for an unknown one."""
    if name in BOUNDS:
        return BOUNDS[name]
    return next((limits for stem, limits in _TYRE if stem.match(name)), (-np.inf, np.inf, ""))


def refuse_implausible(where: str, key: str, name: str, given: float | list[float], factor: float = 1.0) -> None:
    """Refuse a value that no road vehicle has.

    Parameters
    ----------
    where, key : file and key, for the message.  name : flat name.  given : as written.
    factor : the parameter per the key's own number.

    Raises
    ------
    UnusableError
        With the bounds, and the unit in which the number would lie within them.
    """
    least, greatest, unit = bounds_of(name)
    low, high = least / factor, greatest / factor
    for value in given if isinstance(given, list) else [given]:
        if low <= value <= high:
            continue
        shown = f" {unit}" if unit and factor == 1.0 else ""
        raise UnusableError(
            f"{where}: {key}: expected {low:.4g} to {high:.4g}{shown}, as every road vehicle has, got {value:g}"
            f"{_other_unit(key, value, shown.strip(), low, high)}"
        )


def _other_unit(key: str, value: float, unit: str, low: float, high: float) -> str:
    """The unit in which a value lies within the bounds, and the value to write."""
    if unit == "K" and low <= value + 273.15 <= high:
        return f"; degC? Write {key} = {value + 273.15:.5g}"
    for other, factor in _UNITS.get(unit, {}).items():
        if low <= value * factor <= high:
            return f"; {other}? Write {key} = {value * factor:.5g}"
    return "; another unit, or another quantity? docs/vehicle-set.md has every key with its unit"
