"""Latencies on the study's arrays: channels seen later, held demands acted on later, inputs taken back in time."""

import numpy as np

from hil.study.compiled import compiled
from hil.study.prepare import ROW_S
from hil.study.table import Floats
from plant.vectors import INPUT


def later(values: Floats, rows: float | Floats) -> Floats:
    """Channels as seen some rows later, straight lines between rows; ``rows`` for all, or for each value."""
    out = np.empty_like(values)
    _later(values, np.broadcast_to(np.asarray(rows, np.float64), values.shape), out)
    return out


@compiled
def _later(values: Floats, rows: Floats, out: Floats) -> None:
    last = values.shape[0] - 1
    for t in range(values.shape[0]):
        for k in range(values.shape[1]):
            at = min(max(t - rows[t, k], 0.0), float(last))
            before = int(at)
            first = values[before, k]
            out[t, k] = first + (at - before) * (values[min(before + 1, last), k] - first)


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
