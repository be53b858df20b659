"""The generic bank: basis functions of one or two variables, multiplied or added at any injection point.

The place for terms that nobody has listed. A term adds ``c_i f(v) g(w)`` to the factor or the addend of its injection
point, with a coefficient for each wheel; `term` makes its row, and a table of rows goes beside theta. Nothing is
recompiled.
"""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from collections.abc import Sequence
from enum import IntEnum
from math import cos, exp, pi, sin, sqrt

import numpy as np

from plant.compiled import equation
from plant.effects.shared import applied_rates, brake_gain_nm_pa
from plant.inject import J
from plant.injection_points import INJECTION_POINTS, field
from plant.layout import Vector
from plant.vectors import PARAMETER, X, Y

MOST_TERMS = 64
COLUMNS = 15


class Variable(IntEnum):
    """What a term can depend on; in SI units; of the wheel, at points of the whole car of the front left one."""

    ONE = 0
    SPEED = 1  # of the car
    WHEEL_SPEED = 2
    PRESSURE = 3
    DISC_TEMPERATURE = 4
    SLIP = 5
    TORQUE = 6  # wheel torque, from pressure and motor; braking negative
    MOTOR_TORQUE = 7
    APPLIED_TIME = 8  # since the brake was applied
    WHEEL_ANGLE = 9
    ACCELERATION = 10  # longitudinal specific force behind the sensor's filter
    YAW_RATE = 11
    LATERAL_ACCELERATION = 12
    DISTANCE = 13
    TIME = 14
    PRESSURE_RATE = 15
    WINDING_TEMPERATURE = 16
    WHEEL_LOAD = 17  # of the last step


_APPLIED_TIME = float(Variable.APPLIED_TIME)


class Shape(IntEnum):
    """Functions of s = (variable - centre) / width."""

    CONSTANT = 0
    LINEAR = 1
    SQUARE = 2
    HAT = 3  # 1 at 0, 0 from -1 and 1 on
    BUMP = 4  # exp(-s^2 / 2)
    STEP = 5  # smooth, 0 to 1
    SINE = 6  # of 2 pi s
    COSINE = 7
    ABSOLUTE = 8
    INVERSE = 9  # 1 / (1 + |s|)
    RAMP = 10  # 0 below 0
    DECAY = 11  # exp(-s) above 0, 1 below
    SIGN = 12


@equation
def variable(which: int, i: int, x: Vector, q: Vector, y: Vector) -> float:
    """Value of a variable at a wheel."""
    value = 1.0
    if which == 1:
        value = x[X.speed_mps]
    elif which == 2:
        value = x[X.wheel_speed_rad_s + i]
    elif which == 3:
        value = y[Y.pressure_pa + i]
    elif which == 4:
        value = x[X.disc_temperature_k + i]
    elif which == 5:
        value = x[X.slip + i]
    elif which == 6:
        turning = min(max(x[X.wheel_speed_rad_s + i], -1.0), 1.0)
        value = x[X.motor_torque_nm + i] - turning * brake_gain_nm_pa(i, q) * y[Y.pressure_pa + i]
    elif which == 7:
        value = x[X.motor_torque_nm + i]
    elif which == 8:
        value = x[X.applied_s + i]
    elif which == 9:
        value = x[X.wheel_angle_rad + i]
    elif which == 10:
        value = x[X.imu_longitudinal_mps2]
    elif which == 11:
        value = x[X.yaw_rate_rad_s]
    elif which == 12:
        value = x[X.imu_lateral_mps2]
    elif which == 13:
        value = x[X.distance_m]
    elif which == 14:
        value = x[X.time_s]
    elif which == 15:
        value = x[X.pressure_rate_pa_s + i]
    elif which == 16:
        value = x[X.winding_temperature_k + i]
    elif which == 17:
        value = y[Y.wheel_load_n + i]
    return value


@equation
def shaped(which: int, s: float) -> float:
    """Value of a shape."""
    value = 1.0
    if which == 1:
        value = s
    elif which == 2:
        value = s * s
    elif which == 3:
        value = max(1.0 - abs(s), 0.0)
    elif which == 4:
        value = exp(-0.5 * s * s)
    elif which == 5:
        value = 0.5 * (1.0 + s / sqrt(1.0 + s * s))
    elif which == 6:
        value = sin(2.0 * pi * s)
    elif which == 7:
        value = cos(2.0 * pi * s)
    elif which == 8:
        value = abs(s)
    elif which == 9:
        value = 1.0 / (1.0 + abs(s))
    elif which == 10:
        value = max(s, 0.0)
    elif which == 11:
        value = exp(-max(s, 0.0))
    elif which == 12:
        value = s / sqrt(1e-6 + s * s)
    return value


@equation
def load(terms: Vector, q: Vector, count: int, rows: int) -> None:
    """Copy the table into ``q``."""
    q[count] = min(terms.shape[0], MOST_TERMS)
    for k in range(min(terms.shape[0], MOST_TERMS)):
        for column in range(COLUMNS):
            q[rows + k * COLUMNS + column] = terms[k, column]


@equation
def moves(terms: Vector) -> bool:
    """Whether a term needs a state that moves for the bank alone."""
    found = False
    for k in range(terms.shape[0]):
        found |= (terms[k, 7] == _APPLIED_TIME) | (terms[k, 11] == _APPLIED_TIME)
    return found


@equation
def apply(x: Vector, u: Vector, q: Vector, y: Vector, count: int, rows: int) -> None:
    """Bring every term to its injection point."""
    for k in range(int(q[count])):
        row = rows + k * COLUMNS
        target, size, adds = int(q[row]), int(q[row + 1]), q[row + 2] > 0.5
        for i in range(size):
            wheel = i if size == 4 else 2 * i
            first = (variable(int(q[row + 7]), wheel, x, q, y) - q[row + 9]) / q[row + 10]
            second = (variable(int(q[row + 11]), wheel, x, q, y) - q[row + 13]) / q[row + 14]
            value = q[row + 3 + i] * shaped(int(q[row + 8]), first) * shaped(int(q[row + 12]), second)
            if target >= 0:
                y[target + i] = y[target + i] + value if adds else y[target + i] * (1.0 + value)
            else:
                place = -1 - target + i
                q[place] = q[place] + value if adds else q[place] * (1.0 + value)


@equation
def rates(x: Vector, q: Vector, y: Vector, count: int) -> None:
    """Rates of what the variables need."""
    if q[count] > 0.5:
        applied_rates(x, y)


def injection_point_names() -> list[str]:
    """Every injection point: the named places of the model, then each number of the parameter set."""
    return [*INJECTION_POINTS, *PARAMETER.sizes]


def term(
    injection_point: str,
    coefficient: float | Sequence[float],
    first: tuple[Variable, Shape, float, float],
    second: tuple[Variable, Shape, float, float] = (Variable.ONE, Shape.CONSTANT, 0.0, 1.0),
    *,
    add: bool = False,
) -> Vector:
    """One row of the bank's table.

    Parameters
    ----------
    injection_point : of `injection_point_names`.
    coefficient : one for all members of the point, or one each.
    first, second : variable, shape, centre and width; the term is their product.
    add : True for the addend (in the point's unit), False for the factor (a share).
    """
    if injection_point in INJECTION_POINTS:
        size = INJECTION_POINTS[injection_point][0]
        target = int(getattr(J, field(injection_point))) + (size if add else 0)
    elif injection_point in PARAMETER.sizes:
        size = PARAMETER.sizes[injection_point]
        target = -1 - PARAMETER.slice(injection_point).start  # negative: in q, not in y
    else:
        raise ValueError(f"no injection point {injection_point!r}; known: {', '.join(injection_point_names())}")
    numbers = [float(coefficient)] * size if isinstance(coefficient, int | float) else [float(c) for c in coefficient]
    if len(numbers) != size:
        raise ValueError(f"{injection_point}: expected {size} coefficients, got {len(numbers)}")
    for _, _, _, width in (first, second):
        if not width > 0.0:
            raise ValueError(f"{injection_point}: width of a basis function must be above 0, got {width!r}")
    return np.array([target, size, float(add), *numbers, *[0.0] * (4 - size), *map(float, first), *map(float, second)])


NO_TERMS = np.empty((0, COLUMNS))
