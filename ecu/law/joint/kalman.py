"""The filter's own steps: start, prediction, one scalar correction, bounds."""

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import helper
from ecu.law.gravity import GRAVITY_MPS2
from ecu.law.joint.layout import (
    APPLIED_PA,
    AXLE,
    BIAS,
    COVARIANCE,
    FRICTION,
    GRADE,
    MASS,
    PRESSURE_LAG,
    Q_AXLE,
    Q_BIAS,
    Q_COMMON,
    Q_GRADE,
    Q_RELEASED,
    Q_SINGLE,
    Q_STIFF,
    RADIUS,
    SPEED,
    START,
    STARTED,
    STIFFNESS,
    N,
)

Vector = NDArray[np.float64]


@helper
def start(s: Vector, p: Vector, speed_mps: float) -> None:
    """Set the state ``s`` to what is believed before anything was measured, at a speed."""
    s[:] = 0.0
    s[SPEED] = speed_mps
    s[MASS] = 1.0
    s[STIFFNESS] = 1.0
    for i in range(4):
        s[RADIUS + i] = 1.0
        s[FRICTION + i] = p[START + 9]
    c = COVARIANCE
    s[c] = 0.25
    for k, state in enumerate((BIAS, GRADE, MASS, STIFFNESS, AXLE)):
        s[c + state * N + state] = p[START + k]
    for i in range(4):
        s[c + (RADIUS + i) * N + RADIUS + i] = p[START + 5]
        for j in range(4):
            same_axle = 1.0 if (i < 2) == (j < 2) else -1.0
            s[c + (FRICTION + i) * N + FRICTION + j] = (
                p[START + 6] + same_axle * p[START + 7] + (p[START + 8] if i == j else 0.0)
            )
    s[STARTED] = 1.0


@helper
def predict(s: Vector, p: Vector, acceleration: float, uncertainty: float, dt: float) -> None:
    """Speed by the acceleration, known to ``uncertainty``; every other state drifts.

    Pads drift fast while pressed, slowly while they cool.
    """
    c = COVARIANCE
    s[SPEED] = max(s[SPEED] + dt * acceleration, 0.0)
    for j in range(N):
        s[c + SPEED * N + j] -= dt * (s[c + BIAS * N + j] + GRAVITY_MPS2 * s[c + GRADE * N + j])
    for j in range(N):
        s[c + j * N + SPEED] -= dt * (s[c + j * N + BIAS] + GRAVITY_MPS2 * s[c + j * N + GRADE])
    s[c] += uncertainty**2 * dt * dt + 1e-8
    s[c + BIAS * N + BIAS] += p[Q_BIAS] * dt
    s[c + GRADE * N + GRADE] += p[Q_GRADE] * dt
    s[c + STIFFNESS * N + STIFFNESS] += p[Q_STIFF] * dt
    for i in range(4):
        for j in range(4):
            same_axle = 1.0 if (i < 2) == (j < 2) else -1.0
            at = c + (FRICTION + i) * N + FRICTION + j
            if s[PRESSURE_LAG + i] > APPLIED_PA and s[PRESSURE_LAG + j] > APPLIED_PA:
                s[at] += dt * (p[Q_COMMON] + same_axle * p[Q_AXLE] + (p[Q_SINGLE] if i == j else 0.0))
            elif s[at] < p[START + 6]:
                s[at] += dt * p[Q_RELEASED]


@helper
def correct(
    s: Vector, h: Vector, residual: float, variance: float, gate: float, hold_mass: bool, hold_pads: bool,
    speed_only: bool,
) -> bool:  # fmt: skip
    """One scalar measurement: gain, gate, symmetric covariance. Held states keep their value and their uncertainty.

    With a gain K that is zero in the held rows, P' = P - K (P h)^T - (P h) K^T + S K K^T (Schmidt's consider states).
    """
    ph = np.empty(N)
    total = variance
    for i in range(N):
        row = 0.0
        for j in range(N):
            if h[j] != 0.0:
                row += s[COVARIANCE + i * N + j] * h[j]
        ph[i] = row
    for i in range(N):
        total += h[i] * ph[i]
    if residual * residual > gate * gate * total:
        return False
    k = ph / total
    if hold_mass:
        k[MASS] = 0.0
    if hold_pads:
        for i in range(4):
            k[FRICTION + i] = 0.0
    if speed_only:
        k[1:] = 0.0
    for i in range(N):
        s[i] += k[i] * residual
    for i in range(N):
        for j in range(i + 1):
            value = s[COVARIANCE + i * N + j] - k[i] * ph[j] - ph[i] * k[j] + total * k[i] * k[j]
            s[COVARIANCE + i * N + j] = value
            s[COVARIANCE + j * N + i] = value
    return True


@helper
def keep_in_bounds(s: Vector) -> None:
    """Hold every estimate where it can make sense."""
    for i in range(4):
        s[FRICTION + i] = min(max(s[FRICTION + i], 0.05), 1.2)
        s[RADIUS + i] = min(max(s[RADIUS + i], 0.97), 1.03)
    s[MASS] = min(max(s[MASS], 0.7), 1.5)
    s[STIFFNESS] = min(max(s[STIFFNESS], 0.3), 3.0)
    s[AXLE] = min(max(s[AXLE], -0.3), 0.3)
