"""Quantities that several effects look at."""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from plant.compiled import equation
from plant.hydraulics import brake_gain
from plant.layout import Vector
from plant.vectors import P, X, Y

APPLIED_PA = 1e5
FORGET_S = 0.01
REFERENCE_K = 293.15
NOMINAL_PAD_FRICTION = 0.38


@equation
def per_axle(i: int, q: Vector, name: int) -> float:
    """Parameter of the wheel's axle; ``name`` is where the pair (front, rear) begins."""
    return q[name] if i < 2 else q[name + 1]


@equation
def clip(value: float, low: float, high: float) -> float:
    """Value held between two limits."""
    return min(max(value, low), high)


@equation
def applied_rates(x: Vector, y: Vector) -> None:
    """Rates of the time since the brakes were applied, and of the time they were applied in total (above 1 bar)."""
    for i in range(4):
        pressed = y[Y.pressure_pa + i] > APPLIED_PA
        y[Y.rate + X.applied_s + i] = 1.0 if pressed else -x[X.applied_s + i] / FORGET_S
        y[Y.decay_1_s + X.applied_s + i] = 0.0 if pressed else 1.0 / FORGET_S
        y[Y.rate + X.braked_s + i] = 1.0 if pressed else 0.0


@equation
def heat_rates(x: Vector, y: Vector) -> None:
    """Rate of the work of each friction brake, W."""
    for i in range(4):
        work = -y[Y.friction_torque_nm + i] * x[X.wheel_speed_rad_s + i]
        y[Y.rate + X.brake_heat_j + i] = max(work, 0.0)


@equation
def brake_gain_nm_pa(i: int, q: Vector) -> float:
    """Friction torque per pressure of a wheel at the nominal pad friction, N m/Pa (`plant.hydraulics.brake_gain`)."""
    area = per_axle(i, q, P.friction_brake_piston_area_m2)
    radius = per_axle(i, q, P.friction_brake_effective_radius_m)
    return brake_gain(NOMINAL_PAD_FRICTION, area, radius, q[P.friction_brake_efficiency])
