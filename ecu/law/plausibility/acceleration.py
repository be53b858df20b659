"""The acceleration sensor against two others that tell of the same: the wheels and the force balance."""

from math import isnan

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import helper
from ecu.law.debounce import compiled_up_down
from ecu.law.joint.layout import AX, MOTOR, WHEEL
from ecu.law.joint.motion import median_wheel
from ecu.law.plausibility.layout import (
    ACCELERATION,
    ACCELERATION_BIT,
    ACCELERATION_LAG_S,
    ACCELERATION_LEVEL,
    ACCELERATION_S,
    ACCELERATION_SHARE,
    ARM,
    BEFORE_AX,
    BODY,
    EXCLUDED_S,
    FORCES,
    FORGET,
    HEAL_S,
    JUMP,
    LAST_AX,
    LAST_SPEED,
    MASS,
    RADIUS,
    REPORTED,
    ROUGH,
    WHEELS,
)

Vector = NDArray[np.float64]

SLOWEST_MPS = 3.0  # below, teeth are sparse, and a brake that holds gives no force
SLIDING = 0.05  # slip of the median wheel, far beyond that of braking with grip (1 to 2 %)
UNLIKE = 0.5  # share of the tolerance within which the two witnesses must agree to overrule the sensor


@helper
def judge_acceleration(
    s: Vector, z: Vector, p: Vector, car_mps: float, expected: float, grade: float, begun: bool, dt: float
) -> int:
    """Take an acceleration that cannot be right out of ``z``; returns the fault's bit.

    Wrong is what jumps as no car does, and what neither the wheels nor the force balance (``expected``, m/s2, NaN
    where there is none) show while these two agree: each of them is wrong alone where wheels slide, pads fade or a
    pressure is wrong. Where the wheels slide against the observer's speed, both are wrong alike: then nothing is
    compared. What is too rough sample by sample is no noise of this sensor.
    """
    ax = z[AX]
    share = dt / (p[ACCELERATION_LAG_S] + dt)
    number = 0
    for i in range(4):
        if not isnan(z[WHEEL + i]):
            number += 1
    speed = median_wheel(z) * p[RADIUS] if number >= 2 else 0.0
    if isnan(ax) or isnan(expected) or speed < SLOWEST_MPS or speed < (1.0 - SLIDING) * car_mps:
        s[BODY] = np.nan
        s[LAST_AX], s[BEFORE_AX] = ax, np.nan
        return _count(s, z, p, 0.0, dt)
    if not begun or isnan(s[BODY]):
        s[BODY], s[WHEELS], s[FORCES] = ax, ax, ax
        s[LAST_SPEED] = speed
        if isnan(s[LAST_AX]) or not begun:
            s[LAST_AX] = ax
        s[BEFORE_AX] = s[LAST_AX]
    s[BODY] += share * (ax - s[BODY])
    s[WHEELS] += share * ((speed - s[LAST_SPEED]) / dt + grade - s[WHEELS])
    s[FORCES] += share * (expected - s[FORCES])
    jump, bend = ax - s[LAST_AX], ax - 2.0 * s[LAST_AX] + s[BEFORE_AX]
    s[LAST_SPEED], s[BEFORE_AX], s[LAST_AX] = speed, s[LAST_AX], ax
    most = p[ACCELERATION] + p[ACCELERATION_SHARE] * abs(s[FORCES])
    alone = (
        abs(s[BODY] - s[WHEELS]) > most
        and abs(s[BODY] - s[FORCES]) > most
        and abs(s[WHEELS] - s[FORCES]) < UNLIKE * most
        and abs(s[BODY] + s[WHEELS]) > most  # else the car rolls backward, which toothed wheels do not show
    )
    if s[ACCELERATION_LEVEL] > p[ACCELERATION_S] and abs(s[BODY] - s[WHEELS]) > most:
        alone = True  # a fault heals where the wheels agree, whatever the brakes do
    evidence = dt if alone or abs(jump) > p[JUMP] or abs(bend) > p[ROUGH] else 0.0
    bit = _count(s, z, p, evidence, dt)
    if alone or abs(jump) > p[JUMP]:
        z[AX] = np.nan
    return bit


@helper
def _count(s: Vector, z: Vector, p: Vector, evidence: float, dt: float) -> int:
    level = s[ACCELERATION_LEVEL]
    if evidence > 0.0 or level > 0.0:
        level = compiled_up_down(level, evidence, dt, p[ACCELERATION_S], p[FORGET], p[HEAL_S])
        s[ACCELERATION_LEVEL] = level
    if level > p[ACCELERATION_S]:
        z[AX] = np.nan
        return 1 << ACCELERATION_BIT
    return 0


@helper
def believe_reports(s: Vector, z: Vector, p: Vector, ax: float, expected: float, dt: float) -> None:
    """Tell whether motors that are excluded give what they report, or nothing: which of both shows in the acceleration.

    ``expected`` counts what was believed in the last sample.
    """
    reported = 0.0
    for i in range(4):
        if s[EXCLUDED_S + i] > 0.0 and not isnan(z[MOTOR + i]):
            reported += z[MOTOR + i] / (p[ARM] * p[MASS])
    if isnan(ax) or isnan(expected):
        s[REPORTED] = 0.0
        return
    with_it = expected if s[REPORTED] > 0.0 else expected + reported
    better = abs(ax - with_it + reported) - abs(ax - with_it)
    s[REPORTED] += dt / (p[ACCELERATION_LAG_S] + dt) * (better - s[REPORTED])
