"""Fixed steps of the model: semi-implicit for everyday use, Runge-Kutta for reference."""

import numpy as np
from numpy.typing import NDArray

from plant.compiled import equation
from plant.equations import derivative
from plant.vectors import RATES, P, X

Vector = NDArray[np.float64]
N = RATES.size
SEMI_IMPLICIT = 0
RUNGE_KUTTA_4 = 1


@equation
def semi_implicit_step(
    x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, step_s: float, work: Vector, y: Vector
) -> None:
    """One step with one evaluation: each state implicit in its own decay, positions driven by the new speeds.

    A Rosenbrock-Euler step with a diagonal Jacobian, made symplectic where two states swing against each other
    (body on springs, wheel on tyre, pressure loop).
    """
    dx, decay, gain = work[0], work[1], work[2]
    derivative(x, u, cut, switch, p, road, dx, decay, gain, y)
    for i in range(N):
        dx[i] *= step_s / (1.0 + step_s * decay[i])
    speed, lateral, yaw_rate = dx[X.speed_mps], dx[X.lateral_speed_mps], dx[X.yaw_rate_rad_s]
    cos_yaw, sin_yaw = np.cos(x[X.yaw_rad]), np.sin(x[X.yaw_rad])
    dx[X.x_m] += step_s * (speed * cos_yaw - lateral * sin_yaw)
    dx[X.y_m] += step_s * (speed * sin_yaw + lateral * cos_yaw)
    dx[X.yaw_rad] += step_s * yaw_rate
    dx[X.distance_m] += step_s * speed * np.sign(x[X.speed_mps])
    for i in range(3):
        dx[X.heave_m + i] += step_s * dx[X.heave_rate_mps + i]
    for i in range(4):
        dx[X.pressure_pa + i] += step_s * dx[X.pressure_rate_pa_s + i]
        dx[X.wheel_angle_rad + i] += step_s * dx[X.wheel_speed_rad_s + i]
        swing = p[P.wheel_rolling_radius_m] * dx[X.wheel_speed_rad_s + i] - speed
        dx[X.slip + i] += step_s * swing * gain[i] / (1.0 + step_s * decay[X.slip + i])
    for i in range(N):
        x[i] += dx[i]


@equation
def runge_kutta_step(
    x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, step_s: float, work: Vector, y: Vector
) -> None:
    """One classical fourth-order step; ``y`` holds the outputs at its start."""
    k1, k2, k3, k4, trial, spare, more = work[0], work[1], work[2], work[3], work[4], work[5], work[6]
    derivative(x, u, cut, switch, p, road, k1, spare, more, y)
    for i in range(N):
        trial[i] = x[i] + 0.5 * step_s * k1[i]
    derivative(trial, u, cut, switch, p, road, k2, spare, more, work[7])
    for i in range(N):
        trial[i] = x[i] + 0.5 * step_s * k2[i]
    derivative(trial, u, cut, switch, p, road, k3, spare, more, work[7])
    for i in range(N):
        trial[i] = x[i] + step_s * k3[i]
    derivative(trial, u, cut, switch, p, road, k4, spare, more, work[7])
    for i in range(N):
        x[i] += step_s / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
