"""Latencies on the study's arrays: channels seen later, held demands acted on later, inputs taken back in time."""

import numpy as np

from hil.diagnosis.data.dataset import ROW_S
from hil.diagnosis.data.grid import shifted, shifted_linear
from hil.diagnosis.data.log import Floats
from plant.vectors import INPUT

_MEASURED = (("pressure_pa", 1), ("motor_torque_nm", 2), ("motor_torque_bend_nm", 2))
_STEERING = INPUT.slice("steering_wheel_rad")


def delayed(values: Floats, rows: float, straight: bool = False) -> Floats:
    """Channels as seen some rows later.

    ``straight`` lines between rows for what has corners, as a motor at its rate limit; else `hil.diagnosis.data.grid`.
    """
    out = np.empty(values.shape)
    if straight:
        shifted_linear(values, 1, rows, out)
    else:
        shifted(values, rows, out)
    return out


def _held_later(values: Floats, rows: float) -> Floats:
    """Held values that change a fraction of a row later (earlier where negative), as the mean over each row."""
    change = np.diff(values, axis=0)
    moved = values.copy()
    if rows >= 0.0:
        moved[1:] -= min(rows, 1.0) * change
    else:
        moved[:-1] += min(-rows, 1.0) * change
    return moved


def without_latency(inputs: Floats, late_s: tuple[float, ...]) -> Floats:
    """Measured inputs with their nodes' latency taken back, demands when they are acted on."""
    if not any(late_s[1:5]):
        return inputs
    moved = inputs.copy()
    moved[:, _STEERING] = delayed(inputs[:, _STEERING], late_s[4] / ROW_S)
    for part in ("pressure_demand_pa", "motor_demand_nm"):
        where = INPUT.slice(part)
        moved[:, where] = _held_later(inputs[:, where], late_s[3] / ROW_S)
    for part, late in _MEASURED:
        where = INPUT.slice(part)
        moved[:, where] = delayed(inputs[:, where], -late_s[late] / ROW_S, straight=True)
    return moved
