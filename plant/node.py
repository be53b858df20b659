"""The plant as a node: demands in, sensor and truth frames out. No I/O."""

from collections.abc import Sequence
from dataclasses import replace

from dbc.bench_messages import FaultCommand, FaultParameter, ManoeuvreState, StimulusDriver, StimulusRoad
from dbc.commands import CommandReader
from dbc.compiled import writer
from dbc.contract import Message
from dbc.exchange import Receiver
from dbc.frame import Frame, Received
from dbc.reception import Reception
from plant import driver
from plant.demands import DEMANDS, Demands
from plant.external_nodes import ExternalNodes
from plant.faults import PhysicalFaults
from plant.injection.bank import NO_TERMS
from plant.injection.plugin import NO_PLUGINS
from plant.injection.sensing_chain import Chain
from plant.injection.theta import THETA, Theta
from plant.layout import Vector
from plant.manoeuvre import DirectDemands, Manoeuvre, value_at
from plant.model import NEUTRAL, STEP_S, Scene, advance, healthy, initial_state, pack
from plant.parameters.plant import PlantParameters
from plant.reports import Reports
from plant.road import road_table
from plant.sensors import Sensors
from plant.vectors import INPUT, OUTPUT, STATE, U, X, Y

SENDERS = frozenset({"EHB", "IWM", "BATTERY", "SENSORS", "DRIVER"})
STIMULUS_TIMEOUT_NS = 100_000_000
STANDING_MPS = 0.02
STEP_NS = round(STEP_S * 1e9)
_DRIVEN = U.pressure_demand_pa, U.steering_wheel_rad + 1  # the first inputs: pressures, torques, steering
_SPEED, _FINISHED = X.speed_mps, ManoeuvreState.FINISHED  # asked for every tick
RESET_AT_START = (  # what a manoeuvre starts with, however long its start was awaited
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
    play : nodes of brake.dbc that it is; the frames of the others enter as measured values.
    theta : effects; their times are of the manoeuvre's clock.  layout : where they lie in it.
    terms, plugins : basis terms and effects from outside.

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
        *,
        theta: Vector = NEUTRAL,
        layout: Theta = THETA,
        terms: Vector = NO_TERMS,
        plugins: Vector = NO_PLUGINS,
    ) -> None:
        if not play <= SENDERS:
            raise ValueError(f"play: {sorted(play - SENDERS)} are no nodes of the vehicle; known: {sorted(SENDERS)}")
        if period_ns <= 0 or period_ns % STEP_NS:
            raise ValueError(f"period_ns: expected a positive multiple of {STEP_NS} ns, got {period_ns}")
        self._parameters = parameters
        self._manoeuvre = manoeuvre
        self._p = pack(parameters)
        self._x = initial_state(
            parameters,
            manoeuvre.initial_speed_mps,
            manoeuvre.initial_disc_temperature_k,
            manoeuvre.initial_state_of_charge,
            manoeuvre.initial_pad_friction,
        )
        self._start = self._x.copy()
        self._external_nodes = ExternalNodes(play, parameters.motor.torque_constant_nm_a)
        self._u, self._y, self._switch = INPUT.zeros(), OUTPUT.zeros(), healthy()
        self._write_driven = writer(self._u, *_DRIVEN)
        self._own_road = road_table(manoeuvre.road)
        self._scene = Scene(self._external_nodes.cut(), self._switch, self._own_road, theta, terms, plugins)
        first_speed = manoeuvre.initial_speed_mps / parameters.wheel.rolling_radius_m
        self._sensors = Sensors(self._p, seed, self._x, first_speed)
        self._reports = Reports(play, self._p)
        self.manoeuvre_start_ns: int | None = None
        self._last_ns: int | None = None
        self._layout, self._of_manoeuvre = layout, theta
        self.switch_effects(theta)
        self._receiver = Receiver((*DEMANDS, StimulusDriver, StimulusRoad))
        self._live_driver, self._live_road = (self._receiver.receptions[k] for k in (StimulusDriver, StimulusRoad))
        self._broken = PhysicalFaults(self._switch, parameters.battery.notice_s)
        self._commands = CommandReader((FaultParameter, FaultCommand))
        self._demands = Demands(self._receiver, parameters.ehb)
        self._direct = manoeuvre.direct != DirectDemands()
        self._pedal = 0.0
        self._steering_rad = 0.0
        self._standing_ns = 0
        self.state = ManoeuvreState.HOLDING
        self._advance(0)

    def step(self, now_ns: int, inbox: Sequence[Received]) -> list[Frame]:
        """Bring the car to ``now_ns`` with the demands of the last tick, then take the inbox and measure."""
        elapsed_ns = 0 if self._last_ns is None else now_ns - self._last_ns
        self._last_ns = now_ns
        self._advance(elapsed_ns)
        self._receiver.accept(now_ns, inbox)
        self._external_nodes.accept(now_ns, inbox)
        self._take_faults(now_ns, inbox)
        self._broken.keep_time(now_ns)
        pressure_pa, motor_nm = self._demands.update(now_ns, self._pedal)
        self._follow_manoeuvre(now_ns, elapsed_ns)
        self._drive(now_ns, pressure_pa, motor_nm)
        sensed = self._sensors.sample(self._x, self._y, self._pedal, self._steering_rad)
        brakes = self._broken.told([demand.state for demand in self._demands.pressure])
        return self._reports.frames(now_ns, self._x, self._y, self._switch, sensed, brakes, self.state, self._receiver)

    @property
    def receiver(self) -> Receiver:
        """What it has taken of what was sent to it, for who watches."""
        return self._receiver

    @property
    def model_state(self) -> Vector:
        """State of the model at this tick (``STATE``), a copy."""
        return self._x.copy()

    @property
    def pedal(self) -> float:
        """Brake pedal travel from this tick on."""
        return self._pedal

    @property
    def inputs(self) -> Vector:
        """What the model is driven with from this tick on (``INPUT``), a copy."""
        return self._u.copy()

    def switch_effects(self, theta: Vector) -> None:
        """Change the effects' numbers from this tick on; their times are of the manoeuvre's clock."""
        self._of_manoeuvre = theta
        if self.manoeuvre_start_ns is None:  # what has a time waits for the clock
            shifted = self._layout.shifted(theta, 1e9) if self._layout.timed(theta) else theta
        else:
            begun_s = ((self._last_ns or 0) - self.manoeuvre_start_ns) * 1e-9
            shifted = self._layout.shifted(theta, float(self._x[X.time_s]) - begun_s)
        self._scene = replace(self._scene, theta=shifted)
        self._sensors.distort(Chain(shifted, self._layout))

    def _advance(self, elapsed_ns: int) -> None:
        steps = elapsed_ns // STEP_NS
        advance(self._x, self._u, self._p, self._y, steps, self._scene)

    def _take_faults(self, now_ns: int, inbox: Sequence[Received]) -> None:
        for command in self._commands.read(inbox):
            if isinstance(command, FaultParameter):
                self._broken.note(command)
            elif isinstance(command, FaultCommand):
                self._broken.take(now_ns, command, self._x)

    def _follow_manoeuvre(self, now_ns: int, elapsed_ns: int) -> None:
        manoeuvre = self._manoeuvre
        if self.manoeuvre_start_ns is None:
            if manoeuvre.wait_for_demands and not manoeuvre.direct.complete and not self._demands.followed:
                return
            for part in RESET_AT_START:
                where = STATE.slice(part)
                self._x[where] = self._start[where]
            self.manoeuvre_start_ns = now_ns
            if self._layout.timed(self._of_manoeuvre):
                self.switch_effects(self._of_manoeuvre)
            self.state = ManoeuvreState.RUNNING
        moving = abs(self._x.item(_SPEED)) > STANDING_MPS
        self._standing_ns = 0 if moving else self._standing_ns + elapsed_ns
        limit_s = manoeuvre.end_after_standstill_s
        stood = limit_s is not None and self._standing_ns >= limit_s * 1e9
        if stood or now_ns - self.manoeuvre_start_ns >= manoeuvre.duration_s * 1e9:
            self.state = _FINISHED

    def _stimulus(self, reception: Reception, now_ns: int) -> Message | None:
        last_ns = reception.last_valid_ns
        return None if last_ns is None or now_ns - last_ns > STIMULUS_TIMEOUT_NS else reception.message

    def _drive(self, now_ns: int, pressure: list[float], motor: list[float]) -> None:
        """Driver, road and demands (Pa, N m) from this tick on."""
        manoeuvre, start = self._manoeuvre, self.manoeuvre_start_ns
        time_s = 0.0 if start is None else (now_ns - start) * 1e-9
        pedal = 0.0 if start is None else driver.pedal_travel(manoeuvre, time_s)
        steering = 0.0 if start is None else value_at(manoeuvre.steering_wheel_rad, time_s)
        target = manoeuvre.initial_speed_mps if start is None else driver.target_speed(manoeuvre, time_s)
        live = self._stimulus(self._live_driver, now_ns)
        if isinstance(live, StimulusDriver):
            pedal = pedal if live.pedal_travel is None else live.pedal_travel
            target = target if live.target_speed_mps is None else live.target_speed_mps
            steering = steering if live.steering_wheel_angle_rad is None else live.steering_wheel_angle_rad
        theirs = self._external_nodes.pedal_travel(), self._external_nodes.steering_wheel_rad()
        self._pedal = pedal if theirs[0] is None else theirs[0]
        self._steering_rad = steering if theirs[1] is None else theirs[1]
        self._override_road(now_ns)

        direct = manoeuvre.direct
        hold_nm = self._hold_torque_nm(target)
        motor = [hold_nm + value for value in motor]
        if start is not None and self._direct:
            pressure = [value_at(t, time_s) if t else v for t, v in zip(direct.pressure_pa, pressure, strict=True)]
            motor = [value_at(t, time_s) if t else v for t, v in zip(direct.motor_nm, motor, strict=True)]
        if self._broken.alters:
            pressure, motor = self._broken.act(pressure, motor, self._x)
        self._write_driven(*pressure, *motor, self._steering_rad)
        self._external_nodes.enter(now_ns, self._u)

    def _hold_torque_nm(self, target_mps: float | None) -> float:
        if target_mps is None or self._pedal > driver.PEDAL_FREE:
            return 0.0
        radius, y = self._parameters.wheel.rolling_radius_m, self._y
        fl, fr, rl, rr = y[Y.rolling_torque_nm : Y.rolling_torque_nm + 4].tolist()
        resistance = y.item(Y.drag_n) + (fl + fr + rl + rr) / radius
        mass = self._parameters.vehicle.mass_kg
        speed, grade = self._x.item(_SPEED), y.item(Y.grade)
        return driver.drive_force(target_mps, speed, mass, resistance, grade) * radius / 4.0

    def _override_road(self, now_ns: int) -> None:
        if self._live_road.last_valid_ns is None:  # mostly
            return
        live = self._stimulus(self._live_road, now_ns)
        road = self._own_road
        if isinstance(live, StimulusRoad) and any(value is not None for value in live):
            road = self._own_road.copy()
            for column, value in enumerate(live, start=1):
                if value is not None:
                    road[:, column] = value
        if road is not self._scene.road:
            self._scene = replace(self._scene, road=road)
