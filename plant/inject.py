"""Where the injection points lie for compiled code: behind the outputs, first the factors of a point, then its addends.

The neutral addend is -0.0, the only number that changes nothing when it is added, not even the sign of zero.
"""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from typing import Any

import numpy as np

from plant.compiled import EFFECTS, unfused
from plant.injection_points import FIELDS, INJECTION_POINTS, field
from plant.layout import Layout, Vector
from plant.vectors import OUTPUTS

_BEHIND = Layout("InjectionPoint", {"outputs": sum(OUTPUTS.values())} | FIELDS)
J: Any = _BEHIND.at
"""First factor of each injection point in ``y``; its addends follow the factors."""
FIRST = sum(OUTPUTS.values())
COUNT = sum(FIELDS.values())


def neutral_injection() -> Vector:
    """Factors 1 and addends -0.0, in the order of the injection points."""
    y = np.empty(_BEHIND.size)
    for name, (size, _, _) in INJECTION_POINTS.items():
        start = _BEHIND.slice(field(name)).start
        y[start : start + size] = 1.0
        y[start + size : start + 2 * size] = -0.0
    return y[FIRST:]


def _inject_wheel(value: float, y: Vector, point: int, i: int) -> float:
    """Value of wheel ``i`` behind an injection point of four."""
    return value * y[point + i] + y[point + 4 + i]


def _inject_car(value: float, y: Vector, point: int) -> float:
    """Value behind an injection point of one."""
    return value * y[point] + y[point + 1]


def _untouched_wheel(value: float, _y: Vector, _point: int, _i: int) -> float:
    return value


def _untouched_car(value: float, _y: Vector, _point: int) -> float:
    return value


# No fused products here: what lies before and behind an injection point is computed alike in both builds.
inject_wheel = unfused(_inject_wheel if EFFECTS else _untouched_wheel)
inject_car = unfused(_inject_car if EFFECTS else _untouched_car)
