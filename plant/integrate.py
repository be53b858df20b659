"""Fixed steps of the model: semi-implicit for everyday use, Runge-Kutta for reference, exponential for long steps."""

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from plant.compiled import equation, section
from plant.contact import rolling_radius
from plant.equations import derivative
from plant.fastmath import exp
from plant.injection.apply import extra_states_move
from plant.phi import EXPONENT_LIMIT, SMALL, phi_1, phi_2
from plant.vectors import BASE_RATES, OUTPUT, RATES, STATE, P, X, Y

Vector = NDArray[np.float64]
N = BASE_RATES.size
N_ALL = RATES.size  # with the extra states of effects
SEMI_IMPLICIT = 0
RUNGE_KUTTA_4 = 1
EXPONENTIAL = 2
WORK_SHAPE = (5, max(STATE.size, OUTPUT.size))


@equation
def hold_pressure_rates(x: Vector, p: Vector) -> None:
    """Bring rates of pressure back to their limits: one passes its limit within a step.

    See docs/decisions/simulation-speed.md.
    """
    build, release = p[P.ehb_build_rate_pa_s], p[P.ehb_release_rate_pa_s]
    for i in range(4):
        x[X.pressure_rate_pa_s + i] = min(max(x[X.pressure_rate_pa_s + i], -release), build)


@section
def semi_implicit_step(
    x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, step_s: float, y: Vector
) -> None:
    """One step with one evaluation: each state implicit in its own decay, positions driven by the new speeds.

    A Rosenbrock-Euler step with a diagonal Jacobian, made symplectic where two states swing against each other
    (body on springs, wheel on tyre, pressure loop). ``y`` holds the outputs at its start; its rates are used up.
    """
    derivative(x, u, cut, switch, p, road, y)
    for i in range(N):
        y[Y.rate + i] *= step_s / (1.0 + step_s * y[Y.decay_1_s + i])
    d = Y.rate
    speed, lateral = y[d + X.speed_mps], y[d + X.lateral_speed_mps]
    cos_yaw, sin_yaw = cos(x[X.yaw_rad]), sin(x[X.yaw_rad])
    y[d + X.x_m] += step_s * (speed * cos_yaw - lateral * sin_yaw)
    y[d + X.y_m] += step_s * (speed * sin_yaw + lateral * cos_yaw)
    y[d + X.yaw_rad] += step_s * y[d + X.yaw_rate_rad_s]
    y[d + X.distance_m] += step_s * (speed if x[X.speed_mps] >= 0.0 else -speed)
    for i in range(3):
        y[d + X.heave_m + i] += step_s * y[d + X.heave_rate_mps + i]
    for i in range(4):
        swing = rolling_radius(i, p, y) * y[d + X.wheel_speed_rad_s + i] - speed
        damped = 1.0 + step_s * y[Y.decay_1_s + X.slip + i]
        y[d + X.slip + i] += step_s * swing * y[Y.slip_gain_1_m + i] / damped
        y[d + X.pressure_pa + i] += step_s * y[d + X.pressure_rate_pa_s + i]
        y[d + X.wheel_angle_rad + i] += step_s * y[d + X.wheel_speed_rad_s + i]
    for i in range(N):
        x[i] += y[d + i]
    if extra_states_move(p):
        for i in range(N, N_ALL):
            x[i] += step_s * y[d + i] / (1.0 + step_s * y[Y.decay_1_s + i])
    hold_pressure_rates(x, p)


@section
def exponential_step(
    x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, step_s: float, work: Vector, y: Vector
) -> None:
    """One step of fourth order that is exact in each state's own decay: for long steps near standstill.

    Exponential Runge-Kutta ETDRK4 (Cox and Matthews 2002, J. Comput. Phys. 176, eqs 26 to 29) with the diagonal of the
    Jacobian, written for the change over the step. Where nothing decays it is `runge_kutta_step`, whose arguments it
    has.
    """
    trial, total, stage, half, mean = work[0], work[1], work[2], work[3], work[4]
    last = N_ALL if extra_states_move(p) else N
    derivative(x, u, cut, switch, p, road, y)
    for i in range(last):
        z = 0.5 * step_s * y[Y.decay_1_s + i]
        half[i] = exp(-min(z, EXPONENT_LIMIT))
        mean[i] = 0.5 * step_s * phi_1(z, half[i])
        trial[i] = x[i] + mean[i] * y[Y.rate + i]
    trial[X.time_s] = x[X.time_s] + 0.5 * step_s
    derivative(trial, u, cut, switch, p, road, stage)
    for i in range(last):
        total[i] = stage[Y.rate + i] + y[Y.decay_1_s + i] * (trial[i] - x[i])
        trial[i] = x[i] + mean[i] * total[i]
    derivative(trial, u, cut, switch, p, road, stage)
    for i in range(last):
        again = stage[Y.rate + i] + y[Y.decay_1_s + i] * (trial[i] - x[i])
        total[i] += again
        trial[i] = x[i] + half[i] * mean[i] * y[Y.rate + i] + mean[i] * (2.0 * again - y[Y.rate + i])
    trial[X.time_s] = x[X.time_s] + step_s
    derivative(trial, u, cut, switch, p, road, stage)
    for i in range(last):
        end = stage[Y.rate + i] + y[Y.decay_1_s + i] * (trial[i] - x[i])
        z = step_s * y[Y.decay_1_s + i]
        one = phi_1(z, half[i] * half[i])
        two = phi_2(z, one)
        three = (0.5 - two) / max(z, SMALL)
        three = three if z > SMALL else 1.0 / 6.0 - z / 24.0
        first = one - 3.0 * two + 4.0 * three
        x[i] += step_s * (first * y[Y.rate + i] + 2.0 * (two - 2.0 * three) * total[i] + (4.0 * three - two) * end)
    hold_pressure_rates(x, p)


@section
def runge_kutta_step(
    x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, step_s: float, work: Vector, y: Vector
) -> None:
    """One classical fourth-order step; ``y`` holds the outputs at its start, ``work`` has shape `WORK_SHAPE`."""
    trial, total, stage = work[0], work[1], work[2]
    last = N_ALL if extra_states_move(p) else N
    derivative(x, u, cut, switch, p, road, y)
    for i in range(last):
        total[i] = y[Y.rate + i]
        trial[i] = x[i] + 0.5 * step_s * y[Y.rate + i]
    trial[X.time_s] = x[X.time_s] + 0.5 * step_s
    for half in (0.5, 1.0):
        derivative(trial, u, cut, switch, p, road, stage)
        for i in range(last):
            total[i] += 2.0 * stage[Y.rate + i]
            trial[i] = x[i] + half * step_s * stage[Y.rate + i]
        trial[X.time_s] = x[X.time_s] + half * step_s
    derivative(trial, u, cut, switch, p, road, stage)
    for i in range(last):
        x[i] += step_s / 6.0 * (total[i] + stage[Y.rate + i])
    hold_pressure_rates(x, p)
