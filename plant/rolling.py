"""Long steps of a car that rolls: exact in each state's own decay, and in what swings in pairs."""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from math import pi

import numpy as np
from numpy.typing import NDArray

from plant.brakes import per_axle
from plant.compiled import EFFECTS, equation, section
from plant.contact import rolling_radius
from plant.equations import derivative
from plant.fastmath import exp
from plant.hydraulics import pressure_jerk
from plant.injection.apply import extra_states_move
from plant.integrate import N_ALL, N, hold_pressure_rates
from plant.phi import EXPONENT_LIMIT, phi_1, phi_2, phi_of_pair
from plant.vectors import CUT_PARTS, P, U, X, Y

Vector = NDArray[np.float64]
ROLLING_MPS = 3.0
"""Below, wheels on their brakes and tyres swing in threes."""
CREEPING_S = 5e-3
"""Longest step of a car that neither rolls on nor stands: a light wheel on its tyre swings too fast for more, and is
hardly damped where it is slow. Who asks for a longer one of a car that stands knows that it no longer swings."""
_STANDS_MPS, _STANDS_RAD_S = 3e-3, 1e-2
"""Speeds of the body (m/s or rad/s) and of the wheels below which a car stands: it may creep on its tyres, but what
swings in threes has died away."""
_SLIDES = 0.08  # slip, either way, beyond which a tyre may be past its peak
_HUB_TRAVEL, _HUB_RATE = (X.hub_m, X.hub_rate_mps) if EFFECTS else (0, 0)
_WHEEL, _PRESSURE, _HUB = 0, 4, 8
"""Pairs: a wheel on its tyre, a pressure loop, a hub on its mount, four each."""
_M11, _M12, _M21, _M22, _ONE, _ONE_M, _TWO, _TWO_M = range(0, 96, 12)
"""Where their numbers lie: the block of the Jacobian, phi_1 and phi_2 as a I + b M."""


@equation
def long_step_valid(x: Vector, u: Vector, p: Vector, step_s: float) -> bool:
    """Whether `rolling_step` is good for this step: `plant.integrate.exponential_step` is where a car creeps, a
    wheel may lock, or a pressure comes to its limits."""
    free = (abs(x[X.speed_mps]) > ROLLING_MPS) | ((step_s > CREEPING_S) & _stands(x))
    build, release = p[P.ehb_build_rate_pa_s], p[P.ehb_release_rate_pa_s]
    for i in range(4):
        rate = x[X.pressure_rate_pa_s + i]
        demand = min(max(u[U.pressure_demand_pa + i], 0.0), p[P.ehb_max_pressure_pa])
        jerk = pressure_jerk(
            demand, x[X.pressure_pa + i], rate, p[P.ehb_natural_frequency_hz], p[P.ehb_damping_ratio], build, release
        )
        ahead = rate + step_s * jerk
        free &= max(abs(x[X.slip + i]), abs(x[X.side_slip + i])) < _SLIDES
        free &= (max(rate, ahead) < build) & (min(rate, ahead) > -release)
    return free


@equation
def _stands(x: Vector) -> bool:
    """Whether body and wheels are at rest."""
    body, wheels = 0.0, 0.0
    for i in range(X.speed_mps, X.heave_m):
        body = max(body, abs(x[i]))
    for i in range(X.heave_rate_mps, X.wheel_speed_rad_s):
        body = max(body, abs(x[i]))
    for i in range(4):
        wheels = max(wheels, abs(x[X.wheel_speed_rad_s + i]))
    return (body < _STANDS_MPS) & (wheels < _STANDS_RAD_S)


@section
def rolling_step(
    x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, step_s: float, work: Vector, y: Vector
) -> None:
    """One step of second order with two evaluations; arguments of `plant.integrate.runge_kutta_step`.

    Exponential Runge-Kutta ETD2RK (Cox and Matthews 2002, J. Comput. Phys. 176, eqs 20 to 22). Its linear part is the
    diagonal of the Jacobian, and in blocks of two: a wheel on its tyre (slip and wheel speed, 20 to 30 Hz), the loop of
    a pressure, a hub on its mount.
    """
    trial, mean, stage, pairs, ahead = work[0], work[1], work[2], work[3], work[4]
    wheels = cut.size // CUT_PARTS
    extra = extra_states_move(p)
    last = N_ALL if extra else N
    derivative(x, u, cut, switch, p, road, y)
    for i in range(last):
        z = step_s * y[Y.decay_1_s + i]
        one = phi_1(z, exp(-min(z, EXPONENT_LIMIT)))
        mean[i] = phi_2(z, one)
        trial[i] = x[i] + step_s * one * y[Y.rate + i]
    omega = 2.0 * pi * p[P.ehb_natural_frequency_hz]
    for i in range(wheels):
        radius = rolling_radius(i, p, y)
        spun = -radius * y[Y.slip_stiffness_n + i] / per_axle(i, p, P.wheel_inertia_kg_m2)
        _set_matrix(
            _WHEEL + i, -step_s * y[Y.decay_1_s + X.slip + i], step_s * radius * y[Y.slip_gain_1_m + i],
            step_s * spun, -step_s * y[Y.decay_1_s + X.wheel_speed_rad_s + i], pairs,
        )  # fmt: skip
        _set_matrix(
            _PRESSURE + i, 0.0, step_s, -step_s * omega * omega, -step_s * 2.0 * p[P.ehb_damping_ratio] * omega, pairs
        )
    if extra:
        for i in range(wheels):
            swing = y[Y.hub_swing_1_s + i]
            _set_matrix(_HUB + i, 0.0, step_s, -step_s * swing * swing, -step_s * y[Y.decay_1_s + _HUB_RATE + i], pairs)
    for k in range((3 if extra else 2) * wheels):  # of one vector alone, so that eight go through at once
        _set_functions(k, pairs)
    for i in range(wheels):
        _begin(_WHEEL, X.slip, X.wheel_speed_rad_s, i, step_s, x, y, trial, pairs)
        _begin(_PRESSURE, X.pressure_pa, X.pressure_rate_pa_s, i, step_s, x, y, trial, pairs)
    if extra:
        for i in range(wheels):
            _begin(_HUB, _HUB_TRAVEL, _HUB_RATE, i, step_s, x, y, trial, pairs)
    trial[X.time_s] = x[X.time_s] + step_s
    derivative(trial, u, cut, switch, p, road, stage)
    for i in range(last):
        grown = stage[Y.rate + i] - y[Y.rate + i] + y[Y.decay_1_s + i] * (trial[i] - x[i])
        ahead[i] = trial[i] + step_s * mean[i] * grown
    for i in range(wheels):
        _end(_WHEEL, X.slip, X.wheel_speed_rad_s, i, step_s, x, y, trial, stage, pairs, ahead)
        _end(_PRESSURE, X.pressure_pa, X.pressure_rate_pa_s, i, step_s, x, y, trial, stage, pairs, ahead)
    if extra:
        for i in range(wheels):
            _end(_HUB, _HUB_TRAVEL, _HUB_RATE, i, step_s, x, y, trial, stage, pairs, ahead)
    _carry_body(p, step_s, extra, y, trial, stage, mean, ahead)
    for i in range(last):
        x[i] = ahead[i]
    hold_pressure_rates(x, p)


@equation
def _set_matrix(k: int, m11: float, m12: float, m21: float, m22: float, pairs: Vector) -> None:
    """The block of the Jacobian of pair ``k``, times the step."""
    pairs[_M11 + k], pairs[_M12 + k], pairs[_M21 + k], pairs[_M22 + k] = m11, m12, m21, m22


@equation
def _set_functions(k: int, pairs: Vector) -> None:
    """phi_1 and phi_2 of the block of pair ``k``."""
    m11, m12, m21, m22 = pairs[_M11 + k], pairs[_M12 + k], pairs[_M21 + k], pairs[_M22 + k]
    one, one_m, two, two_m = phi_of_pair(m11 + m22, m11 * m22 - m12 * m21)
    pairs[_ONE + k], pairs[_ONE_M + k], pairs[_TWO + k], pairs[_TWO_M + k] = one, one_m, two, two_m


@equation
def _begin(
    at: int, one: int, other: int, i: int, step_s: float, x: Vector, y: Vector, trial: Vector, pairs: Vector
) -> None:
    """The trial state of a pair of states."""
    k = at + i
    mean, mean_m = pairs[_ONE + k], pairs[_ONE_M + k]
    m11, m12, m21, m22 = pairs[_M11 + k], pairs[_M12 + k], pairs[_M21 + k], pairs[_M22 + k]
    f, g = step_s * y[Y.rate + one + i], step_s * y[Y.rate + other + i]
    trial[one + i] = x[one + i] + mean * f + mean_m * (m11 * f + m12 * g)
    trial[other + i] = x[other + i] + mean * g + mean_m * (m21 * f + m22 * g)


@equation
def _end(
    at: int, one: int, other: int, i: int, step_s: float, x: Vector, y: Vector, trial: Vector, stage: Vector,
    pairs: Vector, ahead: Vector,
) -> None:  # fmt: skip
    """A pair at the end of the step."""
    k = at + i
    mean, mean_m = pairs[_TWO + k], pairs[_TWO_M + k]
    m11, m12, m21, m22 = pairs[_M11 + k], pairs[_M12 + k], pairs[_M21 + k], pairs[_M22 + k]
    moved, moved_too = trial[one + i] - x[one + i], trial[other + i] - x[other + i]
    f = step_s * (stage[Y.rate + one + i] - y[Y.rate + one + i]) - m11 * moved - m12 * moved_too
    g = step_s * (stage[Y.rate + other + i] - y[Y.rate + other + i]) - m21 * moved - m22 * moved_too
    ahead[one + i] = trial[one + i] + mean * f + mean_m * (m11 * f + m12 * g)
    ahead[other + i] = trial[other + i] + mean * g + mean_m * (m21 * f + m22 * g)


@equation
def _carry_body(
    p: Vector, step_s: float, extra: bool, y: Vector, trial: Vector, stage: Vector, mean: Vector, ahead: Vector
) -> None:  # fmt: skip
    """The body goes on with the forces at the slips that are reached.

    Slips of the trial state know nothing of what the body does over the step, which is as stiff: a car that rolls
    freely would lose a hundredth too little speed.
    """
    along, across, turning = 0.0, 0.0, 0.0
    half = 0.5 * step_s
    for i in range(4):
        axle = 0 if i < 2 else 1
        wheel_x = p[P.vehicle_cog_to_axle_m] if i < 2 else -p[P.vehicle_cog_to_axle_m + 1]
        wheel_y = (0.5 - i % 2) * p[P.vehicle_track_m + axle]
        slip, side_slip = ahead[X.slip + i] - trial[X.slip + i], ahead[X.side_slip + i] - trial[X.side_slip + i]
        force = 0.5 * (y[Y.slip_stiffness_n + i] + stage[Y.slip_stiffness_n + i]) * slip
        cross = -0.5 * (y[Y.side_stiffness_n + i] + stage[Y.side_stiffness_n + i]) * side_slip
        along += force
        if extra:
            ahead[_HUB_RATE + i] += half * y[Y.hub_push_1_kg + i] * force
        across += cross
        turning += wheel_x * cross - wheel_y * force
    mass, height = p[P.vehicle_mass_kg], p[P.vehicle_cog_height_m]
    ahead[X.speed_mps] += half * along / mass
    ahead[X.lateral_speed_mps] += half * across / mass
    ahead[X.yaw_rate_rad_s] += half * turning / p[P.vehicle_yaw_inertia_kg_m2]
    ahead[X.pitch_rate_rad_s] -= half * height * along / p[P.vehicle_pitch_inertia_kg_m2]
    ahead[X.roll_rate_rad_s] += half * height * across / p[P.vehicle_roll_inertia_kg_m2]
    forward, side = X.imu_longitudinal_mps2, X.imu_lateral_mps2
    ahead[forward] += step_s * mean[forward] * y[Y.decay_1_s + forward] * along / mass
    ahead[side] += step_s * mean[side] * y[Y.decay_1_s + side] * across / mass
