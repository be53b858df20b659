"""The body's motion: levelled acceleration, wheel loads, the ground's speed under each wheel, standstill."""

from math import isnan

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import helper
from ecu.law.gravity import GRAVITY_MPS2
from ecu.law.joint.layout import (
    AX,
    BIAS,
    GRADE,
    LAST_AX,
    LOAD_ACCELERATION,
    LOOKED_S,
    MASS,
    P_ARM,
    P_BASE,
    P_DIVE,
    P_DRAG,
    P_FRONT,
    P_HEIGHT,
    P_INERTIA,
    P_MASS,
    P_PITCH_D,
    P_PITCH_W,
    P_RADIUS,
    P_ROLL,
    P_TRACK,
    PITCH,
    PITCH_RATE,
    REPEATED_S,
    SPEED,
    SPEED_THEN,
    STUCK,
    TORQUE,
    WHEEL,
)

Vector = NDArray[np.float64]

REPEAT_S = 0.2
CONTRADICTION_MPS2 = 0.5
NO_VALUE = 1e9


@helper
def median_wheel(z: Vector) -> float:
    """Median of the wheel speeds that are there, rad/s; at least one is. (numpy's takes long to compile.)"""
    ordered, number = np.empty(4), 0
    for i in range(4):
        if not isnan(z[WHEEL + i]):
            k = number
            while k > 0 and ordered[k - 1] > z[WHEEL + i]:
                ordered[k] = ordered[k - 1]
                k -= 1
            ordered[k] = z[WHEEL + i]
            number += 1
    return float(0.5 * (ordered[(number - 1) // 2] + ordered[number // 2]))


@helper
def watch_accelerometer(s: Vector, z: Vector, p: Vector, dt: float) -> bool:
    """Whether the accelerometer can be believed.

    A living one never repeats itself for long while the car moves. One that does, while the wheels tell of another
    acceleration, is stuck until its value changes; what repeats itself (`REPEATED_S`) teaches nothing meanwhile.
    """
    number = 0
    for i in range(4):
        if not isnan(z[WHEEL + i]):
            number += 1
    if isnan(z[AX]) or number == 0:
        s[LAST_AX], s[REPEATED_S], s[STUCK] = NO_VALUE, 0.0, 0.0
        return not isnan(z[AX])
    speed = median_wheel(z) * p[P_RADIUS]
    if z[AX] != s[LAST_AX]:
        s[LAST_AX], s[REPEATED_S], s[LOOKED_S], s[SPEED_THEN], s[STUCK] = z[AX], 0.0, 0.0, speed, 0.0
        return True
    s[REPEATED_S] += dt
    since = s[REPEATED_S] - s[LOOKED_S]
    if since > REPEAT_S:
        told = (z[AX] - s[BIAS]) / (1.0 + GRAVITY_MPS2 * p[P_DIVE]) - GRAVITY_MPS2 * s[GRADE]
        if abs((speed - s[SPEED_THEN]) / since - told) > CONTRADICTION_MPS2:
            s[STUCK] = 1.0
        s[LOOKED_S], s[SPEED_THEN] = s[REPEATED_S], speed
    return bool(s[STUCK] == 0.0)


@helper
def level_acceleration(s: Vector, z: Vector, p: Vector, dt: float) -> float:
    """Measured longitudinal acceleration with the body's pitch taken out (the sensor pitches with it), m/s2."""
    w, d = p[P_PITCH_W], p[P_PITCH_D]
    level = (z[AX] - s[BIAS]) / (1.0 + GRAVITY_MPS2 * p[P_DIVE])
    s[PITCH_RATE] += dt * (w * w * (-p[P_DIVE] * level - s[PITCH]) - 2.0 * d * w * s[PITCH_RATE])
    s[PITCH] += dt * s[PITCH_RATE]
    ax = z[AX] + GRAVITY_MPS2 * s[PITCH]
    s[LOAD_ACCELERATION] += min(dt / 0.05, 1.0) * (ax - s[BIAS] - s[LOAD_ACCELERATION])
    return float(ax)


@helper
def expected_acceleration(s: Vector, p: Vector, force: float, side_n: float) -> float:
    """What the accelerometer should show for the force of the wheels, N, without its offset, m/s2.

    (m + J) a = sum(T) / r - F_R + J g theta with J = 4 I / r^2.
    """
    mass = p[P_MASS] * s[MASS]
    turn = 4.0 * p[P_INERTIA] / (p[P_RADIUS] * p[P_ARM])
    resistance = 0.5 * p[P_DRAG] * s[SPEED] * s[SPEED] + mass * GRAVITY_MPS2 * p[P_ROLL]
    return float((force - resistance - side_n + turn * GRAVITY_MPS2 * s[GRADE]) / (mass + turn))


@helper
def wheel_states(
    s: Vector, p: Vector, ay: float, yaw_rate: float, steer: float, lateral: float, loads: Vector, along: Vector
) -> None:
    """Fill vertical loads, N, and the ground's speed along each wheel, m/s."""
    base = p[P_BASE]
    rear_m = base - p[P_FRONT]
    mass = p[P_MASS] * s[MASS]
    shift_x = mass * p[P_HEIGHT] * s[LOAD_ACCELERATION] / (2.0 * base)
    for i in range(4):
        axle = 0 if i < 2 else 1
        arm_m = rear_m if axle == 0 else p[P_FRONT]
        left = 1.0 if i % 2 == 0 else -1.0
        share_y = arm_m / base * mass * ay * p[P_HEIGHT] / p[P_TRACK + axle]
        load = 0.5 * mass * GRAVITY_MPS2 * arm_m / base - (shift_x if axle == 0 else -shift_x) - left * share_y
        loads[i] = max(load, 200.0)
        ground = s[SPEED] - yaw_rate * left * 0.5 * p[P_TRACK + axle]
        if axle == 0:
            ground = ground * np.cos(steer) + (lateral + yaw_rate * p[P_FRONT]) * np.sin(steer)
        along[i] = ground


@helper
def apply_standstill(s: Vector, p: Vector) -> None:
    """The car stands: nothing to learn; a standing brake gives what holds the car, and no more than it can."""
    s[SPEED] = 0.0
    holding = 0.25 * p[P_MASS] * s[MASS] * GRAVITY_MPS2 * s[GRADE] * p[P_ARM]
    for i in range(4):
        most = abs(s[TORQUE + i])
        s[TORQUE + i] = min(max(holding, -most), most)
