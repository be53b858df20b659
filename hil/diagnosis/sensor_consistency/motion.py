"""The car's motion as its channels have it: cell means of all logs on one clock, cut into manoeuvres."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import PRESSURE, PRESSURE_DEMAND, WHEEL_SPEED, Floats, Log, UnusableError

CELL_S = 0.04
SLOW_MPS = 3.0  # below, wheel-speed sensors hold and drop
MANOEUVRE_S = (6.0, 12.0)
_GAP_S = 0.25
_SMOOTH_S = 0.4


@dataclass(frozen=True, eq=False)
class Motion:
    """All logs, one after the other, in cells of ``cell_s``.

    Attributes
    ----------
    t_s : (cells,) time in the log.  fresh : 1 where a log begins.  log : number of the log.
    channels : name -> (cells,) mean over the cell, NaN where nothing was measured; wheel speeds in m/s at the rolling
        radius, under ``wheel_fl`` and so on; pressure and pressure_demand are means over the wheels.
    speed_mps : the median wheel's speed (the ground speed where there are no wheels).
    accel_mps2 : its slope over 0.4 s, centred, for starts and pictures; no fit's truth.
    moving : 1 where the car is fast enough to compare.
    block : number of the manoeuvre.  radius_m : rolling radius used.
    """

    logs: tuple[Log, ...]
    cell_s: float
    t_s: Floats
    fresh: Floats
    log: Floats
    channels: dict[str, Floats]
    speed_mps: Floats
    accel_mps2: Floats
    moving: Floats
    block: Floats
    radius_m: float

    def has(self, *names: str) -> bool:
        """Whether all these channels are there."""
        return all(name in self.channels for name in names)

    def known(self, name: str) -> Floats:
        """1 where a channel is measured while the car moves."""
        return np.isfinite(self.channels[name]) * self.moving

    def later(self, name: str, cells: int) -> Floats:
        """A channel as it will be ``cells`` cells later; NaN beyond the ends of the log."""
        values = self.channels[name]
        at = np.arange(len(values)) + cells
        inside = np.clip(at, 0, len(values) - 1)
        return np.where((at == inside) & (self.log[inside] == self.log), values[inside], np.nan)

    @property
    def blocks(self) -> int:
        """How many manoeuvres there are."""
        return int(self.block.max()) + 1


def motion_of(logs: Sequence[Log], radius_m: float) -> Motion:
    """Cell means of all logs.

    Raises
    ------
    UnusableError
        Nothing says how the car moved, or it hardly moves.
    """
    there = set.intersection(*(set(log.channels) for log in logs))
    if not (set(WHEEL_SPEED) <= there or "speed_mps" in there):
        raise UnusableError("neither all wheel speeds nor a speed in every log; nothing says how the car moved")
    step = max(float(np.median(np.diff(log.t_s))) for log in logs)
    cell = CELL_S if step <= 1.05 * CELL_S else step
    parts = [_cells(log, there, cell, radius_m) for log in logs]
    t_s = np.concatenate([t for t, _ in parts])
    channels = {name: np.concatenate([c[name] for _, c in parts]) for name in parts[0][1]}
    number = np.concatenate([np.full(len(t), k) for k, (t, _) in enumerate(parts)])
    fresh = np.concatenate([np.eye(1, len(t))[0] for t, _ in parts])
    wheels = [channels[f"wheel_{w}"] for w in ("fl", "fr", "rl", "rr") if f"wheel_{w}" in channels]
    speed = _filled(np.median(wheels, axis=0) if wheels else channels["speed_mps"])
    accel = slope_of(speed, number, cell)
    near = round(0.5 / cell)
    slow = np.convolve(speed < SLOW_MPS, np.ones(2 * near + 1), mode="same") > 0.5
    if (~slow).sum() * cell < 4.0:
        raise UnusableError(
            f"the car moves for {(~slow).sum() * cell:.1f} s in all; expected 4 s or more above {SLOW_MPS:g} m/s"
        )
    block = _blocks(number, accel, cell)
    return Motion(tuple(logs), cell, t_s, fresh, number, channels, speed, accel, 1.0 * ~slow, block, radius_m)


def _cells(log: Log, there: set[str], cell: float, radius_m: float) -> tuple[Floats, dict[str, Floats]]:
    begin = float(log.t_s[0])
    count = int((float(log.t_s[-1]) - begin) / cell + 0.5)
    at = np.clip(((log.t_s - begin) / cell + 1e-6).astype(np.int64), 0, count - 1)
    found = {name: _mean(log.channels[name], at, count) for name in sorted(there)}
    for name in WHEEL_SPEED:
        if name in found:
            found[f"wheel_{name.split('_')[2]}"] = found.pop(name) * radius_m
    for stem, names in (("pressure", PRESSURE), ("pressure_demand", PRESSURE_DEMAND)):
        if set(names) <= there:
            found[stem] = np.mean([found.pop(name) for name in names], axis=0)
    return (np.arange(count) + 0.5) * cell, found


def _mean(values: Floats, at: Floats, count: int) -> Floats:
    good = np.isfinite(values)
    weight = np.bincount(at[good], minlength=count)[:count]
    total = np.bincount(at[good], values[good], minlength=count)[:count]
    return np.where(weight > 0, total / np.maximum(weight, 1), np.nan)


def _filled(values: Floats) -> Floats:
    good = np.isfinite(values)
    return np.interp(np.arange(len(values)), np.flatnonzero(good), values[good])


def slope_of(speed: Floats, log: Floats, cell: float) -> Floats:
    """Slope of every log's speed."""
    return np.concatenate([_slope(speed[log == k], cell) for k in range(int(log.max()) + 1)])


def _slope(speed: Floats, cell: float) -> Floats:
    """Least-squares slope over a centred window; the same weights for every place where it is whole."""
    half = max(round(0.5 * _SMOOTH_S / cell), 1)
    x = np.arange(-half, half + 1)
    padded = np.concatenate((np.repeat(speed[:1], half), speed, np.repeat(speed[-1:], half)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    return np.asarray(windows @ x / (float(x @ x) * cell))


def _blocks(number: Floats, accel: Floats, cell: float) -> Floats:
    """Manoeuvres: cut where the acceleration passes zero after 6 s, at 12 s at the latest."""
    block, since, begun = np.zeros(len(number), np.int64), 0.0, 0
    for k in range(1, len(number)):
        since += cell
        quiet = accel[k - 1] * accel[k] <= 0.0
        if number[k] != number[k - 1] or (since > MANOEUVRE_S[0] and quiet) or since > MANOEUVRE_S[1]:
            begun, since = begun + 1, 0.0
        block[k] = begun
    return block
