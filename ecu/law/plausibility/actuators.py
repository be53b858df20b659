"""What the actuators report against what was asked of them: pressures and motor torques."""

from math import isnan

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import helper
from ecu.law.debounce import compiled_up_down
from ecu.law.joint.layout import ASKED_MOTOR, ASKED_PRESSURE, AVAILABLE, DEMAND, HOLD, MOTOR, PRESSURE
from ecu.law.plausibility.layout import (
    ASKED_S,
    EXCLUDED_S,
    FORGET,
    HEAL_S,
    MOTOR_BIT,
    MOTOR_HIGH,
    MOTOR_LAG_S,
    MOTOR_LEVEL,
    MOTOR_LOW,
    MOTOR_MAX,
    MOTOR_NM,
    MOTOR_RATE,
    MOTOR_S,
    MOTOR_SHARE,
    OPPOSING,
    PRESSURE_BIT,
    PRESSURE_HIGH,
    PRESSURE_LAG_S,
    PRESSURE_LEVEL,
    PRESSURE_LOW,
    PRESSURE_PA,
    PRESSURE_S,
    PRESSURE_SHARE,
    REPORTED,
    RETRY_S,
    START_S,
)

Vector = NDArray[np.float64]


@helper
def widen(s: Vector, low: int, high: int, asked: float, share: float, most: float) -> None:
    """Keep the band that an actuator can be in: at the demand at once, away from the old one by a lag and a rate."""
    s[low] = min(asked, s[low] + min(share * (asked - s[low]), most))
    s[high] = max(asked, s[high] + max(share * (asked - s[high]), -most))


@helper
def outside(s: Vector, low: int, high: int, value: float) -> float:
    """By how much a value is above (positive) or below the band."""
    return float(max(value - s[high], 0.0) + min(value - s[low], 0.0))


@helper
def judge_pressures(s: Vector, z: Vector, p: Vector, dt: float) -> int:
    """Put what is likely in the place of pressures that are missing or wrong in ``z``; returns the faults' bits.

    A pressure is wrong where it is off its demand and the other wheel of the axle is not: both are off together where
    it is the brake that does not follow, and then the sensors are right.
    """
    bits = 0
    share = dt / (p[PRESSURE_LAG_S] + dt)
    for i in range(4):
        value, asked = z[PRESSURE + i], z[ASKED_PRESSURE + i]
        low, high = PRESSURE_LOW + i, PRESSURE_HIGH + i
        if not isnan(asked):
            widen(s, low, high, asked, share, 1e9)
        elif not isnan(value):
            s[low], s[high] = value, value
    for i in range(4):
        other = i + 1 if i % 2 == 0 else i - 1
        level, value, beside = s[PRESSURE_LEVEL + i], z[PRESSURE + i], z[PRESSURE + other]
        wrong, gone = 0.0, isnan(value)
        if not (gone or isnan(beside)):
            off = outside(s, PRESSURE_LOW + i, PRESSURE_HIGH + i, value)
            off_beside = outside(s, PRESSURE_LOW + other, PRESSURE_HIGH + other, beside)
            most = p[PRESSURE_PA] + p[PRESSURE_SHARE] * s[PRESSURE_HIGH + i]
            if abs(off) > most and abs(off - off_beside) > most and abs(off) > abs(off_beside):
                wrong = dt
        if wrong > 0.0 or level > 0.0:
            level = compiled_up_down(level, wrong, dt, p[PRESSURE_S], p[FORGET], p[HEAL_S])
            s[PRESSURE_LEVEL + i] = level
            if level > p[PRESSURE_S]:
                bits |= 1 << (PRESSURE_BIT + i)
        if gone or wrong > 0.0 or level > p[PRESSURE_S]:
            z[HOLD] = 1.0
    if z[HOLD] > 0.0:
        _substitute_pressures(s, z, p, bits)
    return bits


@helper
def _substitute_pressures(s: Vector, z: Vector, p: Vector, bits: int) -> None:
    """The axle's other wheel for one that is not believed, or the middle of what the demands make likely."""
    for i in range(4):
        other = i + 1 if i % 2 == 0 else i - 1
        off = abs(outside(s, PRESSURE_LOW + i, PRESSURE_HIGH + i, z[PRESSURE + i]))
        most = p[PRESSURE_PA] + p[PRESSURE_SHARE] * s[PRESSURE_HIGH + i]
        if bits >> (PRESSURE_BIT + i) & 1 or isnan(z[PRESSURE + i]) or off > most:
            beside = z[PRESSURE + other]
            off_beside = abs(outside(s, PRESSURE_LOW + other, PRESSURE_HIGH + other, beside))
            if isnan(beside) or bits >> (PRESSURE_BIT + other) & 1 or off_beside > off:
                beside = 0.5 * (s[PRESSURE_LOW + i] + s[PRESSURE_HIGH + i])
            z[PRESSURE + i] = beside


@helper
def judge_motors(s: Vector, z: Vector, p: Vector, dt: float) -> int:
    """Compare torques demanded and reported while braking; returns the bits of the motors that are not asked any more.

    The driver's own torque is in the current while the pedal is free: nothing is compared then, but the time runs
    after which an excluded motor is tried again.
    """
    bits = 0
    braking = z[DEMAND] > 0.0
    asked_at_all = not isnan(z[ASKED_MOTOR])
    s[ASKED_S] = min(s[ASKED_S] + dt, p[START_S] + 1.0) if asked_at_all else 0.0
    compared = braking and asked_at_all and s[ASKED_S] > p[START_S]
    share, most = dt / (p[MOTOR_LAG_S] + dt), p[MOTOR_RATE] * dt
    for i in range(4):
        torque = z[MOTOR + i]
        known = not isnan(torque)
        if s[EXCLUDED_S + i] > 0.0 and not braking:
            s[EXCLUDED_S + i] -= dt
            s[MOTOR_LEVEL + i] = 0.5 * p[MOTOR_S]
        if not compared:
            s[MOTOR_LOW + i] = min(torque, 0.0) if known else 0.0
            s[MOTOR_HIGH + i] = max(torque, 0.0) if known else 0.0
        else:
            widen(s, MOTOR_LOW + i, MOTOR_HIGH + i, z[ASKED_MOTOR + i], share, most)
            able = 0.0 if isnan(z[AVAILABLE + i]) else z[AVAILABLE + i]
            least = max(s[MOTOR_HIGH + i], -able)  # braking is negative
            tolerance = p[MOTOR_NM] + p[MOTOR_SHARE] * max(-s[MOTOR_LOW + i], s[MOTOR_HIGH + i])
            wrong = dt if torque > least + tolerance or torque < s[MOTOR_LOW + i] - tolerance else 0.0
            if wrong > 0.0 or s[MOTOR_LEVEL + i] > 0.0:
                level = compiled_up_down(s[MOTOR_LEVEL + i], wrong, dt, p[MOTOR_S], p[FORGET], p[HEAL_S])
                s[MOTOR_LEVEL + i] = level
                if level > p[MOTOR_S]:
                    s[EXCLUDED_S + i] = p[RETRY_S]
        s[OPPOSING + i] = 0.0
        if s[EXCLUDED_S + i] > 0.0:
            bits |= 1 << (MOTOR_BIT + i)
            z[HOLD] = 1.0
            if s[REPORTED] > 0.0 and known:
                s[OPPOSING + i] = min(max(torque, 0.0), p[MOTOR_MAX])
            else:
                z[MOTOR + i] = 0.0
        elif not known:
            z[HOLD] = 1.0
            z[MOTOR + i] = 0.0
    return bits
