"""Step lengths: takes a recording, gives the substeps that each of its rows makes as one."""

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.data.dataset import ROW_S, Recording
from plant.rolling import ROLLING_MPS
from plant.vectors import INPUT

STEPS = 4
"""Substeps of a row where a torque changes quickly; elsewhere they are made as one."""
_QUICK_NM, _STEPS_ROWS, _RINGS_ROWS = 6.0, 2, 12
_QUICK_PA, _WAITS_ROWS, _FOLLOWS_ROWS = 2e4, 12, 20
"""Change in a row (N m, Pa) that makes a motor's torque or a pressure step; rows within which the step itself happens,
that of a pressure after its dead time; rows until what swings or follows has come to rest."""
_OF_NOISE = 4.0
_HARD_MPS2 = 5.0
_STANDS_MPS, _SETTLED_S = 0.05, 3.0
"""Speed below which a measured car stands, and how long after that it no longer swings."""


def rows_per_step(recording: Recording) -> NDArray[np.int64]:
    """How many substeps each row makes as one, (rows,).

    A motor follows a step of its demand within some 0.1 s, the pressure in 0.2 s; what swings after the step itself is
    exact in twice as long a step (`plant.rolling`). The tyres' limit is stiff, and so is a car that comes to rest which
    a simulated one may do later than the measured one: the plant makes its steps shorter until it stands. The rest
    follows any step.
    """

    def changes(part: str, least: float, *rows: int) -> list[NDArray[np.bool_]]:
        values = recording.inputs[:, INPUT.slice(part)]
        change = np.abs(np.diff(values, axis=0, append=values[-1:])).max(axis=1)
        quick = change > max(least, _OF_NOISE * float(np.median(change)))
        found = [np.convolve(quick, np.ones(count))[: len(quick)] > 0.5 for count in rows]
        for after in found:
            after[:-1] |= quick[1:]
        return found

    slope = np.gradient(recording.speed_mps, recording.stride * ROW_S) if recording.samples > 1 else recording.speed_mps
    creeping = (recording.speed_mps < ROLLING_MPS) & ~_stood(recording)
    hard, creeps = (np.repeat(at, recording.stride) for at in (np.abs(slope) > _HARD_MPS2, creeping))
    steps, rings = changes("motor_torque_nm", _QUICK_NM, _STEPS_ROWS, _RINGS_ROWS)
    waits, follows = changes("pressure_demand_pa", _QUICK_PA, _WAITS_ROWS, _FOLLOWS_ROWS)
    return np.where(steps | waits, 1, np.where(rings | follows | hard | creeps, STEPS // 2, STEPS))


def _stood(recording: Recording) -> NDArray[np.bool_]:
    """Samples at which the measured car has stood for `_SETTLED_S`, or since the log began, (samples,)."""
    samples = max(round(_SETTLED_S / (recording.stride * ROW_S)), 1)
    moves = np.concatenate((np.zeros(samples), np.where(np.abs(recording.speed_mps) > _STANDS_MPS, 1.0, 0.0)))
    return np.asarray(np.convolve(moves, np.ones(samples + 1), "valid") < 0.5)
