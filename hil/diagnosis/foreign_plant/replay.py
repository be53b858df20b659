"""An FMU driven by the inputs of a dataset, segment after segment; each begins anew at the measured speed."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hil.diagnosis.data.brakebench_signals import own_sources
from hil.diagnosis.data.dataset import ROW_S, Dataset, Recording, Segment
from hil.diagnosis.data.grid import averaged, resampled, without_gaps
from hil.diagnosis.data.log import MOTOR_TORQUE, Floats, UnusableError
from hil.diagnosis.data.prepare import TRACK
from hil.fmu.foreign import ForeignFmu
from hil.fmu.foreign_plant import checked_step_s, steps_until
from hil.fmu.plant_map import REQUESTED, SPEED, PlantMap, Source
from plant.vectors import INPUT

_PEDAL, _STEERING, _ = REQUESTED[8:]
_FOUR = ("pressure_demand_pa", "motor_demand_nm")
"""Inputs that the first eight of `REQUESTED` are, four of each."""


@dataclass(frozen=True, eq=False)
class Simulated:
    """What came of a replay.

    Attributes
    ----------
    channels : (samples of all recordings,) by channel of the log, SI; NaN where the FMU gives no number.
    about : what the FMU says of itself: name, fmi, tool, step_s, starts_at (the parameter that takes the speed).
    """

    channels: Mapping[str, Floats]
    about: Mapping[str, Any]


def replay(
    path: Path, chart: PlantMap, dataset: Dataset, radius_m: float, torque_constant_nm_a: float,
    report: Callable[[str], None],
) -> Simulated:  # fmt: skip
    """Drive the FMU, in a process of its own for each segment.

    Raises
    ------
    hil.fmu.model.FmuError : it cannot be loaded, refuses, crashes or stalls.
    UnusableError : the map names no measured channel, or asks for what the logs do not have.
    """
    sources = compared(chart, dataset)
    parts: dict[str, list[Floats]] = {channel: [] for channel in sources}
    about: dict[str, Any] = {}
    total, done = len(dataset.segments), 0
    for recording in dataset.recordings:
        requested = _requested((*chart.inputs.values(), *sources.values()), recording)
        rows = {channel: np.full(len(recording.inputs), np.nan) for channel in sources}
        for segment in _segments(recording, chart):
            done += 1
            report(f"{path.name}: {recording.log.name}, from {segment.first * ROW_S:.0f} s" + f" ({done} of {total})")
            here = {name: values[segment.first : segment.last] for name, values in requested.items()}
            about_fmu, found = _driven(path, chart, here, start_speed(segment, radius_m))
            about = about or {name: about_fmu[name] for name in ("name", "fmi", "tool", "step_s")}
            one = np.ones(segment.last - segment.first)
            for channel, source in sources.items():
                factor = torque_constant_nm_a if channel in MOTOR_TORQUE else 1.0  # motors tell their current
                rows[channel][segment.first : segment.last] = factor * source.value(found, here, one)
        for channel, values in rows.items():
            parts[channel].append(averaged(values[:, None], recording.stride)[:, 0])
    about["starts_at"] = None if chart.start_speed is None else chart.start_speed.name
    return Simulated({channel: np.concatenate(values) for channel, values in parts.items()}, about)


def compared(chart: PlantMap, dataset: Dataset) -> dict[str, Source]:
    """By channel: what the FMU gives for it, of the channels that are measured.

    Raises
    ------
    UnusableError : there is none.
    """
    signals = {channel: signal for channel, signal in own_sources()[0].items() if channel not in ("pedal", "steer_rad")}
    signals["speed_mps"] = SPEED
    measured = [channel for group in dataset.groups for channel in TRACK[group]]
    found = {c: chart.outputs[signals[c]] for c in measured if c in signals and signals[c] in chart.outputs}
    found = {channel: source for channel, source in found.items() if source.is_of_fmu}
    if not found:
        names = ", ".join(signals[channel] for channel in measured if channel in signals)
        raise UnusableError(
            "--map: expected an output of the FMU for one of the measured channels, got none; the logs have " + names
        )
    return found


def start_speed(segment: Segment, radius_m: float) -> float:
    """Measured speed at a segment's start, m/s; a car that rolls back a little is at rest."""
    measured = segment.start_speed_mps
    return max(segment.start_wheel_rad_s * radius_m if measured is None else measured, 0.0)


def _segments(recording: Recording, chart: PlantMap) -> tuple[Segment, ...]:
    """Those of the recording; all in one for an FMU that does not take its speed."""
    first = recording.segments[0]
    whole = Segment(0, len(recording.inputs), first.start_wheel_rad_s, first.start_speed_mps)
    return (whole,) if chart.start_speed is None else recording.segments


def _requested(wanted: Iterable[Source], recording: Recording) -> dict[str, Floats]:
    """What driver and controller demanded, (rows,) by name of `REQUESTED`; all that is ``wanted``."""
    log, inputs = recording.log, recording.inputs
    columns = np.hstack([inputs[:, INPUT.slice(name)] for name in _FOUR])
    found = dict(zip(REQUESTED, columns.T, strict=False)) | {
        _STEERING: inputs[:, INPUT.slice("steering_wheel_rad")][:, 0]
    }
    if log.has("pedal"):
        grid_s = float(log.t_s[0]) + ROW_S * np.arange(len(inputs))
        found[_PEDAL] = without_gaps(resampled(log, "pedal", grid_s))
    missing = {term.name for source in wanted for term in source.terms if term.kind == "signal"} - set(found)
    if missing:
        raise UnusableError(
            f"{log.name}: has no {', '.join(sorted(missing))}, which --map takes; give a value there "
            "({ value = ... }), or a log with it"
        )
    return found


def _driven(
    path: Path, chart: PlantMap, requested: Mapping[str, Floats], start_mps: float
) -> tuple[dict[str, Any], dict[str, Floats]]:
    """What the FMU says of itself, and its variables, (rows,): inputs hold from each row to the next."""
    fmu = ForeignFmu(path, chart.parameters_at(start_mps))
    try:
        step_s, rows = checked_step_s(fmu, chart), len(next(iter(requested.values())))
        inputs = {name: source.value({}, requested, np.ones(rows)) for name, source in chart.inputs.items()}
        wanted, steps = chart.wanted, 0
        table = np.empty((rows, len(wanted)))
        for row in range(rows):
            due = steps_until(row * ROW_S, step_s)
            if due > steps or not row:  # between two steps nothing new
                before = max(row - 1, 0)
                values = {name: float(column[before]) for name, column in inputs.items()}
                table[row] = fmu.step(values, due - steps, step_s, wanted)
            else:
                table[row] = table[row - 1]
            steps = due
        return fmu.description | {"step_s": step_s}, dict(zip(wanted, table.T, strict=True))
    finally:
        fmu.close()
