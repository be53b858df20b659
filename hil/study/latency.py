"""Latencies on the study's arrays: channels seen later, held demands acted on later, inputs taken back in time."""

import numpy as np

from hil.study.prepare import ROW_S
from hil.study.table import Floats
from plant.vectors import INPUT


def later(values: Floats, rows: float | Floats) -> Floats:
    """Channels as seen some rows later, straight lines between rows."""
    last = len(values) - 1
    at = np.clip(np.arange(len(values))[:, None] - rows, 0.0, last) + np.zeros(values.shape)
    before = at.astype(np.intp)
    share = at - before
    column = np.arange(values.shape[1])
    return np.asarray((1.0 - share) * values[before, column] + share * values[np.minimum(before + 1, last), column])


def _held_later(values: Floats, rows: float) -> Floats:
    """Held values that change a fraction of a row later (earlier where negative), as the mean over each row."""
    change = np.diff(values, axis=0)
    moved = values.copy()
    if rows >= 0.0:
        moved[1:] -= min(rows, 1.0) * change
    else:
        moved[:-1] += min(-rows, 1.0) * change
    return moved


def in_time(inputs: Floats, late_s: tuple[float, ...]) -> Floats:
    """Measured inputs with their nodes' latency taken back, demands when they are acted on."""
    if not any(late_s[1:]):
        return inputs
    moved = inputs.copy()
    for part in ("pressure_demand_pa", "motor_demand_nm"):
        where = INPUT.slice(part)
        moved[:, where] = _held_later(inputs[:, where], late_s[3] / ROW_S)
    for part, late in (("pressure_pa", late_s[1]), ("motor_torque_nm", late_s[2])):
        where = INPUT.slice(part)
        moved[:, where] = later(inputs[:, where], -late / ROW_S)
    return moved
