"""Replay of one recording: the plant driven by given inputs, segment after segment.

Takes a state to start with, inputs (rows, INPUT.size) and a parameter set; gives columns of the plant, (rows, columns).
Every segment restarts at the measured speed; slow states go on.
"""

import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.data.dataset import ROW_S, Recording
from hil.diagnosis.data.log import Floats
from hil.diagnosis.simulation.hot_spots import row_chunks
from hil.diagnosis.simulation.initial_state import restart_segment, start_speed
from hil.diagnosis.simulation.measurement_model import SOURCE
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.substeps import STEPS
from plant.extra_states import EXTRA_STATES
from plant.injection.plugin import NO_PLUGINS
from plant.integrate import EXPONENTIAL
from plant.model import column_indices, healthy, simulate
from plant.road import DRY, road_table
from plant.vectors import OUTPUT, STATE, U

_SLOW = np.concatenate(
    [
        np.arange(STATE.size)[STATE.slice(name)]
        for name in (
            "winding_temperature_k", "pad_friction", "pad_temperature_k", "disc_temperature_k", "state_of_charge",
            *EXTRA_STATES,
        )
    ]
)  # fmt: skip
"""States beside the motion that go on from segment to segment."""
_ANGLES = STATE.slice("wheel_angle_rad")
_ROAD = road_table(DRY)


@dataclass(frozen=True, eq=False)
class Replay:
    """One recording simulated: inputs (rows, INPUT.size), columns noted (rows, columns), the states at the start and
    after each segment."""

    inputs: Floats
    table: Floats
    states: tuple[Floats, ...]


def replayed(
    x: Floats, recording: Recording, parameters: ParameterSet, inputs: Floats, mask: Floats, pace: NDArray[np.int64],
    columns: NDArray[np.int64], angles: Floats | None = None, baseline: Replay | None = None,
    differs: Sequence[bool] = (),
) -> Replay:  # fmt: skip
    """Replay of a recording from the state ``x``, which changes in place.

    Parameters
    ----------
    mask : inputs that are measured.  pace : (rows,) substeps made as one.  columns : of the plant, noted at every row.
    angles : (rows, 4) of the wheels' hot spots, rad, where they matter.
    baseline : segments that do not differ are taken from it, with slow states ahead of it by what they are ahead now.
    """
    thetas, switch, y = parameters.thetas_in(recording), healthy(), OUTPUT.zeros()
    table = np.empty((len(inputs), len(columns)))
    states = [x.copy()]
    for number, segment in enumerate(recording.segments):
        rows = slice(segment.first, segment.last)
        if baseline is not None and not differs[number]:
            table[rows] = baseline.table[rows]
            ahead = x[_SLOW] - baseline.states[number][_SLOW]
            x = baseline.states[number + 1].copy()
            x[_SLOW] += ahead
            continue
        if number:
            restart_segment(x, start_speed(recording, segment, parameters))
        for part, theta in _with_theta([rows] if angles is None else row_chunks(rows), thetas):
            if angles is not None:
                x[_ANGLES] = angles[part.start]
            given = inputs[part.start : min(part.stop + 1, rows.stop)]
            simulate(
                x, given, mask, switch, parameters.p, _ROAD, ROW_S / STEPS, STEPS, pace[part], EXPONENTIAL,
                columns, table[part], y, theta, parameters.nonparametric_rows, NO_PLUGINS,
            )  # fmt: skip
        states.append(x.copy())
    return Replay(inputs, table, tuple(states))


def motor_bend(x: Floats, recording: Recording, at: ParameterSet, mask: Floats) -> Floats:
    """Torque of the simulated motors in the middle of each row, beyond the straight line to the next, (rows, 4)."""
    inputs = recording.inputs
    halves = np.repeat(inputs, 2, axis=0)
    halves[1:-1:2, U.steering_wheel_rad :] += 0.5 * np.diff(inputs[:, U.steering_wheel_rad :], axis=0)
    columns = column_indices(SOURCE["motor"])
    table = np.empty((len(halves), len(columns)))
    simulate(
        x, halves, mask, healthy(), at.p, _ROAD, ROW_S / 2, 1, np.ones(len(halves), np.int64), EXPONENTIAL,
        columns, table, OUTPUT.zeros(), at.theta_in(recording), at.nonparametric_rows, NO_PLUGINS,
    )  # fmt: skip
    torque, middle = table[::2], table[1::2]
    following = np.concatenate((torque[1:], torque[-1:]))
    return middle - 0.5 * (torque + following)


def _with_theta(parts: Iterable[slice], thetas: Sequence[tuple[int, Floats]]) -> Iterator[tuple[slice, Floats]]:
    """Parts of a recording's rows, cut where another theta begins, and theta in each."""
    ends = [row for row, _ in thetas[1:]] + [sys.maxsize]
    for part in parts:
        for (begin, theta), end in zip(thetas, ends, strict=True):
            first, last = max(part.start, begin), min(part.stop, end)
            if first < last:
                yield slice(first, last), theta
