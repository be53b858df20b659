"""What the plant tells: the frames of the car's nodes, and the truth."""

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
from plant.vectors import RATES, X, Y

NO_COUNTER = 15  # none yet
COUNT_LIMIT = 4095


def _motor_state(alive: float, derating: float) -> MotorState:
    if alive == 0.0:
        return MotorState.FAILED
    return MotorState.OK if derating >= 1.0 else MotorState.DERATED


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
    fl, fr, rl, rr = ((current[i], able[i], _motor_state(alive[i], derating[i])) for i in range(4))
    return [MotorStatusFront(*fl, *fr), MotorStatusRear(*rl, *rr)]


def battery_message(x: Vector, y: Vector) -> BatteryStatus:
    """Frame of BATTERY."""
    return BatteryStatus(float(x[X.state_of_charge]), float(y[Y.charge_power_limit_w]))


def truth_messages(x: Vector, y: Vector, state: ManoeuvreState) -> list[Message]:
    """What no car can measure, for the bench."""
    s, o = x[: RATES.size].tolist(), y.tolist()

    def four(values: list[float], first: int) -> list[float]:
        return values[first : first + 4]

    return [
        TruthMotion(s[X.speed_mps], o[Y.acceleration_mps2], s[X.distance_m], state),
        TruthWheelTorque(*four(o, Y.wheel_torque_nm)),
        TruthFrictionTorque(*four(o, Y.friction_torque_nm)),
        TruthPadFriction(*four(s, X.pad_friction)),
        TruthDiscTemperature(*four(s, X.disc_temperature_k)),
        TruthLongitudinalForce(*four(o, Y.longitudinal_force_n)),
        TruthWheelLoad(*four(o, Y.wheel_load_n)),
        TruthEnergy(s[X.recuperated_j], s[X.friction_heat_j]),
    ]


def reception_message(receiver: Receiver) -> PlantReception:
    """Which demands this tick was computed from."""
    front_p, rear_p, front_m, rear_m = (receiver.counter(kind) for kind in DEMANDS)
    return PlantReception(
        NO_COUNTER if front_p is None else front_p,
        NO_COUNTER if rear_p is None else rear_p,
        NO_COUNTER if front_m is None else front_m,
        NO_COUNTER if rear_m is None else rear_m,
        min(receiver.lost, COUNT_LIMIT),
        min(receiver.corrupt, COUNT_LIMIT),
    )
