"""Wheel speeds: what a wheel of this car can do, and how fast one can be beside the others."""

from math import isnan

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import helper
from ecu.law.debounce import compiled_up_down
from ecu.law.joint.layout import MOTOR, WHEEL
from ecu.law.plausibility.layout import (
    ABOVE,
    ABOVE_MPS,
    FALL,
    FORGET,
    HEAL_S,
    MOTOR_NM,
    RADIUS,
    RISE,
    SPEED_MAX,
    WHEEL_BIT,
    WHEEL_LAST,
    WHEEL_LEVEL,
    WHEEL_S,
)

Vector = NDArray[np.float64]


@helper
def follows(s: Vector, i: int, omega: float, rise: float, fall: float) -> bool:
    """Whether wheel ``i`` can have got to ``omega`` since the last sample; keeps what it can have got to."""
    last = s[WHEEL_LAST + i]
    if omega > last + rise:
        s[WHEEL_LAST + i] = last + rise
        return False
    if omega < last - fall:
        s[WHEEL_LAST + i] = last - fall
        return False
    s[WHEEL_LAST + i] = omega
    return True


@helper
def second_fastest(z: Vector) -> float:
    """Speed of the second fastest wheel, rad/s; 0 where fewer than two are there or turn forward."""
    first, second = 0.0, 0.0
    for i in range(4):
        omega = z[WHEEL + i]
        if omega > first:
            first, second = omega, first
        elif omega > second:
            second = omega
    return second


@helper
def judge_wheels(s: Vector, z: Vector, p: Vector, speed: float, begun: bool, dt: float) -> tuple[int, float]:
    """Take the wheels that cannot be right out of ``z``; returns the faults' bits and the fastest of the others, rad/s.

    No sensor alone can make the car seem faster: one wheel may exceed both the second fastest and the observer's
    ``speed``, m/s, by a margin only. A wheel that is slower may slide, and is watched by the observer.
    """
    bits, top, slowest, number = 0, 0.0, 1e9, 0
    most = (1.0 + p[ABOVE]) * max(speed / p[RADIUS], second_fastest(z)) + p[ABOVE_MPS] / p[RADIUS]
    for i in range(4):
        omega = z[WHEEL + i]
        if isnan(omega):
            s[WHEEL_LAST + i] = omega
            continue
        if not begun or isnan(s[WHEEL_LAST + i]):
            s[WHEEL_LAST + i] = omega
        slowest = min(slowest, max(omega, 0.0))
        odd = not follows(s, i, omega, p[RISE] * dt, p[FALL] * dt) or abs(omega) * p[RADIUS] > p[SPEED_MAX]
        above = omega > most
        driven = z[MOTOR + i] > p[MOTOR_NM]  # may spin
        evidence = dt if odd or (above and not driven) else 0.0
        level = compiled_up_down(s[WHEEL_LEVEL + i], evidence, dt, p[WHEEL_S], p[FORGET], p[HEAL_S])
        s[WHEEL_LEVEL + i] = level
        if level > p[WHEEL_S]:
            bits |= 1 << (WHEEL_BIT + i)
        if level > p[WHEEL_S] or odd or above:
            z[WHEEL + i] = np.nan
            continue
        number += 1
        top = max(top, omega)
    if number == 0 and slowest < 1e9:  # none is believed: the slowest lets the brake give most
        top = min(slowest, p[SPEED_MAX] / p[RADIUS])
    return bits, top
