"""What compiled code needs of the joints: they lie behind the outputs, first the factors of a joint, then its addends.

The neutral addend is -0.0, the only number that changes nothing when it is added, not even the sign of zero.
"""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from typing import Any

import numpy as np

from plant.compiled import EFFECTS, joint
from plant.injection_points import FIELDS, JOINTS, field
from plant.layout import Layout, Vector
from plant.vectors import OUTPUTS

_BEHIND = Layout("Joint", {"outputs": sum(OUTPUTS.values())} | FIELDS)
J: Any = _BEHIND.at
"""First factor of each joint in ``y``; its addends follow the factors."""
FIRST = sum(OUTPUTS.values())
COUNT = sum(FIELDS.values())


def neutral_joints() -> Vector:
    """Factors 1 and addends -0.0, in the order of the joints."""
    y = np.empty(_BEHIND.size)
    for name, (size, _, _) in JOINTS.items():
        start = _BEHIND.slice(field(name)).start
        y[start : start + size] = 1.0
        y[start + size : start + 2 * size] = -0.0
    return y[FIRST:]


def _at_wheel(value: float, y: Vector, joint: int, i: int) -> float:
    """Value of wheel ``i`` behind a joint of four."""
    return value * y[joint + i] + y[joint + 4 + i]


def _at_car(value: float, y: Vector, joint: int) -> float:
    """Value behind a joint of one."""
    return value * y[joint] + y[joint + 1]


def _untouched_wheel(value: float, _y: Vector, _joint: int, _i: int) -> float:
    return value


def _untouched_car(value: float, _y: Vector, _joint: int) -> float:
    return value


# No fused products here: what lies before and behind a joint is computed alike in both builds.
at_wheel = joint(_at_wheel if EFFECTS else _untouched_wheel)
at_car = joint(_at_car if EFFECTS else _untouched_car)
