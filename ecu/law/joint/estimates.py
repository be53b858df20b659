"""What the controller reads from the filter's state."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import helper
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

Vector = NDArray[np.float64]

IMPLAUSIBLE_S = 1.0  # longer than a wheel slides


@helper
def confidence_of(s: Vector, i: int, full: float) -> float:
    """Confidence in the pad friction of wheel ``i``, 0..1: none from a relative uncertainty of ``full`` on."""
    variance = s[COVARIANCE + (FRICTION + i) * (N + 1)]
    return float(1.0 - min(sqrt(max(variance, 0.0)) / (full * s[FRICTION + i]), 1.0))


@helper
def write_estimates(s: Vector, full: float, told: Vector) -> None:
    """Write what the controller reads into ``told``, shape (`TOLD`,).

    Whether it has started, speed, mass, whether the accelerometer is stuck, what the accelerometer should show by the
    torques, and what it shows of offset and grade, m/s2; then of each wheel the torque, pad friction and its
    confidence, and whether it does not turn as the car moves.

    Parameters
    ----------
    s : state (`layout`).  full : relative uncertainty of the pad friction that counts as no confidence.
    """
    told[0], told[1], told[2], told[3] = s[STARTED], s[SPEED], s[MASS], s[STUCK]
    told[4], told[5] = s[EXPECTED], s[BIAS] + GRAVITY_MPS2 * s[GRADE]
    for i in range(4):
        told[6 + i] = s[TORQUE + i]
        told[10 + i] = s[FRICTION + i]
        told[14 + i] = confidence_of(s, i, full)
        told[18 + i] = 1.0 if s[ODD_S + i] > IMPLAUSIBLE_S else 0.0


TOLD = 22
