"""Free replays of cars over all drives of a case, many at once."""

import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import savgol_filter

from hil.diagnosis.data.dataset import ROW_S, SLOW_MPS, Dataset, Recording, Segment
from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.prepare import averaged
from hil.diagnosis.parallel import parallel_map, thread_each
from hil.diagnosis.simulation import excitation as acting
from hil.diagnosis.simulation.hot_spots import (
    QUARTER_RAD,
    fit_phase,
    has_hot_spots,
    row_chunks,
    wheel_angles,
    with_spots,
    without_spots,
)
from hil.diagnosis.simulation.initial_state import initial_state_of, restart_segment, start_speed
from hil.diagnosis.simulation.latency import without_latency
from hil.diagnosis.simulation.measurement_model import SOURCE, MeasurementModel, Stack, powers
from hil.diagnosis.simulation.parameter_set import ParameterSet, excitation_that_separates, same_sensors
from hil.diagnosis.simulation.sensors import before_sensors
from hil.diagnosis.simulation.substeps import STEPS, rows_per_step
from hil.diagnosis.vehicle.spec import Vehicle
from plant.effects.plugin import NO_PLUGINS
from plant.effects.states import EXTRA_STATES
from plant.effects.theta import THETA
from plant.integrate import EXPONENTIAL
from plant.model import column_indices, healthy, simulate
from plant.road import DRY, road_table
from plant.vectors import INPUT, OUTPUT, STATE, P, U

_SLOW = np.concatenate(
    [
        np.arange(STATE.size)[STATE.slice(name)]
        for name in (
            "winding_temperature_k", "pad_friction", "pad_temperature_k", "disc_temperature_k", "state_of_charge",
            *EXTRA_STATES,
        )
    ]
)  # fmt: skip
"""States that a segment hands on to a later one, beside the motion."""
_ANGLES = STATE.slice("wheel_angle_rad")
_INPUTS = (("pressure", "pressure_pa"), ("motor", "motor_torque_nm"))
_SMOOTH = 21  # rows of 10 ms
_FADING_MPS, _LEAST_NM = 0.3, 1.0
_GRADE, _TURNS_MPS2, _CHARACTERISTIC_MPS = 0.01, 0.3, (8.0, 200.0)


@dataclass(frozen=True, eq=False)
class _Replay:
    """A world's replay of a drive: its inputs, what was noted, the states at the start and after each segment."""

    inputs: Floats
    table: Floats
    states: tuple[Floats, ...]


@dataclass(frozen=True, eq=False)
class _Kept:
    """A world, its replay of each drive, and what its sensors told of them."""

    world: ParameterSet
    replays: Sequence[_Replay]
    told: Sequence[Stack]


@dataclass(frozen=True, eq=False)
class _Made:
    """The world that made what drives the car; for each drive its inputs as that world tells them, and these taken back
    again. The latter differ from the inputs by what reading between rows costs, twice."""

    world: ParameterSet
    told: list[tuple[Floats, Floats]]


def _taken_back(inputs: Floats, drive: Recording, world: ParameterSet) -> Floats:
    """Measured inputs of a drive without what sensors and nodes of a world added; demands when they are acted on."""
    return without_latency(before_sensors(inputs, world.theta_in(drive), ROW_S), world.latency_s)


def _samples(drive: Recording, segment: Segment) -> slice:
    """Samples of a segment."""
    return slice(segment.first // drive.stride, segment.last // drive.stride)


def _going_on(drive: Recording, segment: Segment) -> acting.Excitation:
    """What is going on in a segment."""
    rows, samples = drive.inputs[segment.first : segment.last], _samples(drive, segment)
    ay = drive.measured.get("ay")
    return acting.excitation_of(rows, drive.speed_mps[samples], None if ay is None else ay[samples])


def _with_theta(parts: Iterable[slice], thetas: Sequence[tuple[int, Floats]]) -> Iterator[tuple[slice, Floats]]:
    """Parts of a drive's rows, cut where another theta begins, and theta in each."""
    ends = [row for row, _ in thetas[1:]] + [sys.maxsize]
    for part in parts:
        for (begin, theta), end in zip(thetas, ends, strict=True):
            first, last = max(part.start, begin), min(part.stop, end)
            if first < last:
                yield slice(first, last), theta


class Simulator:
    """Replays worlds over the drives of a case.

    Limits of motors and turning are those at the measured wheel speed: a motor at its limits and a car in a bend answer
    every error of the speed, whatever made it.
    """

    def __init__(self, case: Dataset, vehicle: Vehicle, characteristic_mps: float = np.inf) -> None:
        self.dataset, self.vehicle = case, vehicle
        self.measurement_model = MeasurementModel(case.groups, vehicle.parameters, characteristic_mps)
        self._groups = case.groups
        names = [name for group in case.groups for name in SOURCE[group]]
        self._columns = column_indices(names)
        self._road = road_table(DRY)
        self._going_on = [[_going_on(drive, segment) for segment in drive.segments] for drive in case.recordings]
        self._given = [drive.inputs for drive in case.recordings]
        self._pace = [rows_per_step(drive) for drive in case.recordings]
        self._kept: _Kept | None = None
        self._made: _Made | None = None
        self._turned: list[Floats] = []
        self.hot_spot_visibility: Floats = np.zeros((0, 4))
        """How much hot spots would show, by segment and wheel, where `align` chose angles."""
        self.runs = 0

    def denoised(self, world: ParameterSet) -> "Simulator":
        """A rig whose measured pressures and motor torques are rid of noise, those of fading motors left out."""
        drives = [replace(drive, measured=self._without_fading(drive, world)) for drive in self.dataset.recordings]
        rig = Simulator(replace(self.dataset, recordings=tuple(drives)), self.vehicle, self._characteristic(world))
        rig.denoise_inputs(world)
        rig._pace = [rows_per_step(drive) for drive in rig.dataset.recordings]
        return rig

    def fit_hot_spot_phase(self, world: ParameterSet) -> bool:
        """Turn the discs' hot spots to where they explain most of the wheels' speeds; whether this world has any.

        Neither a log nor a drawing tells how a wheel stood when the log began.
        """
        if "wheel" not in self._groups:
            return False
        bare = self.run(without_spots(world))["wheel"]
        turned, shown = [wheel_angles(drive) for drive in self.dataset.recordings], []
        for offset in (0.0, QUARTER_RAD):
            self._turned = [angle + offset for angle in turned]
            shown.append(self.run(with_spots(world))["wheel"] - bare)
        ends = np.cumsum([drive.samples for drive in self.dataset.recordings])[:-1]
        each = zip(*(np.split(values, ends) for values in (self.measured()["wheel"] - bare, *shown)), strict=True)
        stood = [fit_phase(drive, left, of) for drive, (left, *of) in zip(self.dataset.recordings, each, strict=True)]
        stand, much = zip(*stood, strict=True)
        self.hot_spot_visibility = np.vstack(much)
        self._turned = [angle + offset for angle, offset in zip(turned, stand, strict=True)]
        return has_hot_spots(world)

    def denoise_inputs(self, world: ParameterSet) -> None:
        """What drives the car becomes the simulated value plus the smoothed difference of the measured one.

        So steps stay sharp, between two samples too, if this world has what makes them. The measured one is taken back
        first: what its node, in this world, scaled or sampled late.
        """
        self._kept = self._made = None
        made = parallel_map(lambda drive: self._made_by(drive, world), self.dataset.recordings)
        self.dataset = replace(self.dataset, recordings=tuple(drive for drive, _ in made))
        self._made = _Made(world, [told for _, told in made])

    def _made_by(self, drive: Recording, world: ParameterSet) -> tuple[Recording, tuple[Floats, Floats]]:
        """A drive with the inputs of `quieten`; and these as told, and taken back again, as in `_Made`."""
        wanted = [one for one in _INPUTS if one[0] in self._groups and one[0] in self.dataset.tracked_actuators]
        given = self._given[drive.number]
        drive = replace(drive, inputs=given)
        raw = self._raw(drive, world)
        inputs = _taken_back(given, drive, world).copy()
        for group, part in wanted:
            where = INPUT.slice(part)
            apart = inputs[:, where] - raw[group]
            window = min(_SMOOTH, (len(apart) - 1) // 2 * 2 + 1)
            inputs[:, where] = raw[group] + savgol_filter(apart, window, 2, axis=0)
        if "motor" in self._groups:
            inputs[:, INPUT.slice("motor_torque_bend_nm")] = self._bend(drive, world)
        again = given.copy()
        drive = replace(drive, inputs=inputs)
        seen = self.measurement_model.measure_rows(
            {group: inputs[:, INPUT.slice(part)] for group, part in wanted}, drive, world
        )
        for group, part in wanted:
            again[:, INPUT.slice(part)] = seen[group]
        return drive, (again, _taken_back(again, drive, world))

    def _driving(self, drive: Recording, world: ParameterSet) -> Floats:
        """What drives the car in a world whose sensors and nodes told it as it is in the logs."""
        if self._made is None:
            return _taken_back(drive.inputs, drive, world)
        if same_sensors(world, self._made.world):
            return drive.inputs
        told, back = self._made.told[drive.number]
        return np.asarray(drive.inputs + (_taken_back(told, drive, world) - back))

    def _bend(self, drive: Recording, world: ParameterSet) -> Floats:
        """Torque of the simulated motors in the middle of each row, beyond the straight line to the next, (rows, 4)."""
        halves = np.repeat(drive.inputs, 2, axis=0)
        halves[1:-1:2, U.steering_wheel_rad :] += 0.5 * np.diff(drive.inputs[:, U.steering_wheel_rad :], axis=0)
        columns = column_indices(SOURCE["motor"])
        table = np.empty((len(halves), len(columns)))
        simulate(
            initial_state_of(self.vehicle, drive, world, drive.inputs), halves, self.dataset.measured_input_mask, healthy(), world.p, self._road,
            ROW_S / 2, 1, np.ones(len(halves), np.int64), EXPONENTIAL, columns, table, OUTPUT.zeros(),
            world.theta_in(drive), world.nonparametric_rows, NO_PLUGINS,
        )  # fmt: skip
        torque, middle = table[::2], table[1::2]
        following = np.concatenate((torque[1:], torque[-1:]))
        return middle - 0.5 * (torque + following)

    @staticmethod
    def _without_fading(drive: Recording, world: ParameterSet) -> Stack:
        """Measured channels without motors whose braking fades: there it answers errors of speed no sensor resolves.

        Which way a wheel at rest creeps is such an error, too: there any torque may be taken for one that brakes.
        """
        if not {"motor", "wheel"} <= set(drive.measured):
            return drive.measured
        speed = np.nan_to_num(drive.measured["wheel"]) * float(world.p[P.wheel_rolling_radius_m])
        asked = averaged(drive.inputs[:, INPUT.slice("motor_demand_nm")], drive.stride)
        brakes = (speed < float(world.p[P.motor_fade_start_mps]) + _FADING_MPS) & (asked < -_LEAST_NM)
        fades = brakes | ((np.abs(speed) < _FADING_MPS) & (np.abs(asked) > _LEAST_NM))
        return {**drive.measured, "motor": np.where(fades, np.nan, drive.measured["motor"])}

    def _characteristic(self, world: ParameterSet) -> float:
        """Characteristic speed of the simulated car, m/s: how its turning answers a small difference of the speed."""
        if not {"wheel", "ay"} <= set(self._groups):
            return np.inf
        tail = world.theta.copy()
        tail[THETA.slice("road_grade", "grade")] += _GRADE
        a, b = (self._stacked(one) for one in (world, replace(world, theta=tail)))
        v = a["wheel"].mean(axis=1) * float(world.p[P.wheel_rolling_radius_m])
        turning = (np.abs(a["ay"][:, 0]) > _TURNS_MPS2) & (v > SLOW_MPS)
        ay, v, faster = a["ay"][turning, 0], v[turning], (b["wheel"] - a["wheel"]).mean(axis=1)[turning]
        if not len(ay):
            return np.inf
        share = faster / a["wheel"].mean(axis=1)[turning]

        def off(log_speed: float) -> float:
            return float(np.sum(((b["ay"] - a["ay"])[turning, 0] - ay * share * powers(v, np.exp(log_speed))[0]) ** 2))

        return float(np.exp(minimize_scalar(off, bounds=np.log(_CHARACTERISTIC_MPS), method="bounded").x))

    def _stacked(self, world: ParameterSet) -> Stack:
        parts = [self._raw(drive, world) for drive in self.dataset.recordings]
        return {group: np.concatenate([part[group] for part in parts]) for group in self._groups}

    def run(self, world: ParameterSet) -> Stack:
        """Simulated channels of all drives."""
        self.runs += 1
        parts = parallel_map(lambda drive: self._drive(drive, world), self.dataset.recordings)
        return {group: np.concatenate([part[group] for part in parts]) for group in self._groups}

    def cache_baseline(self, world: ParameterSet) -> None:
        """Keep the motion of this world: others are simulated only where they can differ from it."""
        self._kept = None

        def kept(drive: Recording) -> tuple[_Replay, Stack]:
            replay = self._replayed(drive, world, self._columns)
            return replay, self.measurement_model.measure(drive, world, replay.table)

        replays, told = zip(*parallel_map(kept, self.dataset.recordings), strict=True)
        self._kept = _Kept(world, replays, told)

    def run_all(self, worlds: Sequence[ParameterSet]) -> Iterator[Stack]:
        """Of many worlds, in order, over threads."""
        return thread_each(self.run, worlds)

    def residual(self, world: ParameterSet) -> Stack:
        """Measured less simulated, (samples, channels); NaN where nothing is measured."""
        simulated = self.run(world)
        return {group: measured - simulated[group] for group, measured in self.measured().items()}

    def measured(self) -> Stack:
        """Measured channels of all drives."""
        return {g: np.concatenate([drive.measured[g] for drive in self.dataset.recordings]) for g in self._groups}

    def _drive(self, drive: Recording, world: ParameterSet) -> Stack:
        """Simulated channels of one drive; from what was kept where the worlds cannot differ."""
        kept = self._kept
        if kept is None:
            return self.measurement_model.measure(drive, world, self._replayed(drive, world, self._columns).table)
        needed, alike = excitation_that_separates(world, kept.world, drive), same_sensors(world, kept.world)
        differs = [bool(needed & going_on) for going_on in self._going_on[drive.number]]
        if alike and not any(differs):
            return kept.told[drive.number]
        replay = kept.replays[drive.number]
        if any(differs):
            replay = self._replayed(drive, world, self._columns, replay, differs, alike)
        return self.measurement_model.measure(drive, world, replay.table)

    def states(self, world: ParameterSet, names: Sequence[str]) -> Floats:
        """States and outputs by name (`plant.model.column_indices`) over all drives, (rows, names)."""
        columns = column_indices(list(names))
        return np.concatenate([self._replayed(drive, world, columns).table for drive in self.dataset.recordings])

    def _raw(self, drive: Recording, world: ParameterSet) -> Stack:
        """What a world does in one drive, before any sensor."""
        return self.measurement_model.split(self._replayed(drive, world, self._columns).table)

    def _replayed(
        self, drive: Recording, world: ParameterSet, columns: NDArray[np.int64], kept: _Replay | None = None,
        differs: Sequence[bool] = (), alike: bool = False,
    ) -> _Replay:  # fmt: skip
        """One drive, noting what ``columns`` ask for at every row.

        Segments that do not differ are taken from ``kept``; what moves slowly goes on from where it was. Inputs are
        those of ``kept`` where sensors and frames are ``alike``.
        """
        thetas = world.thetas_in(drive)
        inputs = kept.inputs if kept is not None and alike else self._driving(drive, world)
        x = initial_state_of(self.vehicle, drive, world, inputs)
        table = np.empty((len(inputs), len(columns)))
        cut, switch, y, pace = self.dataset.measured_input_mask, healthy(), OUTPUT.zeros(), self._pace[drive.number]
        states = [x.copy()]
        turned = self._turned[drive.number] if self._turned and has_hot_spots(world) else None
        for number, segment in enumerate(drive.segments):
            rows = slice(segment.first, segment.last)
            if kept is not None and not differs[number]:
                table[rows] = kept.table[rows]
                ahead = x[_SLOW] - kept.states[number][_SLOW]
                x = kept.states[number + 1].copy()
                x[_SLOW] += ahead
                continue
            if number:
                restart_segment(x, start_speed(drive, segment, world))
            for part, theta in _with_theta([rows] if turned is None else row_chunks(rows), thetas):
                if turned is not None:
                    x[_ANGLES] = turned[part.start]
                given = inputs[part.start : min(part.stop + 1, rows.stop)]
                simulate(
                    x, given, cut, switch, world.p, self._road, ROW_S / STEPS, STEPS, pace[part], EXPONENTIAL,
                    columns, table[part], y, theta, world.nonparametric_rows, NO_PLUGINS,
                )  # fmt: skip
            states.append(x.copy())
        return _Replay(inputs, table, tuple(states))
