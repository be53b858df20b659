"""Which signals are yaw rate, lateral acceleration and steering, with unit and sign by the wheels of left and right."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.trial.motion import filtered
from hil.diagnosis.data.units import OF_CHANNEL
from hil.diagnosis.draft.compare import Evidence, compared, half_width, left_out
from hil.diagnosis.draft.names import kinds, known_unit, quantity
from hil.diagnosis.draft.signals import Signal

_SHOWS = 0.8
"""Least size of the correlation that shows a sign and a unit."""
_NAMED = 0.3
"""Least size of the correlation at which a signal is chosen for its name among several."""
_TRACK_M, _TRACK_LOG_SD = 1.55, 0.12
"""Track of road cars: 1.2 to 2 m."""
_NEAR_S = 0.5
_LEAST_MPS = 1.0


@dataclass(frozen=True, eq=False)
class Turn:
    """One of these channels: the signal, its comparison, and what the unit and the geometry come out as."""

    signal: Signal
    evidence: Evidence | None
    unit: str
    sign: int
    known: bool
    offset: float = 0.0
    implied: float = 0.0
    others: tuple[str, ...] = ()


def yaw_by_wheels(wheels: Mapping[str, Signal], to_mps: float, axle: str) -> Floats:
    """(rows,) yaw rate times track, m/s, by an axle's wheels: right less left."""
    return filtered(to_mps * (wheels[f"{axle}r"].values - wheels[f"{axle}l"].values))


def find_yaw(signals: Mapping[str, Signal], across: Floats, moving: Floats) -> Turn | None:
    """The yaw rate; ``implied`` is the track in m."""
    tried = {
        name: one
        for name, one in signals.items()
        if quantity(one.unit) in ("", "yaw_rate") and "yaw" in kinds(name, one.unit)
    }
    best, others = _best(tried, across, moving, "the wheels' difference of right and left")
    if best is None:
        return None
    signal, seen = best
    stated = known_unit(signal.unit)
    if seen is None or abs(seen.correlation) < _SHOWS:
        return Turn(signal, seen, stated or "rad/s", 1, False, others=others)
    table = {unit: factor for unit, factor in OF_CHANNEL["yaw_rate"].items() if unit in ("rad/s", "deg/s", "mrad/s")}
    costs = {}
    for unit, factor in table.items():
        track = 1.0 / (abs(seen.ratio) * factor)
        costs[unit] = (np.log(track / _TRACK_M) / _TRACK_LOG_SD) ** 2 + (9.0 if stated and unit != stated else 0.0)
    unit = min(costs, key=lambda one: costs[one])
    track = 1.0 / (abs(seen.ratio) * table[unit])
    return Turn(signal, seen, unit, 1 if seen.ratio > 0.0 else -1, True, implied=track, others=others)


def find_lateral(signals: Mapping[str, Signal], centripetal: Floats, moving: Floats, exact: bool) -> Turn | None:
    """The lateral acceleration; ``centripetal`` (rows,) is speed times yaw rate, m/s2, its scale known if ``exact``."""
    tried = {
        name: one for name, one in signals.items() if "ay" in kinds(name, one.unit) and quantity(one.unit) in ("", "ax")
    }
    best, others = _best(tried, centripetal, moving, "speed times yaw rate")
    if best is None:
        return None
    signal, seen = best
    stated = known_unit(signal.unit)
    if seen is None or abs(seen.correlation) < _SHOWS:
        return Turn(signal, seen, stated or "m/s2", 1, False, others=others)
    within = 0.25 if exact else 0.6
    costs = {
        unit: (np.log(abs(seen.ratio) * factor) / within) ** 2 + (9.0 if stated and unit != stated else 0.0)
        for unit, factor in OF_CHANNEL["ax"].items()
        if unit in ("m/s2", "g", "mg")
    }
    unit = min(costs, key=lambda one: costs[one])
    return Turn(signal, seen, unit, 1 if seen.ratio > 0.0 else -1, True, others=others)


def find_steering(signals: Mapping[str, Signal], yaw: Floats, speed: Floats, moving: Floats) -> Turn | None:
    """The steering wheel's angle.

    ``yaw`` (rows,) rad/s and ``speed`` (rows,) m/s; ``implied`` is the wheelbase times the steering ratio, m, as rad
    or, without a unit, per unit of the signal; ``offset`` is its value straight ahead, in its own unit.
    """
    tried = {
        name: one
        for name, one in signals.items()
        if "steer" in kinds(name, one.unit)
        and quantity(one.unit) in ("", "steer")
        and not kinds(name, one.unit) & {"torque", "demand"}
    }
    curvature = np.where(np.abs(speed) > _LEAST_MPS, yaw, np.nan)
    seen_by: list[tuple[float, Signal, Evidence | None, float]] = []
    for one in tried.values():
        straight = _straight(one.values, yaw, speed, moving)
        seen = compared(
            curvature, filtered((one.values - straight) * speed), "the yaw rate (steering times speed)", moving, _NEAR_S
        )
        seen_by.append((-abs(seen.correlation) if seen else 0.0, one, seen, straight))
    if not seen_by:
        return None
    seen_by.sort(key=lambda item: item[0])
    _, signal, seen, straight = seen_by[0]
    others = tuple(one.name for _, one, *_ in seen_by[1:])
    stated = known_unit(signal.unit)
    if seen is None or abs(seen.correlation) < _SHOWS:
        return Turn(signal, seen, stated, 1, False, straight, others=others)
    factor = OF_CHANNEL["steer"].get(stated, 1.0)
    return Turn(signal, seen, stated, 1 if seen.ratio > 0.0 else -1, True, straight, abs(seen.ratio) * factor, others)


def _straight(values: Floats, yaw: Floats, speed: Floats, moving: Floats) -> float:
    """Value of a steering signal straight ahead: the intercept of its regression on the curvature; 0 within chance."""
    known = np.isfinite(yaw) & np.isfinite(values) & np.isfinite(speed) & (moving > 0.0) & (np.abs(speed) > _LEAST_MPS)
    if known.sum() < 100:
        finite = values[np.isfinite(values)]
        return float(np.median(finite)) if len(finite) else 0.0
    curvature, own = yaw[known] / speed[known], values[known]

    def intercept(keep: Floats) -> float:
        slope, at_zero = np.polyfit(curvature[keep], own[keep], 1)
        return float(at_zero) if np.isfinite(slope) else 0.0

    whole = intercept(np.ones(len(own), bool))
    half = half_width([intercept(keep) for keep in left_out(own)])
    return whole if abs(whole) > half else 0.0


def _best(
    tried: Mapping[str, Signal], reference: Floats, moving: Floats, against: str
) -> tuple[tuple[Signal, Evidence | None] | None, tuple[str, ...]]:
    """The signal that goes best with a reference, and the names of the others."""
    rated = []
    for one in tried.values():
        seen = compared(reference, filtered(one.values), against, moving, _NEAR_S)
        rated.append((-abs(seen.correlation) if seen else 0.0, one.name, one, seen))
    rated.sort(key=lambda item: item[:2])
    if not rated:
        return None, ()
    return (rated[0][2], rated[0][3]), tuple(item[1] for item in rated[1:])
