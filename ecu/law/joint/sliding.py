"""Wheels that slide, lock or seem to, and what is still known of them."""

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import helper
from ecu.law.joint.layout import (
    BIAS,
    COVARIANCE,
    LAST_WHEEL,
    LOCKED,
    MASS,
    ODD_S,
    P_ARM,
    P_DRAG,
    P_INERTIA,
    P_MASS,
    P_RADIUS,
    P_SLIDE,
    P_WHEEL_LAG,
    SLID_S,
    SLIDING,
    SPEED,
    SPIN,
    SPIN_RATE,
    TORQUE,
    WHEEL,
    N,
)
from ecu.law.joint.torque import wheel_force

Vector = NDArray[np.float64]

SLIDING_HOLD_S = 0.15
ODD_MOST_S = 2.0  # of an odd wheel: two seconds of rolling make it a good one again
LOST_S, AGREE = 0.3, 0.03  # all wheels "slide" for so long and agree so well: it is the speed that is wrong
COARSE_MPS = 0.1  # what tooth sensing can be off at low speed
LOCKED_SHARE = 0.15  # of the speed of the car: slower than that a wheel may be locked
SPIN_UP_RAD_S = 1.0  # faster in one sample: it is turning again
TOOTH_RAD_S = 14.0  # about one tooth in a sample
STANDING_RAD_S = 1.0
TOOTH_WAIT_S = 0.08  # a wheel that stops jumps back to what the missing tooth allows at most, and decays from there


@helper
def watch_wheel(s: Vector, p: Vector, i: int, omega: float, ground: float, expected_slip: float, dt: float) -> float:
    """Tell whether wheel ``i`` slides (``SLIDING``) or stands (``LOCKED``); returns its angular acceleration, rad/s2.

    A toothed wheel reports standstill long after it: below about a tooth a sample the spin-down seen before goes on.
    """
    slip = (omega * p[P_RADIUS] - ground) / max(ground, 1.0)
    if abs(slip - expected_slip) > p[P_SLIDE] + COARSE_MPS / max(ground, 1.0):
        s[SLIDING + i] = SLIDING_HOLD_S
    step = omega - s[LAST_WHEEL + i]
    s[SPIN + i] += s[SPIN_RATE + i] * dt
    if omega > TOOTH_RAD_S and (step < SPIN_UP_RAD_S or s[LAST_WHEEL + i] > TOOTH_RAD_S):  # else it rocks as it stops
        behind = omega + s[SPIN_RATE + i] * p[P_WHEEL_LAG] - s[SPIN + i]
        s[SPIN + i] += 0.5 * behind
        s[SPIN_RATE + i] += 0.2 * behind / dt
    slow = slip < LOCKED_SHARE - 1.0
    if s[LOCKED + i] > 0.0:
        s[LOCKED + i] += dt
        if s[LOCKED + i] > TOOTH_WAIT_S and (not slow or step > SPIN_UP_RAD_S):
            s[LOCKED + i] = 0.0
            s[SPIN + i], s[SPIN_RATE + i] = TOOTH_RAD_S, 0.0
    elif (s[SPIN + i] + 0.75 * s[SPIN_RATE + i] * dt <= 0.0 and slip < -0.5) or (slow and omega < STANDING_RAD_S):
        s[LOCKED + i] = dt
    return float(step / dt)


@helper
def count_odd_wheels(s: Vector, dt: float) -> None:
    """Count how long each wheel slides, at half the rate down again: more than two at once are no faults of sensors."""
    number = 0
    for i in range(4):
        if s[SLIDING + i] > 0.0:
            number += 1
    for i in range(4):
        if s[SLIDING + i] == 0.0:
            s[ODD_S + i] = max(s[ODD_S + i] - 0.5 * dt, 0.0)
        elif number < 3:
            s[ODD_S + i] = min(s[ODD_S + i] + dt, ODD_MOST_S)


@helper
def reinitialise_speed(s: Vector, z: Vector, p: Vector) -> None:
    """Take the speed from the wheels where all of them seem to slide and yet agree, as after driving off."""
    mean = 0.25 * (z[WHEEL] + z[WHEEL + 1] + z[WHEEL + 2] + z[WHEEL + 3])
    if mean * p[P_RADIUS] < 0.7 * s[SPEED]:  # all locked, as on ice
        return
    for i in range(4):
        if not abs(z[WHEEL + i] - mean) <= AGREE * mean:
            return
    s[SPEED] = mean * p[P_RADIUS]
    for j in range(N):
        s[COVARIANCE + SPEED * N + j] = 0.0
        s[COVARIANCE + j * N + SPEED] = 0.0
    s[COVARIANCE] = 0.25
    for i in range(4):
        s[SLIDING + i], s[SLID_S + i], s[LOCKED + i], s[ODD_S + i] = 0.0, 0.0, 0.0, 0.0


@helper
def torque_of_standing_wheels(
    s: Vector, p: Vector, ax: float, acceleration: float, loads: Vector, spin: Vector
) -> None:
    """Torque of locked wheels: what the road gives, the force that the turning wheels leave over, by load."""
    locked_load = 0.0
    rest = p[P_MASS] * s[MASS] * (ax - s[BIAS]) + 0.5 * p[P_DRAG] * s[SPEED] * s[SPEED]
    for i in range(4):
        if s[LOCKED + i] > 0.0:
            locked_load += loads[i]
        else:
            own = wheel_force(s, p, i, loads[i], acceleration)
            if s[SLIDING + i] > 0.0:
                own += p[P_INERTIA] * (acceleration / p[P_RADIUS] - spin[i]) / p[P_ARM]
            rest -= own
    for i in range(4):
        if s[LOCKED + i] > 0.0:
            s[TORQUE + i] = min(max(rest * p[P_ARM] * loads[i] / locked_load, s[TORQUE + i]), 0.0)
