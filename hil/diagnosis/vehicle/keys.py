"""Keys of a vehicle set: short names of common parameters; all others are the plant's own flat names."""

from typing import Final

ALIASES: Final = {
    "mass_kg": "vehicle_mass_kg",
    "wheelbase_m": "wheelbase_m",
    "cog_height_m": "vehicle_cog_height_m",
    "cog_to_front_m": "cog_to_front_axle_m",
    "cog_from_front_m": "cog_to_front_axle_m",
    "cog_from_front_axle_m": "cog_to_front_axle_m",
    "cog_x_m": "cog_to_front_axle_m",
    "cog_to_rear_m": "cog_to_rear_axle_m",
    "wheel_radius_m": "wheel_rolling_radius_m",
    "rolling_radius_m": "wheel_rolling_radius_m",
    "tyre_radius_m": "wheel_rolling_radius_m",
    "radius_m": "wheel_rolling_radius_m",
    "wheel_inertia_kg_m2": "wheel_inertia_kg_m2",
    "brake_gain_front_nm_pa": "brake_gain_front",
    "brake_gain_rear_nm_pa": "brake_gain_rear",
    "brake_gain_front_nm_per_pa": "brake_gain_front",
    "brake_gain_rear_nm_per_pa": "brake_gain_rear",
    "drag_coefficient": "vehicle_drag_coefficient",
    "frontal_area_m2": "vehicle_frontal_area_m2",
    "air_density_kg_m3": "vehicle_air_density_kg_m3",
    "rolling_resistance": "vehicle_rolling_resistance",
    "track_m": "vehicle_track_m",
    "yaw_inertia_kg_m2": "vehicle_yaw_inertia_kg_m2",
    "steering_ratio": "vehicle_steering_ratio",
    "ambient_k": "friction_brake_ambient_k",
    "piston_area_m2": "friction_brake_piston_area_m2",
    "effective_radius_m": "friction_brake_effective_radius_m",
    "threshold_pressure_pa": "friction_brake_threshold_pressure_pa",
    "ehb_frequency_hz": "ehb_natural_frequency_hz",
    "ehb_damping": "ehb_damping_ratio",
    "imu_cutoff_hz": "sensor_imu_cutoff_hz",
    "dead_time_s": "ehb_dead_time_s",
    "natural_frequency_hz": "ehb_natural_frequency_hz",
    "damping_ratio": "ehb_damping_ratio",
    "torque_constant_nm_a": "motor_torque_constant_nm_a",
}
"""Short name -> flat name."""

DERIVED: Final = {
    "lift_front": ("vehicle_lift_coefficient", 0, 1.0),
    "lift_rear": ("vehicle_lift_coefficient", 1, 1.0),
    "pad_gamma_front_k_w": ("pad_gamma_k_w", 0, 1.0),
    "pad_gamma_rear_k_w": ("pad_gamma_k_w", 1, 1.0),
    "disc_heat_front_j_k": ("friction_brake_heat_capacity_j_k", 0, 1.0),
    "disc_heat_rear_j_k": ("friction_brake_heat_capacity_j_k", 1, 1.0),
    "disc_cooling_front_w_k": ("friction_brake_cooling_w_k", 0, 1.0),
    "disc_cooling_rear_w_k": ("friction_brake_cooling_w_k", 1, 1.0),
    "disc_cooling_speed_front_ws_m_k": ("friction_brake_cooling_speed_ws_m_k", 0, 1.0),
    "disc_cooling_speed_rear_ws_m_k": ("friction_brake_cooling_speed_ws_m_k", 1, 1.0),
    "slip_stiffness": ("tyre_lkx", 0, 1.0 / 22.3),
    "tyre_friction": ("tyre_lmux", 0, 1.0 / 1.15),
    "cornering_stiffness": ("tyre_lky", 0, 1.0 / 17.5),
    "relaxation_length_m": ("tyre_lsgkp", 0, 0.373 / 0.25),
    "pitch_frequency_hz": ("suspension_ride_rate_n_m", None, 2.0 * 30000.0 / 1.4),
    "pitch_damping": ("suspension_damping_ns_m", None, 2400.0 / 0.3),
    "dive_rad_s2_m": ("suspension_brake_support_tangent", None, 0.27 / 0.00231),
}
"""Key -> (parameter of the plant, index in a pair, factor). Index None: only its tolerance counts, for both axles."""

SPECIAL: Final = {
    "wheelbase_m", "cog_to_front_axle_m", "cog_to_rear_axle_m", "front_weight_share", "brake_gain_front",
    "brake_gain_rear",
}  # fmt: skip
"""Names that are not a parameter of the plant by themselves; brake gains are N m at one wheel per Pa."""

AXLES: Final = ("front", "rear")
"""Ends of the names of what stands once for each axle."""

LINE: Final = "line_lag_s"
"""Lag of the pads behind the pressure sensors, as one pole; a set states its tolerance alone."""
LINE_S: Final = 8e-3
"""Default half-width of the line lag, s: 5 to 20 ms of a line, which many sets count into their dead time
(`plant.effects.hydraulics.pressure_location`)."""

WIDE: Final = {
    "vehicle_mass_kg": 0.1,
    "vehicle_cog_height_m": 0.15,
    "vehicle_drag_coefficient": 0.3,
    "vehicle_rolling_resistance": 0.4,
    "wheel_rolling_radius_m": 0.03,
    "wheel_inertia_kg_m2": 0.3,
    "tyre_lkx": 0.4,
    "tyre_lmux": 0.2,
    "vehicle_yaw_inertia_kg_m2": 0.3,
    "tyre_lky": 0.4,
    "friction_brake_threshold_pressure_pa": 1.0,
    "ehb_natural_frequency_hz": 0.8,
    "ehb_damping_ratio": 0.8,
    "ehb_dead_time_s": 1.0,
    "motor_time_constant_s": 0.8,
    "sensor_imu_cutoff_hz": 1.0,
    "tyre_lsgkp": 0.6,
    "suspension_ride_rate_n_m": 2.0,
    "suspension_damping_ns_m": 1.0,
    "suspension_brake_support_tangent": 1.0,
}
"""Default half-width of a parameter that a set does not state, as a share of the shipped value, the larger axle's. The
links of a car support from nothing up to all of the dive and the lift: 0.35 at the front, 0.55 at the rear (a car that
does not pitch, as in models without springs)."""

LUMPED: Final = {
    "motor_time_constant_s": 0.7, "ehb_natural_frequency_hz": 0.4, "ehb_damping_ratio": 0.4, "ehb_dead_time_s": 0.5,
}  # fmt: skip
"""Least half-width, as a share of the value, of what a set states of an actuator's delay where it does not state every
limit: dead time, lag and rate limit are often stated as one number. A time constant of 25 ms may be a dead time of 14
and a lag of 11."""

UNLIMITED: Final = {
    "ehb": ({"build_rate_pa_s": 5e8, "release_rate_pa_s": 5e8},),
    "motor": (
        {"peak_torque_nm": 5e3}, {"peak_power_w": 5e5, "max_speed_rad_s": 1e3}, {"rate_limit_nm_s": 1e6},
        {"fade_end_mps": 0.0, "fade_start_mps": 0.1}, {"derating_start_k": 9e3, "derating_end_k": 1e4},
    ),
    "battery": ({"charge_power_w": 1e6, "discharge_power_w": 1e6},),
    "tyre": (),
}  # fmt: skip
"""Limits out of reach, for those that a set does not state: another car's limits would be wrong."""

_SECTIONS: Final = (
    "friction_brake", "vehicle", "suspension", "wheel", "tyre", "ehb", "pad", "motor", "battery", "sensor",
)  # fmt: skip


def split_name(flat: str) -> tuple[str, str]:
    """Section of a parameter of the plant, and its name there, by its flat name."""
    section = next(section for section in _SECTIONS if flat.startswith(f"{section}_"))
    return section, flat.removeprefix(f"{section}_")
