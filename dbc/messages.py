"""The vehicle bus in SI units: one typed message for each message of brake.dbc.

Field names are the DBC's signal names in lower case with the SI unit appended. ``None`` means signal not
available, or a value out of range on the wire. A test holds these types against the DBC both ways.
"""

from enum import IntEnum, IntFlag
from typing import NamedTuple


class BrakeMode(IntEnum):
    """Operating mode of the brake controller, from full function to the driver's own pressure."""

    INIT = 0
    NORMAL = 1
    DEGRADED = 2
    FRICTION_ONLY = 3
    SAFE_STOP = 4


class Fault(IntFlag):
    """Faults the controller reports in BRAKE_STATUS.ACTIVE_FAULTS."""

    NONE = 0
    PEDAL_1 = 1
    PEDAL_2 = 2
    PEDAL_DISAGREE = 4
    WHEEL_SPEED_FRONT = 8
    WHEEL_SPEED_REAR = 16
    BODY_MOTION = 32
    EHB_PRESSURE_FRONT = 64
    EHB_PRESSURE_REAR = 128
    MOTOR_FRONT = 256
    MOTOR_REAR = 512
    BATTERY = 1024
    STEERING = 2048
    LINK = 4096
    EHB_OWN_MAP = 8192
    MOTOR_TORQUE = 16384
    COMMUNICATION = 32768


class EhbState(IntEnum):
    """What the pressure control of an axle follows."""

    DEMAND = 0
    OWN_PEDAL_MAP = 1
    FAILED = 2


class TroubleStatus(IntEnum):
    """State of a trouble code in the controller's memory."""

    NONE = 0
    STORED = 1
    ACTIVE = 2


class MotorState(IntEnum):
    """State of one in-wheel motor."""

    OK = 0
    DERATED = 1
    FAILED = 2


class BrakePedal(NamedTuple):
    """Brake pedal travel, two redundant channels."""

    pedal_travel_1: float | None
    pedal_travel_2: float | None


class EhbDemandFront(NamedTuple):
    """Pressure demand to the electro-hydraulic brake, front axle."""

    pressure_demand_fl_pa: float | None
    pressure_demand_fr_pa: float | None


class EhbDemandRear(NamedTuple):
    """Pressure demand to the electro-hydraulic brake, rear axle."""

    pressure_demand_rl_pa: float | None
    pressure_demand_rr_pa: float | None


class MotorDemandFront(NamedTuple):
    """Torque demand to the in-wheel motors, front axle."""

    torque_demand_fl_nm: float | None
    torque_demand_fr_nm: float | None


class MotorDemandRear(NamedTuple):
    """Torque demand to the in-wheel motors, rear axle."""

    torque_demand_rl_nm: float | None
    torque_demand_rr_nm: float | None


class WheelSpeedFront(NamedTuple):
    """Wheel speeds, front axle."""

    wheel_speed_fl_rad_s: float | None
    wheel_speed_fr_rad_s: float | None


class WheelSpeedRear(NamedTuple):
    """Wheel speeds, rear axle."""

    wheel_speed_rl_rad_s: float | None
    wheel_speed_rr_rad_s: float | None


class BodyMotion(NamedTuple):
    """Specific force (grade and pitch included) and yaw rate at the centre of gravity, ISO 8855 axes."""

    longitudinal_acceleration_mps2: float | None
    lateral_acceleration_mps2: float | None
    yaw_rate_rad_s: float | None


class EhbPressureFront(NamedTuple):
    """Measured brake pressures and state of the electro-hydraulic brake, front axle."""

    pressure_fl_pa: float | None
    pressure_fr_pa: float | None
    ehb_state_front: EhbState | None


class EhbPressureRear(NamedTuple):
    """Measured brake pressures and state of the electro-hydraulic brake, rear axle."""

    pressure_rl_pa: float | None
    pressure_rr_pa: float | None
    ehb_state_rear: EhbState | None


class MotorStatusFront(NamedTuple):
    """In-wheel motor currents, available braking torque and state, front axle."""

    current_fl_a: float | None
    torque_available_fl_nm: float | None
    fault_fl: MotorState | None
    current_fr_a: float | None
    torque_available_fr_nm: float | None
    fault_fr: MotorState | None


class MotorStatusRear(NamedTuple):
    """In-wheel motor currents, available braking torque and state, rear axle."""

    current_rl_a: float | None
    torque_available_rl_nm: float | None
    fault_rl: MotorState | None
    current_rr_a: float | None
    torque_available_rr_nm: float | None
    fault_rr: MotorState | None


class Steering(NamedTuple):
    """Steering-wheel angle."""

    steering_wheel_angle_rad: float | None


class BatteryStatus(NamedTuple):
    """State of the traction battery."""

    state_of_charge: float | None
    charge_power_limit_w: float | None


class BrakeStatus(NamedTuple):
    """State of the brake controller."""

    mode: BrakeMode | None
    active_faults: int | None  # sum of Fault values
    blending_factor: float | None
    demanded_deceleration_mps2: float | None


class BrakeEstimateFront(NamedTuple):
    """Observer estimates, front axle."""

    wheel_torque_fl_nm: float | None
    pad_friction_fl: float | None
    confidence_fl: int | None
    wheel_torque_fr_nm: float | None
    pad_friction_fr: float | None
    confidence_fr: int | None


class BrakeEstimateRear(NamedTuple):
    """Observer estimates, rear axle."""

    wheel_torque_rl_nm: float | None
    pad_friction_rl: float | None
    confidence_rl: int | None
    wheel_torque_rr_nm: float | None
    pad_friction_rr: float | None
    confidence_rr: int | None


class BrakeTroubleCode(NamedTuple):
    """One of the controller's trouble codes after the other; code 0 where there is none."""

    trouble_code: int | None
    status: TroubleStatus | None
    occurrences: int | None
    stored_codes: int | None
    code_index: int | None


BRAKE_MESSAGES = (
    BrakePedal,
    EhbDemandFront,
    EhbDemandRear,
    MotorDemandFront,
    MotorDemandRear,
    WheelSpeedFront,
    WheelSpeedRear,
    BodyMotion,
    EhbPressureFront,
    EhbPressureRear,
    MotorStatusFront,
    MotorStatusRear,
    Steering,
    BatteryStatus,
    BrakeStatus,
    BrakeEstimateFront,
    BrakeEstimateRear,
    BrakeTroubleCode,
)
