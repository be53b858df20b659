"""Where the strength of each hidden effect lies: rows of one table, a column a wheel (fl, fr, rl, rr)."""

from typing import NamedTuple


class Row(NamedTuple):
    """Rows of the strength table; zero is absent. One column per wheel, or all four alike for the car."""

    road_grade: int
    mass_offset: int
    rotating_inertia: int
    headwind: int
    rolling_resistance: int
    aero_lift: int
    cog_height: int
    pitch_dive: int
    sus_compliance: int
    steer_lateral: int
    road_roughness: int
    split_mu: int
    tyre_radius: int
    tyre_pressure_loss: int
    tyre_relaxation: int
    slip_stiffness: int
    mu_road: int
    aquaplaning: int
    tyre_temperature: int
    load_sensitivity: int
    pad_mu_gain: int
    pad_temp_fade: int
    mu_nv_dynamics: int
    mu_warmup: int
    mu_speed: int
    mu_pressure: int
    pressure_hysteresis: int
    threshold: int
    residual_drag: int
    stuck_corner: int
    caliper_asymmetry: int
    air_in_line: int
    fluid_temp: int
    bedding: int
    glazing: int
    water: int
    dtv_judder: int
    hot_spot: int
    thermal_growth: int
    ehb_dead_time: int
    ehb_bandwidth: int
    ehb_rate_limit: int
    ehb_deadband: int
    accumulator: int
    valve_leak: int
    iwm_gain: int
    iwm_derating: int
    iwm_field: int
    battery_soc: int
    regen_fadeout: int
    motor_tau: int
    pressure_location: int
    current_torque: int
    imu_position: int
    unlisted: int


E = Row(*range(len(Row._fields)))
ROWS = len(Row._fields)

LAW_CUBIC_MU, LAW_STEP_DRAG, LAW_BUMP_PRESSURE, LAW_WAVE_ROLLING, LAW_MOTOR_SPEED, LAW_APPLY_TIME, LAW_STEER_DRAG = (
    range(1, 8)
)
"""Laws that are in no list, by number; ``E.unlisted`` is their strength."""


class State(NamedTuple):
    """Where each state begins in the vector; those of wheels have four places."""

    distance_m: int = 0
    speed_mps: int = 1
    lateral_mps: int = 2
    yaw_rate_rad_s: int = 3
    pitch_rad: int = 4
    pitch_rate_rad_s: int = 5
    load_ax_mps2: int = 6
    load_ay_mps2: int = 7
    imu_ax_mps2: int = 8
    imu_ay_mps2: int = 9
    imu_yaw_rate_rad_s: int = 10
    state_of_charge: int = 11
    omega_rad_s: int = 12
    angle_rad: int = 16
    slip: int = 20
    side_slip: int = 24
    pressure_pa: int = 28
    pressure_rate_pa_s: int = 32
    mu: int = 36
    pad_k: int = 40
    disc_k: int = 44
    motor_nm: int = 48
    winding_k: int = 52
    hub_m: int = 56
    hub_rate_mps: int = 60
    tyre_k: int = 64
    friction_j: int = 68
    line_pa: int = 72
    applied_pa_s: int = 76


S = State()
STATES = 80


class Output(NamedTuple):
    """What one evaluation leaves beside the rates."""

    specific_x_mps2: int = 0
    brake_nm: int = 1
    motor_true_nm: int = 5
    tyre_n: int = 9
    load_n: int = 13
    drag_w: int = 17
    slip_w: int = 18
    rolling_w: int = 19


Y = Output()
OUTPUTS = 20
