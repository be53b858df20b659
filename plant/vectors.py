"""The flat vectors of the model: state, inputs, cut points, switches, parameters, outputs.

Wheels are in the order fl, fr, rl, rr; axes are ISO 8855 (x forward, y left, z up); torques and forces that brake are
negative. Compiled code reads ``x[X.speed_mps]``; Python reads ``x[STATE.slice("speed_mps")]``.
"""

from plant.compiled import EFFECTS
from plant.extra_states import EXTRA_STATES
from plant.injection_points import FIELDS
from plant.layout import Layout, dataclass_sizes
from plant.parameters.plant import PlantParameters

DELAY_SLOTS = 128  # steps of demand remembered for the dead time

CONTINUOUS = {
    "x_m": 1,
    "y_m": 1,
    "yaw_rad": 1,
    "speed_mps": 1,
    "lateral_speed_mps": 1,
    "yaw_rate_rad_s": 1,
    "heave_m": 1,
    "pitch_rad": 1,  # positive nose down
    "roll_rad": 1,  # positive left side up
    "heave_rate_mps": 1,
    "pitch_rate_rad_s": 1,
    "roll_rate_rad_s": 1,
    "wheel_speed_rad_s": 4,
    "wheel_angle_rad": 4,
    "slip": 4,  # longitudinal, relaxed
    "side_slip": 4,  # tangent of the slip angle, relaxed
    "windup_rad": 4,  # of the applied friction brake against the hub
    "pressure_pa": 4,
    "pressure_rate_pa_s": 4,
    "motor_torque_nm": 4,
    "winding_temperature_k": 4,
    "pad_friction": 4,
    "pad_temperature_k": 4,
    "disc_temperature_k": 4,
    "state_of_charge": 1,
    "recuperated_j": 1,
    "friction_heat_j": 1,
    "distance_m": 1,
    "imu_longitudinal_mps2": 1,
    "imu_lateral_mps2": 1,
    "imu_yaw_rate_rad_s": 1,
}
MEMORY = {
    "time_s": 1,
    "tooth_time_s": 4,  # when the last tooth passed
    "tooth_count": 4,  # teeth passed so far, either way
    "delay_index": 1,
    "delayed_demand_pa": 4 * DELAY_SLOTS,
}
INPUTS = {
    "pressure_demand_pa": 4,
    "motor_demand_nm": 4,
    "steering_wheel_rad": 1,
    "pressure_pa": 4,  # measured values, used where the cut says so
    "motor_torque_nm": 4,
    "wheel_torque_nm": 4,
    "longitudinal_force_n": 4,
    "wheel_speed_rad_s": 4,
    "motor_torque_bend_nm": 4,  # in the middle of a row, beyond the straight line to the next
}
CUTS = {"pressure": 4, "motor_torque": 4, "wheel_torque": 4, "force": 4, "motor_speed": 4}
CUT_PARTS = len(CUTS)
SWITCHES = {"motor_alive": 4, "battery_accepts": 1, "battery_announces": 1, "pad_friction": 4}
BASE_RATES = Layout("BaseRates", CONTINUOUS)
RATES = Layout("Rates", CONTINUOUS | EXTRA_STATES)
OUTPUTS = {
    "rate": RATES.size,  # of the continuous states, in their order
    "decay_1_s": RATES.size,  # own decay rate of each state, for the semi-implicit step
    "acceleration_mps2": 1,
    "specific_force_x_mps2": 1,
    "specific_force_y_mps2": 1,
    "wheel_torque_nm": 4,
    "friction_torque_nm": 4,
    "motor_target_nm": 4,
    "motor_torque_nm": 4,
    "motor_current_nm": 4,  # torque that the current stands for
    "pressure_pa": 4,
    "longitudinal_force_n": 4,  # in the wheel's axes
    "lateral_force_n": 4,
    "wheel_load_n": 4,
    "rolling_torque_nm": 4,
    "along_mps": 4,  # velocity of the contact in the wheel's axes
    "across_mps": 4,
    "slip_speed_mps": 4,
    "slip_gain_1_m": 4,  # 1 / relaxation length
    "slip_stiffness_n": 4,  # by how much a little more slip changes the force, and the lateral one below
    "side_stiffness_n": 4,
    "hub_swing_1_s": 4,  # natural frequency of a soft hub, and what a force on it makes of its acceleration
    "hub_push_1_kg": 4,
    "standing_damping_1_s": 4,  # how fast a wheel near standstill loses speed against the road
    "motor_available_nm": 4,
    "motor_derating": 4,
    "road_friction": 4,
    "charge_power_limit_w": 1,
    "battery_power_w": 1,
    "sensed_wheel_speed_rad_s": 4,  # before toothed wheels, noise and the effects of `plant.effects.sensing`
    "sensed_pressure_pa": 4,
    "sensed_motor_nm": 4,
    "drag_n": 1,
    "grade": 1,
}

STATE = Layout("State", CONTINUOUS | EXTRA_STATES | MEMORY)
INPUT = Layout("Input", INPUTS)
CUT = Layout("Cut", CUTS)
SWITCH = Layout("Switch", SWITCHES)
OUTPUT = Layout("Output", OUTPUTS | ({"injection_points": sum(FIELDS.values())} if EFFECTS else {}))
PARAMETER = Layout("Parameter", dataclass_sizes(PlantParameters))

X, U, C, S, Y, P = STATE.at, INPUT.at, CUT.at, SWITCH.at, OUTPUT.at, PARAMETER.at
