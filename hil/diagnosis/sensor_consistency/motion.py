"""The car's motion from its own channels: cell means of all logs on one clock, cut into segments (manoeuvres)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.hints import nothing_shows_speed
from hil.diagnosis.data.log import PRESSURE, PRESSURE_DEMAND, WHEEL_SPEED, Floats, Log, UnusableError

CELL_S = 0.04
SLOW_MPS = 3.0
"""Speed below which wheel-speed sensors hold their value and drop to zero."""
SEGMENT_S = (6.0, 12.0)
"""A segment ends where the acceleration passes zero after the first time, and at the second at the latest."""
_SLOPE_WINDOW_S = 0.4
_RUNS_AWAY, _RUNS_AWAY_S = 1.08, 0.5
"""Ratio of two axles' speeds from which on one spins or locks, and how long it does so in all: no bend and no radius
makes 8 %, and tyres grip best at about as much slip."""


@dataclass(frozen=True, eq=False)
class Motion:
    """All logs, one after the other, in cells of ``cell_s``.

    Attributes
    ----------
    t_s : (cells,) time in the log.
    log_start : (cells,) 1 in the first cell of a log.
    log_id : (cells,) number of the log.
    channels : name -> (cells,) mean over the cell, NaN where nothing was measured; wheel speeds in m/s at the rolling
        radius, under ``wheel_fl`` and so on; ``pressure`` and ``pressure_demand`` are means over the wheels.
    speed_mps : (cells,) the median wheel's speed, or that of the axle that rolls where the other one spins or locks
        (`rolling_axle`); the ground speed where there are no wheels.
    accel_mps2 : (cells,) its slope over 0.4 s, centred, for start values and charts; no fit relies on it.
    moving : (cells,) 1 where the car is fast enough to compare.
    segment_id : (cells,) number of the segment.
    rolling : ``front`` or ``rear`` where the other axle runs away; empty where none does.
    """

    logs: tuple[Log, ...]
    cell_s: float
    t_s: Floats
    log_start: Floats
    log_id: Floats
    channels: dict[str, Floats]
    speed_mps: Floats
    accel_mps2: Floats
    moving: Floats
    segment_id: Floats
    rolling: str = ""

    def has(self, *names: str) -> bool:
        """Whether all these channels were measured."""
        return all(name in self.channels for name in names)

    def advanced(self, name: str, cells: int) -> Floats:
        """A channel moved ``cells`` cells to the front; NaN beyond the ends of a log."""
        values = self.channels[name]
        at = np.arange(len(values)) + cells
        inside = np.clip(at, 0, len(values) - 1)
        return np.where((at == inside) & (self.log_id[inside] == self.log_id), values[inside], np.nan)

    def delayed(self, values: Floats, delay_s: float) -> Floats:
        """(cells,) values ``delay_s`` later, interpolated in each log, constant beyond its ends."""
        delayed = np.empty_like(values)
        for k in range(len(self.logs)):
            rows = self.log_id == k
            delayed[rows] = np.interp(self.t_s[rows] - delay_s, self.t_s[rows], values[rows])
        return delayed

    @property
    def segments(self) -> int:
        """Number of segments."""
        return int(self.segment_id.max()) + 1


def measured_channels(logs: Sequence[Log]) -> set[str]:
    """Channels that every log has."""
    return set.intersection(*(set(log.channels) for log in logs))


def motion_of(logs: Sequence[Log], radius_m: float) -> Motion:
    """Cell means of all logs; ``radius_m`` is the rolling radius.

    Raises
    ------
    UnusableError
        No channel shows the speed, or the car moves for less than 4 s.
    """
    measured = measured_channels(logs)
    if not (set(WHEEL_SPEED) <= measured or "speed_mps" in measured):
        raise UnusableError(nothing_shows_speed(logs))
    step = max(float(np.median(np.diff(log.t_s))) for log in logs)
    cell_s = CELL_S if step <= 1.05 * CELL_S else step
    parts = [_cell_means(log, measured, cell_s, radius_m) for log in logs]
    t_s = np.concatenate([t for t, _ in parts])
    channels = {name: np.concatenate([c[name] for _, c in parts]) for name in parts[0][1]}
    log_id = np.concatenate([np.full(len(t), k) for k, (t, _) in enumerate(parts)])
    log_start = np.concatenate([np.eye(1, len(t))[0] for t, _ in parts])
    wheels = [channels[f"wheel_{w}"] for w in ("fl", "fr", "rl", "rr") if f"wheel_{w}" in channels]
    rolling = rolling_axle(np.array(wheels), log_id, cell_s) if len(wheels) == 4 else ""
    rolls = {"": wheels, "front": wheels[:2], "rear": wheels[2:]}[rolling]
    speed = _without_gaps(np.median(rolls, axis=0) if wheels else channels["speed_mps"])
    accel = slope_of(speed, log_id, cell_s)
    margin = round(0.5 / cell_s)
    slow = np.convolve(speed < SLOW_MPS, np.ones(2 * margin + 1))[margin : margin + len(speed)] > 0.5
    moving_s = (~slow).sum() * cell_s
    if round(moving_s, 1) < 4.0:
        raise UnusableError(
            f"the car moves for {moving_s:.1f} s in all; expected 4 s or more above {SLOW_MPS:g} m/s; add logs of more "
            "such manoeuvres, or longer ones"
        )
    segment_id = _segment_id(log_id, accel, cell_s)
    return Motion(tuple(logs), cell_s, t_s, log_start, log_id, channels, speed, accel, 1.0 * ~slow, segment_id, rolling)


def rolling_axle(wheels: Floats, log_id: Floats, cell_s: float) -> str:
    """``front`` or ``rear`` where the other axle spins in acceleration or locks in braking; empty where neither does.

    ``wheels`` (4, cells), m/s. The median of four wheels of which two spin is no speed of the car.
    """
    front, rear = wheels[:2].mean(axis=0), wheels[2:].mean(axis=0)
    accel = slope_of(_without_gaps(np.median(wheels, axis=0)), log_id, cell_s)
    fast = np.minimum(front, rear) > SLOW_MPS
    spins_s = {
        axle: float((fast & np.where(accel > 0.0, own > _RUNS_AWAY * other, _RUNS_AWAY * own < other)).sum()) * cell_s
        for axle, own, other in (("rear", rear, front), ("front", front, rear))
    }
    worst = max(spins_s, key=lambda axle: spins_s[axle])
    if spins_s[worst] < _RUNS_AWAY_S or spins_s[worst] < 2.0 * min(spins_s.values()):
        return ""
    return "front" if worst == "rear" else "rear"


def _cell_means(log: Log, names: set[str], cell_s: float, radius_m: float) -> tuple[Floats, dict[str, Floats]]:
    """Times and channels of one log."""
    origin_s = float(log.t_s[0])
    count = int((float(log.t_s[-1]) - origin_s) / cell_s + 0.5)
    at = np.clip(((log.t_s - origin_s) / cell_s + 1e-6).astype(np.int64), 0, count - 1)
    means = {name: _mean(log.channels[name], at, count) for name in sorted(names)}
    for name in WHEEL_SPEED:
        if name in means:
            means[f"wheel_{name.split('_')[2]}"] = means.pop(name) * radius_m
    for mean, members in (("pressure", PRESSURE), ("pressure_demand", PRESSURE_DEMAND)):
        if set(members) <= names:
            means[mean] = np.mean([means.pop(name) for name in members], axis=0)
    return (np.arange(count) + 0.5) * cell_s, means


def _mean(values: Floats, at: Floats, count: int) -> Floats:
    good = np.isfinite(values)
    weight = np.bincount(at[good], minlength=count)[:count]
    total = np.bincount(at[good], values[good], minlength=count)[:count]
    return np.where(weight > 0, total / np.maximum(weight, 1), np.nan)


def _without_gaps(values: Floats) -> Floats:
    good = np.isfinite(values)
    return np.interp(np.arange(len(values)), np.flatnonzero(good), values[good])


def slope_of(speed: Floats, log_id: Floats, cell_s: float) -> Floats:
    """(cells,) slope of the speed in each log, m/s2: least squares over a centred window of 0.4 s."""
    return np.concatenate([_slope(speed[log_id == k], cell_s) for k in range(int(log_id.max()) + 1)])


def _slope(speed: Floats, cell_s: float) -> Floats:
    half = max(round(0.5 * _SLOPE_WINDOW_S / cell_s), 1)
    x = np.arange(-half, half + 1)
    padded = np.concatenate((np.repeat(speed[:1], half), speed, np.repeat(speed[-1:], half)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    return np.asarray(windows @ x / (float(x @ x) * cell_s))


def _segment_id(log_id: Floats, accel: Floats, cell_s: float) -> Floats:
    """Cut at `SEGMENT_S` and at every start of a log."""
    segment_id, since_s, current = np.zeros(len(log_id), np.int64), 0.0, 0
    for k in range(1, len(log_id)):
        since_s += cell_s
        passes_zero = accel[k - 1] * accel[k] <= 0.0
        new_log = log_id[k] != log_id[k - 1]
        if new_log or (since_s > SEGMENT_S[0] and passes_zero) or since_s > SEGMENT_S[1]:
            current, since_s = current + 1, 0.0
        segment_id[k] = current
    return segment_id
