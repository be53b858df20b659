"""The bench bus in SI units: one typed message for each message of bench.dbc (conventions as in messages.py)."""

from enum import IntEnum
from typing import NamedTuple


class ManoeuvreState(IntEnum):
    """Where the plant is in its scenario."""

    HOLDING = 0
    RUNNING = 1
    FINISHED = 2


class PhysicalFault(IntEnum):
    """Physical faults of the vehicle that FAULT_COMMAND switches."""

    NONE = 0
    MOTOR_DEAD = 1
    BATTERY_REFUSES_CHARGE = 2
    MOTOR_DEAF = 3
    MOTOR_WEAK = 4
    MOTOR_STUCK_ON = 5
    EHB_CIRCUIT_FAILED = 6
    ACCUMULATOR_EMPTY = 7
    PAD_FRICTION = 8


PAD_FACTOR = (77, 4)
"""Fault and index in FAULT_PARAMETER of what PAD_FRICTION makes of the pads' friction: a factor, left out 0.5."""


class FaultAction(IntEnum):
    """What FAULT_SELECT does with the fault that it names."""

    STOP = 0
    START = 1


class StimulusDriver(NamedTuple):
    """Live driver: each signal overrides the scenario's driver while it is available (SNA: the scenario drives)."""

    pedal_travel: float | None
    target_speed_mps: float | None
    steering_wheel_angle_rad: float | None


class StimulusRoad(NamedTuple):
    """Live road: each signal overrides the scenario's road while it is available."""

    friction_left: float | None
    friction_right: float | None
    grade: float | None


class StimulusEcu(NamedTuple):
    """Live setting of the controller."""

    blending_factor: float | None


class FaultCommand(NamedTuple):
    """Switches one physical fault of the vehicle on or off; sent on change."""

    fault: PhysicalFault | None
    active: int | None
    wheels: int | None


class FaultParameter(NamedTuple):
    """One parameter of the fault that the next command for it starts: mantissa times 10 to the exponent."""

    fault: int | None
    parameter: int | None
    mantissa: int | None
    exponent: int | None


class FaultSelect(NamedTuple):
    """Starts or stops one fault of the catalogue in the process that plays its target; sent on change."""

    fault: int | None
    action: FaultAction | None
    target: int | None
    signal: int | None
    seed: int | None


class TruthMotion(NamedTuple):
    """True motion of the vehicle."""

    speed_mps: float | None
    acceleration_mps2: float | None
    distance_m: float | None
    manoeuvre: ManoeuvreState | None


class TruthWheelTorque(NamedTuple):
    """True total torque on each wheel (friction brake and motor); negative brakes."""

    wheel_torque_fl_nm: float | None
    wheel_torque_fr_nm: float | None
    wheel_torque_rl_nm: float | None
    wheel_torque_rr_nm: float | None


class TruthFrictionTorque(NamedTuple):
    """True friction-brake torque on each wheel; negative opposes forward rotation."""

    friction_torque_fl_nm: float | None
    friction_torque_fr_nm: float | None
    friction_torque_rl_nm: float | None
    friction_torque_rr_nm: float | None


class TruthPadFriction(NamedTuple):
    """True pad friction coefficients."""

    pad_friction_fl: float | None
    pad_friction_fr: float | None
    pad_friction_rl: float | None
    pad_friction_rr: float | None


class TruthDiscTemperature(NamedTuple):
    """True disc temperatures."""

    disc_temperature_fl_k: float | None
    disc_temperature_fr_k: float | None
    disc_temperature_rl_k: float | None
    disc_temperature_rr_k: float | None


class TruthLongitudinalForce(NamedTuple):
    """True longitudinal tyre forces; negative brakes."""

    longitudinal_force_fl_n: float | None
    longitudinal_force_fr_n: float | None
    longitudinal_force_rl_n: float | None
    longitudinal_force_rr_n: float | None


class TruthWheelLoad(NamedTuple):
    """True vertical tyre loads."""

    wheel_load_fl_n: float | None
    wheel_load_fr_n: float | None
    wheel_load_rl_n: float | None
    wheel_load_rr_n: float | None


class TruthEnergy(NamedTuple):
    """Energy since the manoeuvre started."""

    recuperated_j: float | None
    friction_heat_j: float | None


class EcuTiming(NamedTuple):
    """Timing of the ECU process, one frame a tick."""

    tick: int | None
    lateness_s: float | None
    overruns: int | None


class PlantTiming(NamedTuple):
    """Timing of the PLANT process, one frame a tick."""

    tick: int | None
    lateness_s: float | None
    overruns: int | None


class EcuReception(NamedTuple):
    """Last alive counters the ECU had consumed when it computed a tick, for replay tick for tick."""

    counter_brake_pedal: int | None
    counter_wheel_speed_front: int | None
    counter_wheel_speed_rear: int | None
    counter_body_motion: int | None
    counter_ehb_pressure_front: int | None
    counter_ehb_pressure_rear: int | None
    counter_motor_status_front: int | None
    counter_motor_status_rear: int | None
    counter_steering: int | None
    counter_battery_status: int | None
    frames_lost: int | None
    frames_corrupt: int | None


class PlantReception(NamedTuple):
    """Last alive counters the PLANT had consumed when it computed a tick, for replay tick for tick."""

    counter_ehb_demand_front: int | None
    counter_ehb_demand_rear: int | None
    counter_motor_demand_front: int | None
    counter_motor_demand_rear: int | None
    frames_lost: int | None
    frames_corrupt: int | None


BENCH_MESSAGES = (
    StimulusDriver,
    StimulusRoad,
    StimulusEcu,
    FaultCommand,
    FaultParameter,
    FaultSelect,
    TruthMotion,
    TruthWheelTorque,
    TruthFrictionTorque,
    TruthPadFriction,
    TruthDiscTemperature,
    TruthLongitudinalForce,
    TruthWheelLoad,
    TruthEnergy,
    EcuTiming,
    PlantTiming,
    EcuReception,
    PlantReception,
)
