"""The plant as a node: demands in, sensor and truth frames out. No I/O."""

from collections.abc import Sequence

import numpy as np

from dbc.bench_messages import (
    FaultCommand,
    ManoeuvreState,
    PhysicalFault,
    PlantReception,
    StimulusDriver,
    StimulusRoad,
    TruthDiscTemperature,
    TruthEnergy,
    TruthFrictionTorque,
    TruthLongitudinalForce,
    TruthMotion,
    TruthPadFriction,
    TruthWheelLoad,
    TruthWheelTorque,
)
from dbc.contract import Message, spec_of
from dbc.exchange import Receiver, Transmitter
from dbc.frame import Frame, Received
from dbc.messages import (
    BatteryStatus,
    BodyMotion,
    BrakePedal,
    EhbPressureFront,
    EhbPressureRear,
    MotorState,
    MotorStatusFront,
    MotorStatusRear,
    Steering,
    WheelSpeedFront,
    WheelSpeedRear,
)
from plant import driver
from plant.demands import DEMANDS, EHB_DEMANDS, PressureDemand, motor_demand_nm, ready
from plant.manoeuvre import Manoeuvre, value_at
from plant.model import STEP_S, advance, healthy, initial_state, pack
from plant.parameters.plant import PlantParameters
from plant.road import road_table
from plant.sensors import Sensors
from plant.vectors import CUT, INPUT, OUTPUT, STATE, S, U, X, Y

SENDERS = frozenset({"EHB", "IWM", "BATTERY", "SENSORS", "DRIVER"})
STIMULUS_TIMEOUT_NS = 100_000_000
STANDING_MPS = 0.02
NO_COUNTER = 15
CARRIED_FROM_START = (  # what a manoeuvre starts with, however long the start was awaited
    "x_m", "y_m", "yaw_rad", "winding_temperature_k", "pad_friction", "pad_temperature_k", "disc_temperature_k",
    "state_of_charge", "recuperated_j", "friction_heat_j", "distance_m",
)  # fmt: skip


class PlantNode:
    """The vehicle behind the buses.

    Parameters
    ----------
    parameters, manoeuvre : what drives, and how.
    seed : of all noise.
    period_ns : of `step`; the model takes steps of 1 ms inside.
    play : nodes of brake.dbc whose frames it sends.

    Attributes
    ----------
    manoeuvre_start_ns : tick at which the manoeuvre's clock started, None while the initial speed is held.
    state : where the manoeuvre is.
    """

    def __init__(
        self,
        parameters: PlantParameters,
        manoeuvre: Manoeuvre,
        seed: int,
        period_ns: int = 10_000_000,
        play: frozenset[str] = SENDERS,
    ) -> None:
        self._parameters = parameters
        self._manoeuvre = manoeuvre
        self._period_ns = period_ns
        self._play = play
        self._p = pack(parameters)
        self._x = initial_state(
            parameters,
            manoeuvre.initial_speed_mps,
            manoeuvre.initial_disc_temperature_k,
            manoeuvre.initial_state_of_charge,
            manoeuvre.initial_pad_friction,
        )
        self._start = self._x.copy()
        self._u, self._y, self._cut, self._switch = INPUT.zeros(), OUTPUT.zeros(), CUT.zeros(), healthy()
        self._road = road_table(manoeuvre.road)
        self._own_road = self._road
        self._sensors = Sensors(parameters.sensor, parameters.motor.torque_constant_nm_a, seed)
        self._sensors.start(self._x, manoeuvre.initial_speed_mps / parameters.wheel.rolling_radius_m)
        self._receiver = Receiver((*DEMANDS, StimulusDriver, StimulusRoad))
        self._faults = Receiver((FaultCommand,))
        self._transmitter = Transmitter()
        self._pressure_demands = [PressureDemand(kind, parameters.ehb) for kind in EHB_DEMANDS]
        self._pedal = 0.0
        self._steering_rad = 0.0
        self._last_ns: int | None = None
        self._standing_ns = 0
        self.manoeuvre_start_ns: int | None = None
        self.state = ManoeuvreState.HOLDING
        self._advance(0)

    def step(self, now_ns: int, inbox: Sequence[Received]) -> list[Frame]:
        """Bring the car to ``now_ns`` with the demands of the last tick, then take the inbox and measure."""
        elapsed_ns = 0 if self._last_ns is None else now_ns - self._last_ns
        self._last_ns = now_ns
        self._advance(elapsed_ns)
        self._receiver.accept(now_ns, inbox)
        self._take_faults(now_ns, inbox)
        self._follow_manoeuvre(now_ns, elapsed_ns)
        self._drive(now_ns)
        return self._transmitter.frames(now_ns, [*self._measured(now_ns), *self._truth()])

    def _advance(self, elapsed_ns: int) -> None:
        steps = round(elapsed_ns * 1e-9 / STEP_S)
        advance(self._x, self._u, self._cut, self._switch, self._p, self._road, self._y, steps)

    def _take_faults(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """Fault commands one by one: two may come in one tick."""
        key = spec_of(FaultCommand).can_id, spec_of(FaultCommand).bus
        for item in inbox:
            if not isinstance(item, Frame) or (item.can_id, item.bus) != key:
                continue
            self._faults.accept(now_ns, [item])
            command = self._faults.latest(FaultCommand)
            if command is None or not self._faults.receptions[FaultCommand].fresh:
                continue
            well = 0.0 if command.active else 1.0
            if command.fault is PhysicalFault.MOTOR_DEAD:
                for i in range(4):
                    if (command.wheels or 0) >> i & 1:
                        self._switch[S.motor_alive + i] = well
            elif command.fault is PhysicalFault.BATTERY_REFUSES_CHARGE:
                self._switch[S.battery_accepts] = well

    def _follow_manoeuvre(self, now_ns: int, elapsed_ns: int) -> None:
        manoeuvre = self._manoeuvre
        if self.manoeuvre_start_ns is None:
            if manoeuvre.wait_for_demands and not manoeuvre.direct.complete and not ready(self._receiver):
                return
            for part in CARRIED_FROM_START:
                where = STATE.slice(part)
                self._x[where] = self._start[where]
            self.manoeuvre_start_ns = now_ns
            self.state = ManoeuvreState.RUNNING
        moving = abs(self._x[X.speed_mps]) > STANDING_MPS
        self._standing_ns = 0 if moving else self._standing_ns + elapsed_ns
        limit_s = manoeuvre.end_after_standstill_s
        stood = limit_s is not None and self._standing_ns >= limit_s * 1e9
        if stood or now_ns - self.manoeuvre_start_ns >= manoeuvre.duration_s * 1e9:
            self.state = ManoeuvreState.FINISHED

    def _stimulus(self, kind: type[Message], now_ns: int) -> Message | None:
        age = self._receiver.age_ns(kind, now_ns)
        return None if age is None or age > STIMULUS_TIMEOUT_NS else self._receiver.latest(kind)

    def _drive(self, now_ns: int) -> None:
        """Driver, road and demands from this tick on."""
        manoeuvre, direct = self._manoeuvre, self._manoeuvre.direct
        start = self.manoeuvre_start_ns
        time_s = 0.0 if start is None else (now_ns - start) * 1e-9
        self._pedal = 0.0 if start is None else driver.pedal_travel(manoeuvre, time_s)
        self._steering_rad = 0.0 if start is None else value_at(manoeuvre.steering_wheel_rad, time_s)
        target = manoeuvre.initial_speed_mps if start is None else driver.target_speed(manoeuvre, time_s)
        live = self._stimulus(StimulusDriver, now_ns)
        if isinstance(live, StimulusDriver):
            self._pedal = self._pedal if live.pedal_travel is None else live.pedal_travel
            target = target if live.target_speed_mps is None else live.target_speed_mps
            angle = live.steering_wheel_angle_rad
            self._steering_rad = self._steering_rad if angle is None else angle
        self._override_road(now_ns)

        u = self._u
        u[U.steering_wheel_rad] = self._steering_rad
        pressure = [v for d in self._pressure_demands for v in d.update(self._receiver, now_ns, self._pedal)]
        motor = motor_demand_nm(self._receiver, now_ns)
        hold_nm = self._hold_torque_nm(target)
        for i in range(4):
            trace_p, trace_m = direct.pressure_pa[i], direct.motor_nm[i]
            running = start is not None
            u[U.pressure_demand_pa + i] = value_at(trace_p, time_s) if trace_p and running else pressure[i]
            u[U.motor_demand_nm + i] = hold_nm + (value_at(trace_m, time_s) if trace_m and running else motor[i])

    def _hold_torque_nm(self, target_mps: float | None) -> float:
        if target_mps is None or self._pedal > driver.PEDAL_FREE:
            return 0.0
        radius, y = self._parameters.wheel.rolling_radius_m, self._y
        resistance = float(y[Y.drag_n] + y[OUTPUT.slice("rolling_torque_nm")].sum() / radius)
        mass = self._parameters.vehicle.mass_kg
        return driver.drive_force(target_mps, self._x[X.speed_mps], mass, resistance, y[Y.grade]) * radius / 4.0

    def _override_road(self, now_ns: int) -> None:
        live = self._stimulus(StimulusRoad, now_ns)
        self._road = self._own_road
        if isinstance(live, StimulusRoad) and any(value is not None for value in live):
            self._road = self._own_road.copy()
            for column, value in enumerate(live, start=1):
                if value is not None:
                    self._road[:, column] = value

    def _measured(self, now_ns: int) -> list[Message]:
        """What the played nodes send."""
        x, y, sensors, play = self._x, self._y, self._sensors, self._play
        out: list[Message] = []
        if "DRIVER" in play:
            out += [
                BrakePedal(*sensors.pedal(self._pedal)),
                Steering(sensors.steering_wheel_rad(self._steering_rad)),
            ]
        if "SENSORS" in play:
            speed = sensors.wheel_speed_rad_s(x)
            out += [
                WheelSpeedFront(speed[0], speed[1]),
                WheelSpeedRear(speed[2], speed[3]),
                BodyMotion(*sensors.body_motion(x)),
            ]
        if "EHB" in play:
            pressure = sensors.pressure_pa(y)
            front, rear = self._pressure_demands
            out += [
                EhbPressureFront(pressure[0], pressure[1], front.state),
                EhbPressureRear(pressure[2], pressure[3], rear.state),
            ]
        if "IWM" in play:
            current = sensors.current_a(y)
            able = [float(v) for v in y[OUTPUT.slice("motor_available_nm")]]
            state = [self._motor_state(i) for i in range(4)]
            out += [
                MotorStatusFront(current[0], able[0], state[0], current[1], able[1], state[1]),
                MotorStatusRear(current[2], able[2], state[2], current[3], able[3], state[3]),
            ]
        if "BATTERY" in play and self._transmitter.due(BatteryStatus, now_ns):
            out.append(BatteryStatus(float(x[X.state_of_charge]), float(y[Y.charge_power_limit_w])))
        return out

    def _motor_state(self, i: int) -> MotorState:
        if self._switch[S.motor_alive + i] == 0.0:
            return MotorState.FAILED
        return MotorState.OK if self._y[Y.motor_derating + i] >= 1.0 else MotorState.DERATED

    def _truth(self) -> list[Message]:
        x, y = self._x, self._y

        def four(vector: np.ndarray[tuple[int], np.dtype[np.float64]], where: slice) -> list[float]:
            return [float(v) for v in vector[where]]

        front_p, rear_p, front_m, rear_m = (self._receiver.counter(kind) for kind in DEMANDS)
        return [
            TruthMotion(float(x[X.speed_mps]), float(y[Y.acceleration_mps2]), float(x[X.distance_m]), self.state),
            TruthWheelTorque(*four(y, OUTPUT.slice("wheel_torque_nm"))),
            TruthFrictionTorque(*four(y, OUTPUT.slice("friction_torque_nm"))),
            TruthPadFriction(*four(x, STATE.slice("pad_friction"))),
            TruthDiscTemperature(*four(x, STATE.slice("disc_temperature_k"))),
            TruthLongitudinalForce(*four(y, OUTPUT.slice("longitudinal_force_n"))),
            TruthWheelLoad(*four(y, OUTPUT.slice("wheel_load_n"))),
            TruthEnergy(float(x[X.recuperated_j]), float(x[X.friction_heat_j])),
            PlantReception(
                NO_COUNTER if front_p is None else front_p,
                NO_COUNTER if rear_p is None else rear_p,
                NO_COUNTER if front_m is None else front_m,
                NO_COUNTER if rear_m is None else rear_m,
                min(self._receiver.lost, 4095),
                min(self._receiver.corrupt, 4095),
            ),
        ]
