"""Which signals are the four wheel speeds, the ground speed and the longitudinal acceleration."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from hil.diagnosis.data.log import WHEELS, Floats
from hil.diagnosis.data.trial.motion import filtered, slope
from hil.diagnosis.draft.compare import Evidence, compared
from hil.diagnosis.draft.names import kinds, known_unit, quantity, wheel_of
from hil.diagnosis.draft.signals import Signal

_ALIKE, _RATIO = 0.98, 0.1
"""Least correlation of two speeds of one car, and the share by which their sizes may differ: bends, spin, radii."""
_GOES_WITH = 0.6
"""Least size of the correlation with the speed's derivative of an accelerometer."""
_NAMED = 0.8
"""Size of the correlation from which on a name decides."""
_MOVING = 0.2
"""Share of the highest speed above which a car counts as moving: slower, toothed wheels drop out."""
_CLEAR, _FILTERED_S = 0.95, 0.25
_MOST_BY_DATA = 60
"""Signals without a telling name that are tried, at most."""


@dataclass(frozen=True, eq=False)
class Speeds:
    """Wheels by name, the ground speed and accelerometers, best first; empty where none was found.

    Attributes
    ----------
    by_name : the wheels' names say which is which.
    reference : (rows,) speed that all else is compared with, in its signal's unit; ``source`` says which it is.
    accelerometers : signals with how they go with the reference's derivative.
    moving : (rows,) above 0 where the car is fast enough.
    """

    wheels: Mapping[str, Signal]
    by_name: bool
    ground: Sequence[Signal]
    accelerometers: Sequence[tuple[Signal, Evidence]]
    reference: Floats
    source: str
    moving: Floats
    front_rear: str = ""

    @property
    def telling(self) -> list[tuple[Signal, Evidence]]:
        """Two accelerometers at most whose scale can be judged: they go with the speed, and no filter lags behind."""
        clear = [
            (one, seen)
            for one, seen in self.accelerometers
            if abs(seen.correlation) > _CLEAR and abs(seen.lag_s) < _FILTERED_S
        ]
        return sorted(clear, key=lambda item: -abs(item[1].correlation))[:2]

    @property
    def derivative(self) -> Floats:
        """(rows,) derivative of the reference through the common filter."""
        return slope(self.reference)


def find_speeds(signals: Mapping[str, Signal]) -> Speeds | None:
    """The speeds among usable signals; None where there are none."""
    wheels = _wheels_by_name(signals)
    by_name = bool(wheels)
    if not wheels:
        wheels = dict(zip(WHEELS, _four_alike(signals), strict=False))
    taken = {one.name for one in wheels.values()}
    mean = _mean(list(wheels.values())) if wheels else None
    ground = _ground_speeds({name: one for name, one in signals.items() if name not in taken}, mean)
    if mean is None and not ground:
        return None
    base = mean if mean is not None else ground[0].values
    taken |= {one.name for one in ground}
    others = {name: one for name, one in signals.items() if name not in taken}
    choices = [(base, "the four wheels' mean" if wheels else ground[0].name)]
    if by_name:
        choices += [
            (_mean([wheels[f"{axle}l"], wheels[f"{axle}r"]]), f"the {word} wheels")
            for axle, word in (("f", "front"), ("r", "rear"))
        ]
    best: tuple[float, Floats, str, list[tuple[Signal, Evidence]]] | None = None
    for reference, source in choices:
        found = _accelerometers(others, reference, source)
        size = max((abs(seen.correlation) for _, seen in found), default=0.0)
        if best is None or size > best[0] + 1e-3:  # an axle that spins or locks goes less well with the car
            best = size, reference, source, found
    assert best is not None
    moving = _moving(best[1])
    return Speeds(wheels, by_name, ground, best[3], best[1], best[2], moving, _spin(wheels, by_name))


def _mean(signals: Sequence[Signal]) -> Floats:
    return np.asarray(np.mean([one.values for one in signals], axis=0))


def _moving(speed: Floats) -> Floats:
    size = np.abs(speed)
    known = size[np.isfinite(size)]
    least = _MOVING * float(np.percentile(known, 95.0)) if len(known) else 0.0
    return np.where(np.nan_to_num(size) > max(least, 1e-9), 1.0, 0.0)


def _may_be_speed(name: str, signal: Signal) -> bool:
    """Whether name and unit do not say that it is something else."""
    said = kinds(name, signal.unit)
    return quantity(signal.unit) in ("", "speed", "yaw_rate") and not said & {
        "pressure", "torque", "demand", "steer", "yaw", "ax", "ay", "az", "throttle", "pedal", "soc",
    }  # fmt: skip


def _wheels_by_name(signals: Mapping[str, Signal]) -> dict[str, Signal]:
    """Four signals whose names have the four wheels, alike otherwise; those that agree best where there are several."""
    groups: dict[tuple[str, str], dict[str, Signal]] = {}
    for name, signal in signals.items():
        wheel = wheel_of(name)
        if wheel and _may_be_speed(name, signal):
            groups.setdefault((name.rpartition(".")[0], known_unit(signal.unit)), {}).setdefault(wheel, signal)
    whole = [group for group in groups.values() if len(group) == len(WHEELS)]
    together: dict[str, Signal] = {}
    for group in groups.values():  # one message a wheel
        together = group | together
    if not whole and len(together) == len(WHEELS):
        whole = [together]
    rated = [(min(_alike(a, b) for a, b in combinations(group.values(), 2)), k) for k, group in enumerate(whole)]
    good = [(size, -k) for size, k in rated if size > 0.8]
    if not good:
        return {}
    best = whole[-max(good)[1]]
    return {wheel: best[wheel] for wheel in WHEELS}


def _alike(one: Signal, other: Signal) -> float:
    """Correlation of two signals as they stand."""
    both = np.isfinite(one.values) & np.isfinite(other.values)
    x, y = one.values[both], other.values[both]
    if len(x) < 100 or min(np.std(x), np.std(y)) <= 0.0:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])


def _four_alike(signals: Mapping[str, Signal]) -> list[Signal]:
    """Four signals that are one speed up to bends and slip, in the order of the file; empty where there are not."""
    tried = [one for name, one in signals.items() if _may_be_speed(name, one)][:_MOST_BY_DATA]
    best: list[Signal] = []
    for first in tried:
        size = float(np.nanstd(first.values))
        group = [
            one
            for one in tried
            if one is first
            or (abs(np.log(max(float(np.nanstd(one.values)), 1e-12) / size)) < _RATIO and _alike(first, one) > _ALIKE)
        ]
        if len(group) > len(best):
            best = group
    named_speed = [one for one in best if "speed" in kinds(one.name, one.unit) and not wheel_of(one.name)]
    wheels = [one for one in best if one not in named_speed or len(best) - len(named_speed) < len(WHEELS)]
    return wheels[: len(WHEELS)] if len(wheels) >= len(WHEELS) else []


def _ground_speeds(signals: Mapping[str, Signal], mean: Floats | None) -> list[Signal]:
    """Speeds of the whole car, those that go best with the wheels first."""
    found = []
    for name, one in signals.items():
        named = "speed" in kinds(name, one.unit) or quantity(one.unit) == "speed"
        if not (named and _may_be_speed(name, one)) or wheel_of(name) or quantity(one.unit) == "yaw_rate":
            continue
        size = 1.0 if mean is None else _alike(one, Signal("", "", mean, 0.0))
        if abs(size) > 0.9:
            found.append((-abs(size), name, one))
    return [one for *_, one in sorted(found, key=lambda item: item[:2])]


def _accelerometers(signals: Mapping[str, Signal], reference: Floats, source: str) -> list[tuple[Signal, Evidence]]:
    """Signals that go with the derivative of a speed, best first; by name or unit, else by data."""
    derivative, moving = slope(reference), _moving(reference)
    known, unknown = [], []
    for name, one in signals.items():
        said, of = kinds(name, one.unit), quantity(one.unit)
        if (of == "ax" and not said & {"ay", "az"}) or (not of and "ax" in said and not said & {"torque", "demand"}):
            known.append(one)
        elif not of and not said:
            unknown.append(one)
    for tried, least in ((known, _GOES_WITH), (unknown[:_MOST_BY_DATA], 0.9)):
        found = []
        for one in tried:
            seen = compared(derivative, filtered(one.values), f"the derivative of {source}", moving)
            if seen is not None and abs(seen.correlation) > least:
                found.append((one, seen))
        if found:
            return sorted(found, key=lambda item: _rank(*item))
    return []


def _rank(signal: Signal, seen: Evidence) -> tuple[bool, float, float]:
    """Order of accelerometers: a name that says so first, as what only follows the wheels may be computed from them."""
    named = "ax" in kinds(signal.name, signal.unit) and abs(seen.correlation) > _NAMED
    return not named, -round(abs(seen.correlation), 1), math.inf if math.isnan(seen.lag_s) else abs(seen.lag_s)


def _spin(wheels: Mapping[str, Signal], by_name: bool) -> str:
    """Which axle runs away from the other, in words; empty where none does."""
    if not by_name:
        return ""
    front, rear = (_mean([wheels[f"{axle}l"], wheels[f"{axle}r"]]) for axle in "fr")
    moving = _moving(front) > 0.0
    share = (rear[moving] - front[moving]) / np.abs(front[moving])
    high, low = (float(np.nanpercentile(share, q)) for q in (99.5, 0.5))
    if high > 0.08:
        return (
            f"the rear wheels run up to {100.0 * high:.0f} % faster than the front: they are driven, or the front locks"
        )
    if low < -0.08:
        return (
            f"the rear wheels run up to {-100.0 * low:.0f} % slower than the front: they lock, or the front is driven"
        )
    return ""
