"""What the controller reads from the filter's state."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import entry, helper
from ecu.law.gravity import GRAVITY_MPS2
from ecu.law.joint.layout import (
    BIAS,
    COVARIANCE,
    EXPECTED,
    FRICTION,
    GRADE,
    MASS,
    ODD_S,
    SPEED,
    STARTED,
    STUCK,
    TORQUE,
    N,
)
from ecu.law.types import Four

Vector = NDArray[np.float64]

IMPLAUSIBLE_S = 1.0  # longer than a wheel slides


@helper
def confidence_of(s: Vector, i: int, full: float) -> float:
    """Confidence in the pad friction of wheel ``i``, 0..1: none from a relative uncertainty of ``full`` on."""
    variance = s[COVARIANCE + (FRICTION + i) * (N + 1)]
    return float(1.0 - min(sqrt(max(variance, 0.0)) / (full * s[FRICTION + i]), 1.0))


@entry
def read_estimates(
    s: Vector, full: float
) -> tuple[bool, float, Four, Four, Four, float, tuple[bool, bool, bool, bool], bool, float, float]:
    """Whether it has started, speed, wheel torques, pad friction and its confidence, mass, wheels that do not turn as
    the car moves, whether the accelerometer is stuck, what the accelerometer should show by the torques,
    and what it shows of offset and grade, m/s2.

    Parameters
    ----------
    s : state (`layout`).  full : relative uncertainty of the pad friction that counts as no confidence.
    """
    t, m = TORQUE, FRICTION
    return (
        s[STARTED] != 0.0,
        s[SPEED],
        (s[t], s[t + 1], s[t + 2], s[t + 3]),
        (s[m], s[m + 1], s[m + 2], s[m + 3]),
        (confidence_of(s, 0, full), confidence_of(s, 1, full), confidence_of(s, 2, full), confidence_of(s, 3, full)),
        s[MASS],
        (
            s[ODD_S] > IMPLAUSIBLE_S,
            s[ODD_S + 1] > IMPLAUSIBLE_S,
            s[ODD_S + 2] > IMPLAUSIBLE_S,
            s[ODD_S + 3] > IMPLAUSIBLE_S,
        ),
        s[STUCK] != 0.0,
        s[EXPECTED],
        s[BIAS] + GRAVITY_MPS2 * s[GRADE],
    )
