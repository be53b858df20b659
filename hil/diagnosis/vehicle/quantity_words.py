"""Plain words of the numbers that a fit moves, by name in the plant, in theta or by node; units of short keys."""

from typing import Final

PARAMETERS: Final = {
    "brake_gain": "torque at one wheel per brake pressure",
    "vehicle_mass_kg": "mass of the car",
    "vehicle_cog_height_m": "height of the centre of gravity",
    "vehicle_cog_to_axle_m": "centre of gravity behind the front axle",
    "vehicle_drag_coefficient": "drag coefficient",
    "vehicle_lift_coefficient": "lift coefficient of the axle",
    "vehicle_rolling_resistance": "rolling resistance",
    "vehicle_roll_inertia_kg_m2": "roll inertia of the body",
    "vehicle_pitch_inertia_kg_m2": "pitch inertia of the body",
    "vehicle_yaw_inertia_kg_m2": "yaw inertia of the car",
    "vehicle_steering_ratio": "steering ratio",
    "vehicle_slip_angle_share": "slip angle of the tyres over that of the axle",
    "wheel_rolling_radius_m": "rolling radius of the wheels",
    "wheel_inertia_kg_m2": "inertia of a wheel with all that turns with it",
    "wheel_brake_windup_time_s": "damping of the brake's wind-up, as a time",
    "tyre_lkx": "longitudinal tyre force per slip and load",
    "tyre_lmux": "highest longitudinal tyre force per load",
    "tyre_lky": "lateral tyre force per slip angle and load",
    "tyre_lmuy": "highest lateral tyre force, a factor",
    "tyre_lsgkp": "relaxation length of the longitudinal tyre force",
    "tyre_lsgal": "relaxation length of the lateral tyre force, a factor",
    "tyre_lex": "curvature of the tyre curve near its peak, a factor",
    "tyre_lcx": "shape of the tyre curve, a factor",
    "tyre_pkx3": "longitudinal tyre stiffness over the load, an exponent",
    "tyre_pky2": "lateral tyre stiffness over the load",
    "tyre_pdx2": "tyre friction over the load",
    "tyre_ptx2": "relaxation length over the load",
    "suspension_ride_rate_n_m": "spring rate at one wheel",
    "suspension_progression_n_m3": "progression of the spring rate",
    "suspension_damping_ns_m": "damping at one wheel",
    "suspension_anti_roll_nm_rad": "rate of the anti-roll bar",
    "suspension_brake_support_tangent": "support of brake forces by the links",
    "suspension_drive_support_tangent": "support of motor forces by the links",
    "suspension_roll_centre_height_m": "height of the roll centre",
    "ehb_natural_frequency_hz": "natural frequency of the pressure control",
    "ehb_damping_ratio": "damping of the pressure control",
    "ehb_dead_time_s": "dead time of the pressure control",
    "ehb_build_rate_pa_s": "fastest rise of the pressure",
    "ehb_release_rate_pa_s": "fastest fall of the pressure",
    "friction_brake_threshold_pressure_pa": "pressure below which the brake gives no torque",
    "friction_brake_heat_capacity_j_k": "heat capacity of a disc",
    "friction_brake_cooling_w_k": "cooling of a disc at rest",
    "pad_a_1_ks": "pad friction: rate at which contact patches grow",
    "pad_b_1_j": "pad friction: wear of the contact patches",
    "pad_epsilon_w": "pad friction: power at which the patches grow as fast as at rest",
    "pad_c_1_s": "pad friction: cooling of the contact",
    "motor_time_constant_s": "time constant of the motors",
    "motor_rate_limit_nm_s": "fastest change of the motor torque",
    "motor_peak_torque_nm": "peak torque of a motor",
    "motor_fade_start_mps": "speed from which regeneration is whole",
    "motor_fade_end_mps": "speed below which there is no regeneration",
    "battery_charge_power_w": "charging power of the battery",
    "sensor_imu_cutoff_hz": "cut-off frequency of the inertial sensor",
}  # fmt: skip
"""By the flat name of the plant's parameter; `brake_gain` stands for the piston area."""

DERIVED_UNITS: Final = {"relaxation_length_m": "m"}
"""Units of short keys that differ from the parameter they set."""

IN_THETA: Final = {
    ("pressure_offset", "offset_pa"): "zero of a pressure sensor",
    ("pressure_gain", "gain"): "scale of a pressure sensor, a relative change",
    ("iwm_gain", "gain"): "torque of a motor beside its demand, a relative change",
    ("iwm_gain", "unseen"): "torque of a motor beside its measured value, a relative change",
    ("pad_mu_gain", "gain"): "pad friction of one wheel beside the others, a relative change",
    ("tyre_radius", "gain"): "rolling radius of one wheel beside the others, a relative change",
    ("clock_drift", "share"): "rate of a clock, a relative change",
    ("steer_lateral", "offset_rad"): "front wheels where the steering wheel says straight ahead",
    ("pressure_location", "lag_s"): "lag of the pads behind the pressure sensors",
    ("imu_bias", "ax_mps2"): "zero of the longitudinal acceleration",
    ("imu_bias", "ay_mps2"): "zero of the lateral acceleration",
    ("imu_bias", "yaw_rate_rad_s"): "zero of the yaw rate",
    ("imu_gain", "gain"): "scale of the acceleration, a relative change",
    ("speed_scale", "gain"): "scale of the speed over ground, a relative change",
    ("road_grade", "grade"): "grade of the road",
    ("headwind", "wind_mps"): "headwind",
}
"""By effect and parameter; others have the title of the effect."""

LATENCIES: Final = {
    "imu": "latency of the inertial sensor behind the wheel speeds",
    "pressure": "latency of the pressures behind the wheel speeds",
    "motor": "latency of the motor torques behind the wheel speeds",
    "demand": "time from a logged demand to its action",
    "pressure_demand": "time from a logged pressure demand to its action",
    "motor_demand": "time from a logged torque demand to its action",
    "steering": "latency of the steering wheel's angle",
    "yaw_rate": "latency of the yaw rate behind the accelerations",
    "ground_speed": "latency of the speed over ground behind the wheel speeds",
}
"""By node."""

OTHERS: Final = {
    "disc_temperature": ("temperature of the discs at the start, beside what is taken", "K"),
    "tooth_lag": ("lag of a toothed wheel's speed, in halves of a tooth", ""),
    "tooth_window": ("time over which a wheel speed is a mean", "s"),
}
"""Words and unit by kind."""
