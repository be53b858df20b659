"""How finely each row of a drive is stepped through."""

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.data.dataset import ROW_S, Recording
from plant.rolling import ROLLING_MPS
from plant.vectors import INPUT

STEPS = 4
"""Steps in a row where a torque changes quickly; elsewhere they are made as one."""
_QUICK_NM, _RINGS_ROWS = 6.0, 12
_QUICK_PA, _FOLLOWS_ROWS = 2e4, 20
_OF_NOISE = 4.0
_HARD_MPS2 = 5.0
_STANDS_MPS, _SETTLED_S = 0.05, 3.0
"""Speed below which a measured car stands, and how long after that it no longer swings."""


def rows_per_step(drive: Recording) -> NDArray[np.int64]:
    """How many steps each row of a drive makes as one.

    A motor follows a step of its demand within some 0.1 s, the pressure in 0.2 s; the tyres' limit is stiff, and so is
    a car that comes to rest (docs/decisions/simulation-speed.md), which a simulated one may do later than the measured one: the plant
    makes its steps shorter until it stands. The rest follows any step.
    """

    def changes(part: str, much: float, rows: int) -> NDArray[np.bool_]:
        values = drive.inputs[:, INPUT.slice(part)]
        apart = np.abs(np.diff(values, axis=0, append=values[-1:])).max(axis=1)
        quick = apart > max(much, _OF_NOISE * float(np.median(apart)))
        after = np.convolve(quick, np.ones(rows))[: len(quick)] > 0.5
        after[:-1] |= quick[1:]
        return np.asarray(after)

    slope = np.gradient(drive.speed_mps, drive.stride * ROW_S) if drive.samples > 1 else drive.speed_mps
    creeping = (drive.speed_mps < ROLLING_MPS) & ~_stood(drive)
    hard, creeps = (np.repeat(at, drive.stride) for at in (np.abs(slope) > _HARD_MPS2, creeping))
    quick = changes("motor_torque_nm", _QUICK_NM, _RINGS_ROWS) | changes("pressure_demand_pa", _QUICK_PA, _FOLLOWS_ROWS)
    return np.where(quick, 1, np.where(hard | creeps, STEPS // 2, STEPS))


def _stood(drive: Recording) -> NDArray[np.bool_]:
    """Whether the measured car has stood for long, or since the log began, (samples,)."""
    samples = max(round(_SETTLED_S / (drive.stride * ROW_S)), 1)
    moves = np.concatenate((np.zeros(samples), np.where(np.abs(drive.speed_mps) > _STANDS_MPS, 1.0, 0.0)))
    return np.asarray(np.convolve(moves, np.ones(samples + 1), "valid") < 0.5)
