"""The plant as a unit of co-simulation: demands of the actuators in, motion and sensors out, steps of 1 ms inside."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from struct import Struct

import numpy as np

from dbc.bench_messages import PlantReception, StimulusRoad, TruthMotion
from dbc.contract import Message, spec_of
from dbc.messages import EhbDemandFront, EhbDemandRear, EhbState, MotorDemandFront, MotorDemandRear, Steering
from hil.errors import BrakebenchError
from hil.fmu.variables import Table, Variable, is_integer, parameter_variables, signal_variables, with_parameters
from plant.layout import Vector
from plant.model import STEP_S, Scene, advance, compile_model, initial_state, pack
from plant.parameters.plant import PlantParameters
from plant.reports import DERIVED, OF_NODES, TRUTH, D, gather
from plant.road import DRY, road_table
from plant.sensors import SENSED, Noise, measure
from plant.vectors import INPUT, OUTPUT, STATE, U, X

SAMPLE_STEPS = 10  # sensors are read every 10 ms, as their messages' cycle
_DEMANDS = (EhbDemandFront, EhbDemandRear, MotorDemandFront, MotorDemandRear, Steering)
_NODES = ("SENSORS", "EHB", "IWM", "BATTERY")
_ROAD_START = {"FRICTION_LEFT": 1.0, "FRICTION_RIGHT": 1.0, "GRADE": 0.0}
_HEAD = Struct("<8s?qqq")
_MAGIC = b"bbplant1"
STEPS_BEHIND = 1e-6  # of a step: how far a communication point may lie before a step's end for rounding


class StateError(BrakebenchError):
    """Bytes that are no state of this FMU."""


@dataclass(frozen=True, slots=True)
class Start:
    """How the car starts: rolling straight ahead, brakes released."""

    speed_mps: float
    disc_temperature_k: float
    state_of_charge: float


_START_OF = {"speed_mps": ("m/s", -15.0, 60.0), "disc_temperature_k": ("K", 200.0, 1200.0)}  # as in a scenario
_START_OF |= {"state_of_charge": ("", 0.0, 1.0)}


def _reported() -> Iterator[tuple[type[Message], str, int, bool]]:
    """Message, field, place and whether it is an integer, of all that is told."""
    messages = {kind: places for node in _NODES for kind, places in OF_NODES[node].items()} | TRUTH
    for kind, places in messages.items():
        for field, place in zip(spec_of(kind).fields, places, strict=True):
            if kind is not PlantReception and not (kind is TruthMotion and field.name == "manoeuvre"):
                yield kind, f"{spec_of(kind).name}.{field.signal}", place, is_integer(field)


def variables(parameters: PlantParameters, start: Start) -> list[Variable]:
    """All variables: inputs, outputs, parameters."""
    of = [v for kind in _DEMANDS for v in signal_variables(kind, "input")]
    of = [replace(v, start=0.0) for v in of]
    road = signal_variables(StimulusRoad, "input")
    of += [replace(v, start=_ROAD_START[v.name.partition(".")[2]]) for v in road]
    kinds = dict.fromkeys(kind for kind, *_ in _reported())
    of += [v for kind in kinds for v in signal_variables(kind, "output", ("manoeuvre",))]
    for name, (unit, low, high) in _START_OF.items():
        of.append(Variable(f"start.{name}", "Float64", "parameter", getattr(start, name), unit, "", low, high))
    of.append(Variable("seed", "Int32", "parameter", 1, description="of all noise", low=0))
    return [*of, *parameter_variables(parameters)]


class PlantUnit:
    """The car between two communication points.

    Parameters
    ----------
    parameters, start : before the importer's changes, which are in the table.

    Attributes
    ----------
    table : values of all variables.
    """

    def __init__(self, parameters: PlantParameters, start: Start) -> None:
        self._parameters = parameters
        self.table = Table(variables(parameters, start))
        inputs = [v.name for v in self.table.variables if v.causality == "input"]
        self._inputs = self.table.real_indices(inputs)
        self._without = self.table.reals[self._inputs]  # what holds where an input is not available
        told = list(_reported())
        self._sources = np.array([place for *_, place, _ in told], np.int64)
        self._told = np.zeros(len(told))
        self._told_real = np.array([not integer for *_, integer in told])
        self._reals = self.table.real_indices([name for _, name, _, integer in told if not integer])
        self._integers = self.table.integer_indices([name for _, name, _, integer in told if integer])
        self._x, self._u, self._y = STATE.zeros(), INPUT.zeros(), OUTPUT.zeros()
        self._wheels, self._sensed, self._derived = np.zeros((3, 4)), SENSED.zeros(), DERIVED.zeros()
        self._derived[D.ehb_state : D.ehb_state + 2] = EhbState.DEMAND
        self._steps = self._drawn = self._seed = 0
        self._noise: Noise | None = None
        self._p: Vector | None = None
        self._scene = Scene()

    def preview(self) -> None:
        """Outputs of the start for what is set so far, in initialization mode."""
        self._begin()
        self._p = None

    def initialise(self) -> None:
        """Start the car."""
        self._begin()

    def _begin(self) -> None:
        compile_model()
        self._prepare()
        parameters = with_parameters(self._parameters, self.table)
        speed, temperature, charge = (float(self.table[f"start.{name}"]) for name in _START_OF)
        for (name, (unit, low, high)), value in zip(_START_OF.items(), (speed, temperature, charge), strict=True):
            if not low <= value <= high:
                raise BrakebenchError(f"FMU.start.{name}: expected {low:g} to {high:g} {unit}, got {value!r}")
        self._x[:] = initial_state(parameters, speed, temperature, charge)
        rows = self._x[X.tooth_time_s : X.tooth_time_s + 4], self._x[X.tooth_count : X.tooth_count + 4]
        self._wheels[:] = *rows, np.full(4, abs(speed / parameters.wheel.rolling_radius_m))
        self._steps = self._drawn = 0
        self._noise = None
        self._evaluate(0)
        self._sample()
        self._tell()

    def _prepare(self) -> None:
        """Derive what follows from parameters alone."""
        self._seed = int(self.table["seed"])
        if self._seed < 0:
            raise BrakebenchError(f"FMU.seed: expected 0 or more, got {self._seed}")
        self._p = pack(with_parameters(self._parameters, self.table))

    def advance_to(self, time_s: float) -> None:
        """Make all steps that end by a time since the start, s; inputs hold meanwhile."""
        due = int(time_s / STEP_S + STEPS_BEHIND)
        while self._steps < due:
            together = min(due - self._steps, SAMPLE_STEPS - self._steps % SAMPLE_STEPS)
            self._evaluate(together)
            self._steps += together
            if self._steps % SAMPLE_STEPS == 0:
                self._sample()
        self._tell()

    def _evaluate(self, steps: int) -> None:
        values = self.table.reals[self._inputs]
        missing = np.isnan(values)
        if missing.any():
            values[missing] = self._without[missing]
        self._u[: U.steering_wheel_rad + 1] = values[: U.steering_wheel_rad + 1]
        if (values[-3:] != self._scene.road[0, 1:]).any():
            road = road_table(DRY)
            road[:, 1:] = values[-3:]
            self._scene = replace(self._scene, road=road)
        assert self._p is not None
        advance(self._x, self._u, self._p, self._y, steps, self._scene)

    def _sample(self) -> None:
        assert self._p is not None
        if self._noise is None:  # the start, or a state from before
            self._noise = Noise(self._seed)
            for _ in range(self._drawn):
                self._noise.row()
        steering = float(self._u[U.steering_wheel_rad])
        measure(self._x, self._y, self._p, 0.0, steering, self._noise.row(), self._wheels, self._sensed)
        self._drawn += 1

    def _tell(self) -> None:
        assert self._p is not None
        switch = self._scene.switch
        gather(self._x, self._y, switch, self._p, self._sensed, self._derived, self._sources, self._told)
        self.table.reals[self._reals] = self._told[self._told_real]
        self.table.integers[self._integers] = self._told[~self._told_real].astype(np.int64)

    @property
    def _vectors(self) -> tuple[Vector, ...]:
        return self.table.reals, self._x, self._u, self._y, self._wheels, self._sensed, self._derived

    def state(self) -> bytes:
        """All that a later step depends on."""
        head = _HEAD.pack(_MAGIC, self._p is not None, self._steps, self._drawn, self.table.integers.size)
        return b"".join([head, self.table.integers.tobytes(), *(v.tobytes() for v in self._vectors)])

    def restore(self, state: bytes) -> None:
        """Go back to a state.

        Raises
        ------
        StateError : no state of this FMU.
        """
        size = _HEAD.size + self.table.integers.nbytes + sum(v.nbytes for v in self._vectors)
        if len(state) != size or not state.startswith(_MAGIC):
            raise StateError(f"state: expected {size} bytes of this FMU, got {len(state)}")
        _, started, self._steps, self._drawn, _ = _HEAD.unpack_from(state)
        at = _HEAD.size
        for vector in (self.table.integers, *self._vectors):
            vector.reshape(-1)[:] = np.frombuffer(state, vector.dtype, vector.size, at)
            at += vector.nbytes
        self._noise = self._p = None
        if started:
            compile_model()
            self._prepare()

    def event(self, received: bytes) -> None:
        """Nothing happens in events: it has no clocks."""

    @property
    def outgoing(self) -> bytes:
        """What is to be sent: nothing, it has no bus."""
        return b""
