"""Units of wheel speeds, ground speed and accelerometers, chosen together: each ratio of two of them must be one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from hil.diagnosis.data.units import OF_CHANNEL

_ROAD: Mapping[str, float] = {
    "m/s": 0.0, "km/h": 0.0, "mph": 1.5, "knots": 4.0, "rad/s": 0.5, "rpm": 0.5, "rev/s": 3.0, "deg/s": 3.0,
}  # fmt: skip
_ACCELERATION: Mapping[str, float] = {"m/s2": 0.0, "g": 0.5, "mg": 4.0}
"""Unit -> how unusual it is, as -2 log of its share."""
_STATED = 9.0
"""Cost of a unit other than the stated one: one file in a hundred states a wrong one (a rare value of the normal
distribution, three standard deviations)."""
_RADIUS_M = (0.26, 0.40)
_RADIUS_LOG_SD = 0.07
"""Rolling radii of road cars, and how fast they become rare beyond."""
_SPEED_SD = 0.02
"""A ground speed beside the wheels: speedometers show up to 2 % more than the wheels (RAV4), worn tyres less."""
_DIVE, _ACCELERATION_SD = 0.03, 0.04
"""An accelerometer on a body that dives and squats shows 1 to 7 % more (1 to 4 degrees a g); plus its own scale."""
_FASTEST_MPS, _HARDEST_MPS2 = (6.0, 70.0), (0.8, 12.0)
"""Highest speed and largest acceleration of a log, within which nothing is said about a unit."""
_RANGE_LOG_SD = 0.3
TELLING = 6.0
"""Cost by which a choice must be better than another one to rule it out: 20 to 1."""


@dataclass(frozen=True)
class Scales:
    """What was measured, in the units of the signals.

    Attributes
    ----------
    wheel, ground, accelerations : stated units, empty where none is stated; ``wheel`` is None without wheel speeds.
    ground_per_wheel : ratio of the speeds; None where there are not both.
    per_derivative : of each accelerometer, its size over that of the derivative of ``wheel`` (else of ``ground``).
    fastest : 99th percentile of the wheel speed (else of the ground speed).  hardest : of its derivative.
    """

    wheel: str | None
    ground: str | None
    accelerations: tuple[str, ...]
    ground_per_wheel: float | None
    per_derivative: tuple[float, ...]
    fastest: float
    hardest: float


@dataclass(frozen=True)
class UnitChoice:
    """Units that fit together; ``radius_m`` is what the wheels' unit takes, None where a speed of the road needs none.

    ``cost`` is -2 log likelihood, up to a constant.
    """

    wheel: str | None
    ground: str | None
    accelerations: tuple[str, ...]
    radius_m: float | None
    cost: float

    @property
    def wheel_to_mps(self) -> float:
        """Factor from the wheels' values (else the ground's) to m/s."""
        if self.wheel is None:
            return OF_CHANNEL["speed"][self.ground or "m/s"]
        if self.wheel in OF_CHANNEL["speed"]:
            return OF_CHANNEL["speed"][self.wheel]
        return OF_CHANNEL["wheel_speed"][self.wheel] * (self.radius_m or float(np.mean(_RADIUS_M)))

    @property
    def text(self) -> str:
        """In words."""
        parts = [f"wheel speeds in {self.wheel}"] if self.wheel else []
        if self.wheel and self.radius_m is not None:
            parts[0] += f" at a rolling radius of {self.radius_m:.3f} m"
        parts += [f"the ground speed in {self.ground}"] if self.ground else []
        parts += [f"accelerations in {' and '.join(dict.fromkeys(self.accelerations))}"] if self.accelerations else []
        return ", ".join(parts)


def unit_choices(seen: Scales) -> list[UnitChoice]:
    """All choices of units with their costs, best first."""
    wheels: Sequence[str | None] = list(_ROAD) if seen.wheel is not None else [None]
    grounds: Sequence[str | None] = list(OF_CHANNEL["speed"]) if seen.ground is not None else [None]
    grounds = [unit for unit in grounds if unit in _ROAD or unit is None]
    found = []
    for wheel, ground in product(wheels, grounds):
        for units in product(*([_ACCELERATION] * len(seen.accelerations))):
            found.append(_choice(seen, wheel, ground, units))
    return sorted(found, key=lambda one: one.cost)


def _choice(seen: Scales, wheel: str | None, ground: str | None, units: tuple[str, ...]) -> UnitChoice:
    turning = wheel is not None and wheel not in OF_CHANNEL["speed"]
    ground_si = 1.0 if ground is None else OF_CHANNEL["speed"][ground]
    wheel_si = ground_si if wheel is None else (OF_CHANNEL["wheel_speed"] if turning else OF_CHANNEL["speed"])[wheel]
    cost = _unusual(wheel, seen.wheel, _ROAD) + _unusual(ground, seen.ground, _ROAD)
    logs, weights = [], []  # each measurement of log(true speed per wheel reading x unit): log radius where it turns
    if seen.ground_per_wheel is not None:
        logs.append(np.log(seen.ground_per_wheel * ground_si / wheel_si))
        weights.append(_SPEED_SD**-2.0)
    for unit, stated, ratio in zip(units, seen.accelerations, seen.per_derivative, strict=True):
        cost += _unusual(unit, stated, _ACCELERATION)
        logs.append(np.log(ratio * OF_CHANNEL["ax"][unit] / wheel_si) - _DIVE)
        weights.append(_ACCELERATION_SD**-2.0)
    radius = None
    centre = 0.0
    if turning:
        low, high = np.log(_RADIUS_M)
        if logs:
            centre = float(np.average(logs, weights=weights))
            radius = float(np.exp(centre))
            cost += (max(low - centre, centre - high, 0.0) / _RADIUS_LOG_SD) ** 2
        else:
            centre = 0.5 * float(low + high)
    cost += float(sum(weight * (value - centre) ** 2 for value, weight in zip(logs, weights, strict=True)))
    to_mps = wheel_si * float(np.exp(centre))
    cost += _outside(seen.fastest * to_mps, _FASTEST_MPS) + _outside(seen.hardest * to_mps, _HARDEST_MPS2)
    return UnitChoice(wheel, ground, units, radius, cost)


def _unusual(unit: str | None, stated: str | None, table: Mapping[str, float]) -> float:
    if unit is None:
        return 0.0
    if stated:
        return 0.0 if unit == stated else _STATED + table[unit]
    return table[unit]


def _outside(value: float, limits: tuple[float, float]) -> float:
    low, high = np.log(limits)
    size = float(np.log(max(value, 1e-9)))
    return float((max(low - size, size - high, 0.0) / _RANGE_LOG_SD) ** 2)
