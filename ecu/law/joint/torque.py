"""Torques and forces of the wheels out of pressures, motor torques and pad frictions."""

from math import isnan

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import helper
from ecu.law.joint.layout import (
    APPLIED_PA,
    DEMAND,
    FRICTION,
    HOLD,
    MOTOR,
    MOTOR_LAG,
    P_ARM,
    P_GAIN,
    P_INERTIA,
    P_LAG,
    P_RADIUS,
    P_RELAX,
    P_ROLL,
    P_THRESHOLD,
    P_ZERO_LIMIT,
    P_ZERO_TIME,
    PRESSURE,
    PRESSURE_LAG,
    PRESSURE_ZERO,
    RELEASED_S,
    SPEED,
    TORQUE,
)

Vector = NDArray[np.float64]

RELEASED_PA = 3e5
SETTLED_S = 0.4


@helper
def track_pressure_zero(s: Vector, z: Vector, p: Vector, dt: float) -> bool:
    """Follow the offsets of the pressure sensors while the pedal is free; returns whether all pressures are known."""
    settled = z[DEMAND] <= 0.0
    known = True
    for i in range(4):
        if isnan(z[PRESSURE + i]):
            known = False
        elif abs(z[PRESSURE + i]) > RELEASED_PA:
            settled = False
    s[RELEASED_S] = s[RELEASED_S] + dt if settled else 0.0
    if s[RELEASED_S] > SETTLED_S and z[HOLD] == 0.0:
        share = min(dt / p[P_ZERO_TIME], 1.0)
        for i in range(4):
            if not isnan(z[PRESSURE + i]):
                zero = s[PRESSURE_ZERO + i] + share * (z[PRESSURE + i] - s[PRESSURE_ZERO + i])
                s[PRESSURE_ZERO + i] = min(max(zero, -p[P_ZERO_LIMIT]), p[P_ZERO_LIMIT])
    return known


@helper
def lagged_torque(s: Vector, p: Vector, i: int) -> float:
    """Torque of wheel ``i`` as the sensors see its effect, Nm: T = T_motor - mu G (p - p0), delayed."""
    gain = p[P_GAIN] if i < 2 else p[P_GAIN + 1]
    return float(s[MOTOR_LAG + i] - s[FRICTION + i] * gain * s[PRESSURE_LAG + i])


@helper
def update_torques(s: Vector, z: Vector, p: Vector, dt: float) -> tuple[float, bool]:
    """Torques now and as the sensors and the tyres delay what they do.

    Returns the force of all wheels together, N, and whether any friction brake is applied.
    """
    lag = p[P_LAG] + p[P_RELAX] / max(s[SPEED], 2.0)
    share = min(dt / (lag + 0.5 * dt), 1.0)
    applied = False
    force = 0.0
    for i in range(4):
        gain = p[P_GAIN] if i < 2 else p[P_GAIN + 1]
        clamp = 0.0
        if not isnan(z[PRESSURE + i]):
            clamp = max(z[PRESSURE + i] - s[PRESSURE_ZERO + i] - p[P_THRESHOLD], 0.0)
        motor = 0.0 if isnan(z[MOTOR + i]) else z[MOTOR + i]
        s[TORQUE + i] = motor - s[FRICTION + i] * gain * clamp
        if s[RELEASED_S] > 0.0:
            clamp = 0.0
        s[PRESSURE_LAG + i] += share * (clamp - s[PRESSURE_LAG + i])
        s[MOTOR_LAG + i] += share * (motor - s[MOTOR_LAG + i])
        if s[PRESSURE_LAG + i] > APPLIED_PA:
            applied = True
        force += lagged_torque(s, p, i) / p[P_ARM]
    return force, applied


@helper
def wheel_force(s: Vector, p: Vector, i: int, load_n: float, acceleration: float) -> float:
    """Longitudinal tyre force of wheel ``i`` while it rolls, N: F = (T - I a / r) / r - f_r Fz."""
    rolling = p[P_ROLL] * load_n
    return float((lagged_torque(s, p, i) - p[P_INERTIA] * acceleration / p[P_RADIUS]) / p[P_ARM] - rolling)
