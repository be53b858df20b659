"""The stops in logs, each with its figures: mean fully developed deceleration, distance, pressure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.braking import LOWER, UPPER, crossings, distance, mean_fully_developed_deceleration
from hil.diagnosis.data.log import PRESSURE, PRESSURE_DEMAND, WHEEL_SPEED, Floats, Log
from hil.report.report import Cell, Section, Table

_GRID_S = 0.01
_BRAKED_MPS2, _LASTS_S = 1.0, 0.4
"""Deceleration that only brakes make (engine and drag stay below at the speeds of a car), and the time it lasts."""
_ONSET_MPS2, _ONSET_PA, _BEFORE_S = 0.5, 1e5, 1.0
"""Deceleration, and pressure, at which braking begins; and how long before the deceleration a pressure may rise."""
_JOINED_S = 0.5  # a release this short is within one stop
_SLOPE_S, _START_S = 0.2, 0.2
"""Window of the slope of the speed, and time before the onset whose speeds give v0."""
_AHEAD_S = 0.06
"""By how much such a slope of a sudden braking passes the onset's deceleration before its time."""
_LEAST_V0_MPS = 15.0 / 3.6
"""Slower stops tell nothing: the lower speed would be within what toothed wheels see."""


@dataclass(frozen=True)
class Stop:
    """One braking to a tenth of its speed or less.

    Attributes
    ----------
    log : name.  begin_s : time of the log at which braking begins.
    duration_s, distance_m : from there to standstill; None where the log ends before.
    v0_mps : speed at the beginning.  mfdd_mps2 : mean fully developed deceleration (UN R13-H, annex 3).
    peak_mps2 : largest deceleration, mean of 0.2 s.
    pressure_pa, peak_pressure_pa : mean over the wheels while the deceleration is fully developed, and largest of any
        wheel in the stop; None without pressures.
    speed : ``ground``, or ``wheels`` (median wheel at the rolling radius: too small by the slip).
    """

    log: str
    begin_s: float
    duration_s: float | None
    v0_mps: float
    mfdd_mps2: float
    distance_m: float | None
    pressure_pa: float | None
    peak_pressure_pa: float | None
    peak_mps2: float
    speed: str

    def as_json(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "log": self.log, "t_s": self.begin_s, "duration_s": self.duration_s, "v0_mps": self.v0_mps,
            "mfdd_mps2": self.mfdd_mps2, "distance_m": self.distance_m, "mean_pressure_pa": self.pressure_pa,
            "peak_pressure_pa": self.peak_pressure_pa, "peak_deceleration_mps2": self.peak_mps2, "speed": self.speed,
        }  # fmt: skip


def speed_of(log: Log, radius_m: float) -> tuple[Floats, str]:
    """Speed, (samples,), m/s, and where it is from: over ground, or the median of all wheels; NaN where unknown."""
    ground = log.channels.get("speed_mps")
    if ground is not None and np.isfinite(ground).any():
        return np.asarray(ground, np.float64), "ground"
    wheels = [log.channels[name] for name in WHEEL_SPEED if name in log.channels]
    if not wheels:
        return np.full(len(log.t_s), np.nan), "none"
    values = np.array(wheels, np.float64)
    known = np.isfinite(values).any(axis=0)
    speed = np.full(len(log.t_s), np.nan)
    speed[known] = radius_m * np.nanmedian(values[:, known], axis=0)
    return speed, "wheels"


def stops_of(logs: Sequence[Log], radius_m: float) -> list[Stop]:
    """All stops: brakings from 15 km/h or more to a tenth of the speed; ``radius_m`` is the rolling radius."""
    return [stop for log in logs for stop in _stops(log, radius_m)]


def _stops(log: Log, radius_m: float) -> list[Stop]:
    raw, source = speed_of(log, radius_m)
    good = np.isfinite(raw)
    if good.sum() < 3:
        return []
    t_s, raw = np.asarray(log.t_s[good], np.float64), np.abs(raw[good])
    grid_s = np.arange(t_s[0], t_s[-1], _GRID_S)
    speed, slope = _line(np.interp(grid_s, t_s, raw), grid_s)
    pressures = [names for names in (PRESSURE, PRESSURE_DEMAND) if log.has(*names)]
    pressure = None
    if pressures:
        columns = [np.nan_to_num(np.asarray(log.channels[name], np.float64)) for name in pressures[0]]
        pressure = np.column_stack([np.interp(grid_s, log.t_s, column) for column in columns])
    found = []
    for first, last in _braked(slope, speed):
        stop = _figures(log.name, source, grid_s, speed, slope, pressure, first, last)
        if stop is not None:
            found.append(stop)
    return found


def _line(values: Floats, grid_s: Floats) -> tuple[Floats, Floats]:
    """Value and slope of the straight line through 0.2 s around each row; narrower at the ends of the log."""
    half, count = round(0.5 * _SLOPE_S / _GRID_S), len(values)
    at = np.arange(count)
    low, high = np.maximum(at - half, 0), np.minimum(at + half, count - 1)
    size = (high - low + 1).astype(np.float64)
    sums = [np.concatenate(([0.0], np.cumsum(column))) for column in (grid_s, values, grid_s**2, grid_s * values)]
    t, v, tt, tv = (total[high + 1] - total[low] for total in sums)
    spread = size * tt - t * t
    slope = np.where(spread > 1e-9, (size * tv - t * v) / np.where(spread > 1e-9, spread, 1.0), 0.0)
    return (v + slope * (size * grid_s - t)) / size, slope


def _braked(slope: Floats, speed: Floats) -> list[tuple[int, int]]:
    """First and last row of each braking that lasts; one ends where the car stands or rolls on."""
    on = (slope < -_BRAKED_MPS2).astype(np.int64)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], on, [0]))))
    joined: list[list[int]] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        # a car that has stood between two brakings made two stops
        near = joined and (first - joined[-1][1]) * _GRID_S < _JOINED_S and speed[joined[-1][1] - 1 : first].min() > 0.5
        if near:
            joined[-1][1] = end
        else:
            joined.append([first, end])
    return [(first, end - 1) for first, end in joined if (end - first) * _GRID_S > _LASTS_S]


def _figures(
    name: str, source: str, t_s: Floats, speed: Floats, slope: Floats, pressure: Floats | None, first: int, last: int
) -> Stop | None:  # fmt: skip
    begin = _onset(t_s, slope, pressure, first)
    before = slice(max(begin - round(_START_S / _GRID_S), 0), begin + 1)
    v0 = float(speed[begin]) if begin == 0 else float(np.median(speed[before]))
    end = min(last + round(1.0 / _GRID_S), len(t_s))
    own_t, own = t_s[:end], speed[:end]
    levels = crossings(own_t, own, float(t_s[begin]), (UPPER * v0, LOWER * v0))
    if v0 < _LEAST_V0_MPS or levels is None:
        return None
    upper, lower = (distance(own_t, own, float(t_s[begin]), time_s) for time_s in levels)
    still = np.flatnonzero(own[begin:] < max(0.01 * v0, 0.1))
    stands_s = float(t_s[begin + still[0]]) if len(still) else None
    mean = peak = None
    if pressure is not None:
        developed = (t_s >= levels[0]) & (t_s <= levels[1])
        mean, peak = float(pressure[developed].mean()), float(pressure[begin : last + 1].max())
    return Stop(
        name, float(t_s[begin]), None if stands_s is None else stands_s - float(t_s[begin]), v0,
        mean_fully_developed_deceleration(v0, upper, lower),
        None if stands_s is None else distance(own_t, own, float(t_s[begin]), stands_s), mean, peak,
        float(-slope[begin : last + 1].min()), source,
    )  # fmt: skip


def _onset(t_s: Floats, slope: Floats, pressure: Floats | None, first: int) -> int:
    """Row at which braking begins: the pressure rises, else the deceleration does."""
    begin = first
    while begin > 0 and slope[begin - 1] < -_ONSET_MPS2:
        begin -= 1
    begin = min(begin + round(_AHEAD_S / _GRID_S), len(slope) - 1)
    if pressure is None:
        return begin
    since, first = max(begin - round(_BEFORE_S / _GRID_S), 0), first + round(0.5 * _SLOPE_S / _GRID_S)
    applied = pressure[since : first + 1].max(axis=1) > _ONSET_PA
    released = np.flatnonzero(~applied)
    rises = since + int(released[-1]) + 1 if len(released) else since
    return rises if applied.any() and len(released) and rises <= first else begin


def section(stops: Sequence[dict[str, Any]]) -> tuple[Section, ...]:
    """The stops of an answer as a section of its report; none without stops."""
    if not stops:
        return ()

    def shown(value: float | None, factor: float = 1.0, digits: int = 2) -> Cell:
        return None if value is None else round(value * factor, digits)

    rows = tuple(
        (
            one["log"], shown(one["t_s"]), shown(one["v0_mps"], 3.6, 1), shown(one["mfdd_mps2"]),
            shown(one["distance_m"]), shown(one["mean_pressure_pa"], 1e-5, 1), shown(one["peak_pressure_pa"], 1e-5, 1),
            shown(one["peak_deceleration_mps2"]), one["speed"],
        )
        for one in stops
    )  # fmt: skip
    head = ("log", "t s", "v0 km/h", "MFDD m/s²", "distance m", "mean bar", "peak bar", "peak m/s²", "speed from")
    note = "MFDD: mean fully developed deceleration from 0.8 to 0.1 of v0 (UN R13-H, annex 3); distance to standstill."
    return (Section("Stops", tables=(Table("Stops", head, rows, note=note),)),)
