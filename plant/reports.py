"""What the plant tells: the frames of the car's nodes, and the truth."""

import numpy as np

from dbc.bench_messages import (
    ManoeuvreState,
    PlantReception,
    TruthDiscTemperature,
    TruthEnergy,
    TruthFrictionTorque,
    TruthLongitudinalForce,
    TruthMotion,
    TruthPadFriction,
    TruthWheelLoad,
    TruthWheelTorque,
)
from dbc.contract import Message
from dbc.exchange import Receiver
from dbc.messages import (
    BatteryStatus,
    BodyMotion,
    BrakePedal,
    EhbPressureFront,
    EhbPressureRear,
    EhbState,
    MotorState,
    MotorStatusFront,
    MotorStatusRear,
    Steering,
    WheelSpeedFront,
    WheelSpeedRear,
)
from plant.demands import DEMANDS
from plant.layout import Vector
from plant.sensors import Sensors
from plant.vectors import OUTPUT, STATE, X, Y

NO_COUNTER = 15  # none yet
COUNT_LIMIT = 4095
_FAILED, _OK, _DERATED = MotorState.FAILED, MotorState.OK, MotorState.DERATED
_TRUE_STATES = np.r_[
    STATE.slice("speed_mps"), STATE.slice("distance_m"), STATE.slice("recuperated_j"), STATE.slice("friction_heat_j"),
    STATE.slice("pad_friction"), STATE.slice("disc_temperature_k"),
]  # fmt: skip
_TRUE_OUTPUTS = np.r_[
    OUTPUT.slice("acceleration_mps2"), OUTPUT.slice("wheel_torque_nm"), OUTPUT.slice("friction_torque_nm"),
    OUTPUT.slice("longitudinal_force_n"), OUTPUT.slice("wheel_load_n"),
]  # fmt: skip


def _motor_state(alive: float, derating: float) -> MotorState:
    if alive == 0.0:
        return _FAILED
    return _OK if derating >= 1.0 else _DERATED


def driver_messages(sensors: Sensors, travel: float, steering_wheel_rad: float) -> list[Message]:
    """Frames of DRIVER."""
    return [BrakePedal(*sensors.pedal(travel)), Steering(sensors.steering_wheel_rad(steering_wheel_rad))]


def sensor_messages(sensors: Sensors, x: Vector, y: Vector) -> list[Message]:
    """Frames of SENSORS."""
    fl, fr, rl, rr = sensors.wheel_speed_rad_s(x, y)
    return [WheelSpeedFront(fl, fr), WheelSpeedRear(rl, rr), BodyMotion(*sensors.body_motion(x))]


def ehb_messages(sensors: Sensors, y: Vector, front: EhbState, rear: EhbState) -> list[Message]:
    """Frames of EHB."""
    fl, fr, rl, rr = sensors.pressure_pa(y)
    return [EhbPressureFront(fl, fr, front), EhbPressureRear(rl, rr, rear)]


def motor_messages(sensors: Sensors, y: Vector, alive: list[float]) -> list[Message]:
    """Frames of IWM."""
    current = sensors.current_a(y)
    able = y[Y.motor_available_nm : Y.motor_available_nm + 4].tolist()
    derating = y[Y.motor_derating : Y.motor_derating + 4].tolist()
    state = list(map(_motor_state, alive, derating))
    return [
        MotorStatusFront(current[0], able[0], state[0], current[1], able[1], state[1]),
        MotorStatusRear(current[2], able[2], state[2], current[3], able[3], state[3]),
    ]


def battery_message(x: Vector, y: Vector) -> BatteryStatus:
    """Frame of BATTERY."""
    return BatteryStatus(float(x[X.state_of_charge]), float(y[Y.charge_power_limit_w]))


def truth_messages(x: Vector, y: Vector, state: ManoeuvreState) -> list[Message]:
    """What no car can measure, for the bench."""
    states: list[float] = x[_TRUE_STATES].tolist()
    outputs: list[float] = y[_TRUE_OUTPUTS].tolist()
    speed, distance, recuperated, heat, *wheels = states
    acceleration, *forces = outputs
    return [
        TruthMotion(speed, acceleration, distance, state),
        TruthWheelTorque(*forces[:4]),
        TruthFrictionTorque(*forces[4:8]),
        TruthPadFriction(*wheels[:4]),
        TruthDiscTemperature(*wheels[4:]),
        TruthLongitudinalForce(*forces[8:12]),
        TruthWheelLoad(*forces[12:]),
        TruthEnergy(recuperated, heat),
    ]


def reception_message(receiver: Receiver) -> PlantReception:
    """Which demands this tick was computed from."""
    front_p, rear_p, front_m, rear_m = [NO_COUNTER if (n := receiver.counter(kind)) is None else n for kind in DEMANDS]
    lost, corrupt = min(receiver.lost, COUNT_LIMIT), min(receiver.corrupt, COUNT_LIMIT)
    return PlantReception(front_p, rear_p, front_m, rear_m, lost, corrupt)
