"""The two measurements: the force balance of the car, the speed and slip of each wheel."""

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import helper
from ecu.law.gravity import GRAVITY_MPS2
from ecu.law.joint.kalman import correct
from ecu.law.joint.layout import (
    AXLE,
    BIAS,
    FRICTION,
    GATE,
    GRADE,
    MASS,
    P_ARM,
    P_GAIN,
    P_INERTIA,
    P_MASS,
    P_PEAK,
    P_RADIUS,
    P_ROLL,
    P_SPEED_MIN,
    P_STIFF,
    P_STIFF_SLOPE,
    P_TOOTH,
    P_WHEEL_LAG,
    PRESSURE_LAG,
    R_ACC,
    R_ALIGN,
    R_WHEEL,
    RADIUS,
    REJECTED_S,
    ROAD,
    SPEED,
    STIFFNESS,
    N,
)
from ecu.law.joint.motion import expected_acceleration
from ecu.law.joint.torque import wheel_force

Vector = NDArray[np.float64]

REJECT_S = 0.5
MASS_FORCE_SHARE = 0.7  # m/s2 of steady motor drive or drag from which on the mass is learned
CURVATURE = 0.38  # extra slip near the grip limit, kappa = F / C (1 + 0.38 (F / D)^2): the Magic Formula to third order


@helper
def balance_forces(
    s: Vector, p: Vector, ax: float, ay: float, side_n: float, force: float, force_rate: float, applied: bool,
    dt: float,
) -> None:  # fmt: skip
    """Force balance: what the body feels against what the wheels give (`expected_acceleration`).

    A sudden change is the road's before it is the pads': it is believed only after `REJECT_S`.
    """
    mass = p[P_MASS] * s[MASS]
    turn = 4.0 * p[P_INERTIA] / (p[P_RADIUS] * p[P_ARM])
    predicted = expected_acceleration(s, p, force, side_n) + s[BIAS]
    change = abs(p[R_ALIGN] * force_rate / mass)
    drive = not applied and abs(force) > MASS_FORCE_SHARE * mass and change < p[R_ACC]
    h = np.zeros(N)
    h[BIAS] = 1.0
    h[GRADE] = turn * GRAVITY_MPS2 / (mass + turn)
    if drive:
        h[MASS] = -(predicted - s[BIAS] + GRAVITY_MPS2 * p[P_ROLL]) * p[P_MASS] / (mass + turn)
    for i in range(4):
        gain = p[P_GAIN] if i < 2 else p[P_GAIN + 1]
        h[FRICTION + i] = -gain * s[PRESSURE_LAG + i] / p[P_ARM] / (mass + turn)
    variance = p[R_ACC] ** 2 + change * change + (0.05 * ay) ** 2
    gate = p[GATE] if p[ROAD] > 0.5 and s[REJECTED_S] < REJECT_S else 1e6
    if correct(s, h, ax - predicted, variance, gate, not drive, not applied, False):
        s[REJECTED_S] = 0.0
    else:
        s[REJECTED_S] += dt


@helper
def compare_wheel_speed(
    s: Vector, p: Vector, i: int, omega: float, ground: float, load: float, acceleration: float, force_rate: float,
    learn: bool, applied: bool, speed_only: bool,
) -> None:  # fmt: skip
    """Wheel speed and its slip: omega = v (1 + kappa) / (R delta), kappa = F / C (1 + 0.38 (F / D)^2).

    ``ground`` is the speed under the wheel, m/s; the sensor shows it half a sample and half a tooth late.
    """
    end = 1.0 if i < 2 else -1.0
    gain = p[P_GAIN] if i < 2 else p[P_GAIN + 1]
    stiffness = load * (p[P_STIFF] + p[P_STIFF_SLOPE] * (load - 0.25 * p[P_MASS] * GRAVITY_MPS2))
    factor = s[STIFFNESS] + end * s[AXLE]
    force = wheel_force(s, p, i, load, acceleration)
    grip = force / (p[P_PEAK] * load)
    per_force = (1.0 + CURVATURE * min(grip * grip, 1.0)) / (stiffness * max(factor, 0.2))
    slip = force * per_force
    seen = ground - (p[P_WHEEL_LAG] + p[P_TOOTH] / ground) * acceleration
    rolling = p[P_RADIUS] * s[RADIUS + i]
    predicted = seen * (1.0 + slip) / rolling
    h = np.zeros(N)
    h[SPEED] = (1.0 + slip) / rolling
    h[STIFFNESS] = -seen * slip / (rolling * factor)
    h[AXLE] = end * h[STIFFNESS]
    h[RADIUS + i] = -predicted / s[RADIUS + i]
    if learn:
        h[FRICTION + i] = -seen * per_force * gain * s[PRESSURE_LAG + i] / (p[P_ARM] * rolling)
    slow = 0.0 if s[SPEED] > p[P_SPEED_MIN] else 0.1
    sigma = (p[R_WHEEL] * ground + 0.01 + 0.002 * abs(acceleration) + slow) / rolling
    sigma += p[R_ALIGN] * abs(force_rate) * 0.25 * per_force * seen / rolling
    correct(s, h, omega - predicted, sigma * sigma, p[GATE], True, not applied, speed_only)
