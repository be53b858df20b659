"""Open-loop simulation of a dataset: its inputs drive the plant for any parameter set, segment by segment."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from hil.diagnosis.data.dataset import ROW_S, Dataset, Recording
from hil.diagnosis.data.log import Floats
from hil.diagnosis.parallel import parallel_map, thread_each
from hil.diagnosis.simulation.excitation import segment_excitations
from hil.diagnosis.simulation.hot_spots import (
    QUARTER_RAD,
    fit_phase,
    has_hot_spots,
    wheel_angles,
    with_spots,
    without_spots,
)
from hil.diagnosis.simulation.initial_state import initial_state_of
from hil.diagnosis.simulation.measurement_model import (
    SOURCE,
    MeasurementModel,
    Stack,
    characteristic_speed,
    without_fading_motors,
    without_latency,
)
from hil.diagnosis.simulation.parameter_set import ParameterSet, excitation_that_separates, same_sensors
from hil.diagnosis.simulation.replay import Replay, motor_bend, replayed
from hil.diagnosis.simulation.sensors import before_sensors
from hil.diagnosis.simulation.substeps import rows_per_step
from hil.diagnosis.vehicle.spec import Vehicle
from plant.excitation import Excitation
from plant.injection.theta import THETA
from plant.model import column_indices
from plant.vectors import INPUT

_INPUTS = (("pressure", "pressure_pa"), ("motor", "motor_torque_nm"))
_SMOOTH = 21  # rows of 10 ms
_GRADE = 0.01


@dataclass(frozen=True, eq=False)
class _Baseline:
    """Replays and channels of one parameter set, by recording: others are simulated only where they can differ."""

    parameters: ParameterSet
    replays: tuple[Replay, ...]
    channels: tuple[Stack, ...]


@dataclass(frozen=True, eq=False)
class _Denoised:
    """The parameter set at which inputs are denoised; by recording, these inputs as its sensors give them, and taken
    back from there again. The latter differ from the inputs by what interpolation between rows costs, twice."""

    parameters: ParameterSet
    inputs: tuple[tuple[Floats, Floats], ...]


@dataclass(frozen=True, eq=False)
class _Setup:
    """What denoising leaves alone in one recording: raw inputs, excitation of each segment, rows made as one step."""

    raw_inputs: Floats
    excitations: tuple[Excitation, ...]
    rows_per_step: NDArray[np.int64]


@dataclass
class _Runs:
    """Count of `Simulator.run`, shared by all simulators that come from one; results do not depend on it."""

    total: int = 0


def _true_inputs(inputs: Floats, recording: Recording, parameters: ParameterSet) -> Floats:
    """Measured inputs without what sensors and nodes of a parameter set add; demands when they are acted on."""
    theta = parameters.theta_in(recording)
    return without_latency(before_sensors(inputs, theta, ROW_S), parameters.latency_s, theta)


@dataclass(frozen=True, eq=False)
class Simulator:
    """Simulates parameter sets over the recordings of a dataset. A value: what changes it returns another one.

    `denoised` takes noise out of the inputs, at one parameter set. `with_baseline` simulates one, and from then on only
    the segments in which others can differ from it; without a baseline every segment is simulated.

    Limits of motors and turning are those at the measured wheel speed: a motor at its limits and a car in a bend answer
    every error of the speed, whatever made it.

    Attributes
    ----------
    dataset : recordings with the inputs that drive the plant, denoised or not.  vehicle : the nominal one.
    characteristic_mps : speed with which the car's turning goes (`characteristic_speed`).
    hot_spot_visibility : (segments, 4), how much hot spots would show where `with_hot_spot_phase` chose angles.
    hot_spot_angles : (rows, 4) of each recording, rad; empty where no phase was fitted.
    driven_by : stands for inputs and angles: simulators with the same one give one parameter set the same channels.
    """

    dataset: Dataset
    vehicle: Vehicle
    characteristic_mps: float = np.inf
    hot_spot_visibility: Floats = field(default_factory=lambda: np.zeros((0, 4)))
    hot_spot_angles: tuple[Floats, ...] = ()
    driven_by: object = field(default_factory=object)
    _setups: tuple[_Setup, ...] = ()
    _denoised: _Denoised | None = None
    _baseline: _Baseline | None = None
    _runs: _Runs = field(default_factory=_Runs)

    def __post_init__(self) -> None:
        if not self._setups:
            recordings = self.dataset.recordings
            setups = (_Setup(one.inputs, segment_excitations(one), rows_per_step(one)) for one in recordings)
            object.__setattr__(self, "_setups", tuple(setups))

    @cached_property
    def measurement_model(self) -> MeasurementModel:
        """From plant columns to the channels of the dataset."""
        return MeasurementModel(self.dataset.groups, self.vehicle.parameters, self.characteristic_mps)

    @cached_property
    def _columns(self) -> NDArray[np.int64]:
        return column_indices([name for group in self.dataset.groups for name in SOURCE[group]])

    @property
    def runs(self) -> int:
        """How often parameter sets were simulated over all recordings, by all simulators that come from one."""
        return self._runs.total

    def prepared(self, at: ParameterSet) -> "Simulator":
        """Ready for fits: fading motors left out of the measured channels, turning as the car's at the measured speed,
        inputs denoised, steps as fine as these inputs need. ``at`` is the nominal parameter set."""
        recordings = [replace(one, measured=without_fading_motors(one, at)) for one in self.dataset.recordings]
        dataset = replace(self.dataset, recordings=tuple(recordings))
        denoised = Simulator(dataset, self.vehicle, self._characteristic(at)).denoised(at)
        each = zip(denoised._setups, denoised.dataset.recordings, strict=True)
        setups = tuple(replace(setup, rows_per_step=rows_per_step(one)) for setup, one in each)
        return replace(denoised, driven_by=object(), _setups=setups)

    def denoised(self, at: ParameterSet) -> "Simulator":
        """With inputs made anew from the raw ones, and no baseline: pressures and motor torques become the simulated
        ones plus the smoothed difference of the measured ones.

        So steps stay sharp, between two samples too, if this parameter set has what makes them. What its sensors scale
        or sample late is taken back from the measured ones first.
        """
        raw = replace(self, _denoised=None, _baseline=None)
        recordings, inputs = zip(*parallel_map(lambda one: raw._denoise(one, at), self.dataset.recordings), strict=True)
        dataset = replace(self.dataset, recordings=recordings)
        return replace(raw, dataset=dataset, driven_by=object(), _denoised=_Denoised(at, inputs))

    def with_baseline(self, at: ParameterSet) -> "Simulator":
        """With this parameter set simulated once: others are simulated only where they can differ from it."""

        def simulated(recording: Recording) -> tuple[Replay, Stack]:
            own = at.in_recording(recording.number)
            replay = self._replay(recording, own, self._columns)
            return replay, self.measurement_model.measure(recording, own, replay.table)

        replays, channels = zip(*parallel_map(simulated, self.dataset.recordings), strict=True)
        return replace(self, _baseline=_Baseline(at, replays, channels))

    def with_hot_spot_phase(self, at: ParameterSet) -> "Simulator":
        """With the discs' hot spots turned to where they explain most of the wheels' speeds, at this parameter set.

        Neither a log nor a drawing says how a wheel stood when the log began. Without wheel speeds nothing is turned.
        The baseline stays.
        """
        if "wheel" not in self.dataset.groups:
            return self
        recordings = self.dataset.recordings
        bare = self.run(without_spots(at))["wheel"]
        angles, shown = [wheel_angles(one) for one in recordings], []
        for offset in (0.0, QUARTER_RAD):
            turned = replace(self, hot_spot_angles=tuple(angle + offset for angle in angles))
            shown.append(turned.run(with_spots(at))["wheel"] - bare)
        ends = np.cumsum([one.samples for one in recordings])[:-1]
        each = zip(*(np.split(values, ends) for values in (self.measured()["wheel"] - bare, *shown)), strict=True)
        fitted = [fit_phase(one, residual, of) for one, (residual, *of) in zip(recordings, each, strict=True)]
        phases, visibility = zip(*fitted, strict=True)
        turned_by = tuple(angle + phase for angle, phase in zip(angles, phases, strict=True))
        return replace(self, hot_spot_visibility=np.vstack(visibility), hot_spot_angles=turned_by, driven_by=object())

    def _denoise(self, recording: Recording, at: ParameterSet) -> tuple[Recording, tuple[Floats, Floats]]:
        """A recording with the inputs of `denoised`; these as sensors give them, and taken back again (`_Denoised`)."""
        groups, tracked = self.dataset.groups, self.dataset.tracked_actuators
        wanted = [one for one in _INPUTS if one[0] in groups and one[0] in tracked]
        at = at.in_recording(recording.number)
        measured = self._setups[recording.number].raw_inputs
        recording = replace(recording, inputs=measured)
        simulated = self.measurement_model.split(self._replay(recording, at, self._columns).table)
        inputs = _true_inputs(measured, recording, at).copy()
        for group, part in wanted:
            where = INPUT.slice(part)
            difference = inputs[:, where] - simulated[group]
            if not np.isfinite(difference).all():  # the car diverges: inputs stay as measured
                continue
            window = min(_SMOOTH, (len(difference) - 1) // 2 * 2 + 1)
            inputs[:, where] = simulated[group] + savgol_filter(difference, window, 2, axis=0)
        if "motor" in groups:
            x, mask = initial_state_of(self.vehicle, recording, at, measured), self.dataset.measured_input_mask
            bend = motor_bend(x, recording, at, mask)
            inputs[:, INPUT.slice("motor_torque_bend_nm")] = np.where(np.isfinite(bend), bend, 0.0)
        again = measured.copy()
        recording = replace(recording, inputs=inputs)
        sensed = self.measurement_model.measure_rows(
            {group: inputs[:, INPUT.slice(part)] for group, part in wanted}, recording, at
        )
        for group, part in wanted:
            again[:, INPUT.slice(part)] = sensed[group]
        return recording, (again, _true_inputs(again, recording, at))

    def _inputs(self, recording: Recording, parameters: ParameterSet) -> Floats:
        """Inputs of the plant of a parameter set whose sensors and nodes gave the logs, (rows, INPUT.size)."""
        if self._denoised is None:
            return _true_inputs(recording.inputs, recording, parameters)
        if same_sensors(parameters, self._denoised.parameters.in_recording(recording.number)):
            return recording.inputs
        sensed, back = self._denoised.inputs[recording.number]
        return np.asarray(recording.inputs + (_true_inputs(sensed, recording, parameters) - back))

    def _characteristic(self, at: ParameterSet) -> float:
        """Characteristic speed of the simulated car, m/s (`characteristic_speed`), from two replays: on the road as it
        is, and on a grade."""
        if not {"wheel", "ay"} <= set(self.dataset.groups):
            return np.inf
        theta = at.theta.copy()
        theta[THETA.slice("road_grade", "grade")] += _GRADE
        level, graded = (self._plant_columns(one) for one in (at, replace(at, theta=theta)))
        return characteristic_speed(level, graded, at)

    def _plant_columns(self, parameters: ParameterSet) -> Stack:
        """Columns of the plant by group over all recordings, before any sensor."""
        tables = [
            self._replay(one, parameters.in_recording(one.number), self._columns).table
            for one in self.dataset.recordings
        ]
        parts = [self.measurement_model.split(table) for table in tables]
        return {group: np.concatenate([part[group] for part in parts]) for group in self.dataset.groups}

    def run(self, parameters: ParameterSet) -> Stack:
        """Simulated channels of all recordings."""
        self._runs.total += 1
        parts = parallel_map(lambda one: self._channels(one, parameters), self.dataset.recordings)
        return {group: np.concatenate([part[group] for part in parts]) for group in self.dataset.groups}

    def run_all(self, parameter_sets: Sequence[ParameterSet]) -> Iterator[Stack]:
        """Channels of many parameter sets, in order, over threads."""
        return thread_each(self.run, parameter_sets)

    def residual(self, parameters: ParameterSet) -> Stack:
        """Measured less simulated, (samples, channels); NaN where nothing is measured."""
        simulated = self.run(parameters)
        return {group: measured - simulated[group] for group, measured in self.measured().items()}

    def measured(self) -> Stack:
        """Measured channels of all recordings."""
        recordings, groups = self.dataset.recordings, self.dataset.groups
        return {group: np.concatenate([one.measured[group] for one in recordings]) for group in groups}

    def states(self, parameters: ParameterSet, names: Sequence[str]) -> Floats:
        """States and outputs by name (`plant.model.column_indices`) over all recordings, (rows, names)."""
        columns = column_indices(list(names))
        recordings = self.dataset.recordings
        each = (self._replay(one, parameters.in_recording(one.number), columns).table for one in recordings)
        return np.concatenate(list(each))

    def _channels(self, recording: Recording, parameters: ParameterSet) -> Stack:
        """Simulated channels of one recording; those of the baseline where the parameter sets cannot differ."""
        baseline, parameters = self._baseline, parameters.in_recording(recording.number)
        if baseline is None:
            table = self._replay(recording, parameters, self._columns).table
            return self.measurement_model.measure(recording, parameters, table)
        before = baseline.parameters.in_recording(recording.number)
        needed = excitation_that_separates(parameters, before, recording)
        alike = same_sensors(parameters, before)
        differs = [bool(needed & present) for present in self._setups[recording.number].excitations]
        if alike and not any(differs):
            return baseline.channels[recording.number]
        replay = baseline.replays[recording.number]
        if any(differs):
            replay = self._replay(recording, parameters, self._columns, replay, differs, alike)
        return self.measurement_model.measure(recording, parameters, replay.table)

    def _replay(
        self, recording: Recording, parameters: ParameterSet, columns: NDArray[np.int64],
        baseline: Replay | None = None, differs: Sequence[bool] = (), alike: bool = False,
    ) -> Replay:  # fmt: skip
        """One recording, with ``columns`` of the plant noted at every row; inputs are those of the ``baseline`` where
        sensors and frames are ``alike``."""
        inputs = baseline.inputs if baseline is not None and alike else self._inputs(recording, parameters)
        pace = self._setups[recording.number].rows_per_step
        angles = self.hot_spot_angles[recording.number] if self.hot_spot_angles and has_hot_spots(parameters) else None
        x = initial_state_of(self.vehicle, recording, parameters, inputs)
        mask = self.dataset.measured_input_mask
        return replayed(x, recording, parameters, inputs, mask, pace, columns, angles, baseline, differs)
