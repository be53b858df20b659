"""Friction brakes of the reference car: pressure, clamping, pad friction, disc; with what may be hidden in them."""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from math import exp, sin, tanh

import numpy as np
from numpy.typing import NDArray

from hil.validation.reference_car.car import REFERENCE_MU, Car
from hil.validation.reference_car.compiled import equation
from hil.validation.reference_car.strengths import LAW_APPLY_TIME, LAW_BUMP_PRESSURE, LAW_CUBIC_MU, E, S, Y

Vector = NDArray[np.float64]
FADE_K, COLD_K, GROWTH_K = 573.15, 423.15, 423.15
PRESSURE_REFERENCE_PA, DROOP_PA = 3.0e6, 2.4e7
BEDDING_J, DRYING_J = 1.0e6, 3.0e4
HOT_SPOT_K, HOT_SPOTS = 523.15, 10.0
STICK_RAD_S = 1.0
LINE_STIFFNESS_M3_PA, ATMOSPHERE_PA = 5.0e-13, 1.0e5


@equation
def pressure_rate_limits(i: int, car: Car, e: Vector) -> tuple[float, float]:
    """How fast the hydraulics of a wheel build and release pressure, Pa/s, with what is hidden in them."""
    limit = (1.0 + e[E.ehb_rate_limit, i]) / (1.0 + e[E.fluid_temp, i]) ** 2
    return car.ehb_build_rate_pa_s * limit, car.ehb_release_rate_pa_s * limit


@equation
def brake_pressure_rates(x: Vector, i: int, demand_pa: float, car: Car, e: Vector, dx: Vector) -> None:
    """Rates of the pressure of one wheel: second order behind a rate limit; Lee et al., SAE 2015 (M), values per set.

    p'' = w^2 (p* - p) - 2 zeta w p'. Air in the line: dV/dp = s0 + V_air pa / (p + pa)^2, which divides the rate
    (Limpert, Brake Design and Safety). ``fluid_temp``: viscosity stretches lag and flow, w/(1+e), rates/(1+e)^2;
    ``ehb_deadband``: the loop answers what the error has beyond the band; ``valve_leak``: p' = -k p beside.
    """
    p = x[S.pressure_pa + i]
    w = 6.283185307 * car.ehb_frequency_hz * (1.0 + e[E.ehb_bandwidth, i]) / (1.0 + e[E.fluid_temp, i])
    zeta = car.ehb_damping
    build, release = pressure_rate_limits(i, car, e)
    ceiling = car.ehb_max_pressure_pa
    target = min(max(demand_pa, 0.0), ceiling) * (
        1.0 - e[E.accumulator, i] * min(x[S.applied_pa_s + i] / DROOP_PA, 1.0)
    )
    error = target - p
    error -= min(max(error, -e[E.ehb_deadband, i]), e[E.ehb_deadband, i])
    rate = min(max(x[S.pressure_rate_pa_s + i], -release), build)
    jerk = w * w * error - 2.0 * zeta * w * rate
    if (rate >= build and jerk > 0.0) or (rate <= -release and jerk < 0.0):
        jerk = 0.0
    air = e[E.air_in_line, i] * ATMOSPHERE_PA / (p + ATMOSPHERE_PA) ** 2
    slow = LINE_STIFFNESS_M3_PA / (LINE_STIFFNESS_M3_PA + air)
    dx[S.pressure_pa + i] = rate * slow - e[E.valve_leak, i] * p
    dx[S.pressure_rate_pa_s + i] = jerk
    dx[S.applied_pa_s + i] = max(rate, 0.0)
    lag = e[E.pressure_location, i]
    dx[S.line_pa + i] = (p - x[S.line_pa + i]) / lag if lag > 1e-4 else 0.0


@equation
def friction_factor(x: Vector, i: int, pressure_pa: float, car: Car, e: Vector, law: int, since_s: float) -> float:
    """What multiplies the pads' friction coefficient, each row of the effect catalogue, section C.

    Fade: 1 - k (T - Tf)+.  Cold: less below 423 K.  Speed: 1 + k v, v at the rim.  Pressure: (p/p0)^-n.
    Leading end of the pad: 1 + e sign(w).
    Bedding: 1 - d exp(-E/E0).  Glazing: 1 - d E.  Water: 1 - w exp(-E/E1).  Judder: 1 + A sin(n th).
    """
    disc, rim = x[S.disc_k + i], abs(x[S.omega_rad_s + i]) * car.rolling_radius_m
    factor = (1.0 + e[E.pad_mu_gain, i]) * (1.0 - e[E.stuck_corner, i])
    factor *= 1.0 + e[E.caliper_asymmetry, i] * tanh(x[S.omega_rad_s + i] / STICK_RAD_S)
    factor *= max(1.0 - e[E.pad_temp_fade, i] * max(disc - FADE_K, 0.0), 0.1)
    factor *= 1.0 - e[E.mu_warmup, i] * min(max((COLD_K - disc) / 100.0, 0.0), 1.0)
    factor *= 1.0 + e[E.mu_speed, i] * rim
    if e[E.mu_pressure, i] != 0.0:
        factor *= (max(pressure_pa, 1.0e5) / PRESSURE_REFERENCE_PA) ** (-e[E.mu_pressure, i])
    if e[E.bedding, i] != 0.0:
        factor *= 1.0 - e[E.bedding, i] * exp(-x[S.friction_j + i] / BEDDING_J)
    factor *= 1.0 - e[E.glazing, i] * 1e-6 * x[S.friction_j + i]
    if e[E.water, i] != 0.0:
        factor *= 1.0 - e[E.water, i] * exp(-x[S.friction_j + i] / DRYING_J)
    if e[E.dtv_judder, i] != 0.0:
        factor *= 1.0 + e[E.dtv_judder, i] * sin(x[S.angle_rad + i] + 0.4 + i)
    if e[E.hot_spot, i] != 0.0:
        hot = min(max((disc - HOT_SPOT_K) / 100.0, 0.0), 1.0)
        factor *= 1.0 + e[E.hot_spot, i] * hot * sin(HOT_SPOTS * x[S.angle_rad + i])
    if law == LAW_CUBIC_MU:
        factor *= 1.0 + e[E.unlisted, i] * (rim / 20.0) ** 3
    elif law == LAW_BUMP_PRESSURE:
        factor *= 1.0 + e[E.unlisted, i] * exp(-(((pressure_pa - 2.0e6) / 6.0e5) ** 2))
    elif law == LAW_APPLY_TIME:
        factor *= 1.0 + e[E.unlisted, i] * (since_s * exp(1.0 - since_s))
    return factor


@equation
def friction_brake(
    x: Vector, i: int, car: Car, e: Vector, law: int, play_pa: float, since_s: float, dx: Vector, y: Vector
) -> None:
    """Torque of one brake and the rates of pad and disc.

    T = g mu / REFERENCE_MU (p - p0)+, opposing the rotation; the sign is tanh(w / 1 rad/s).
    Ricciardi et al., (3): mu' = -[b (N v + eps) mu - a T]; (4): T' = -c [(T - T0) - gamma N v], as printed.
    Disc: C T' = |torque| w - (h0 + h1 v)(T - Tamb), Limpert. Hysteresis: the force lags the pressure by a play.
    """
    front = i < 2
    omega = x[S.omega_rad_s + i]
    p = x[S.line_pa + i] if e[E.pressure_location, i] > 1e-4 else x[S.pressure_pa + i]
    width = e[E.pressure_hysteresis, i]
    clamping = min(max(play_pa, p - width), p + width)
    clamping += e[E.thermal_growth, i] * max(x[S.disc_k + i] - GROWTH_K, 0.0)
    over = max(clamping - car.threshold_pressure_pa - e[E.threshold, i], 0.0)
    gain = car.brake_gain_front_nm_pa if front else car.brake_gain_rear_nm_pa
    power = gain / (2.0 * REFERENCE_MU) * over * abs(omega)
    acting = x[S.mu + i] * friction_factor(x, i, p, car, e, law, since_s)
    magnitude = gain / REFERENCE_MU * acting * over + e[E.residual_drag, i]
    torque = -magnitude * tanh(omega / STICK_RAD_S)
    y[Y.brake_nm + i] = torque

    quick = 1.0 + e[E.mu_nv_dynamics, i]
    dx[S.mu + i] = -quick * (
        car.pad_b_1_j * (power + car.pad_epsilon_w) * x[S.mu + i] - car.pad_a_1_ks * x[S.pad_k + i]
    )
    gamma = car.pad_gamma_front_k_w if front else car.pad_gamma_rear_k_w
    dx[S.pad_k + i] = -car.pad_c_1_s * (x[S.pad_k + i] - car.ambient_k - gamma * power)
    still = car.disc_cooling_front_w_k if front else car.disc_cooling_rear_w_k
    moving = car.disc_cooling_speed_front_ws_m_k if front else car.disc_cooling_speed_rear_ws_m_k
    heat = car.disc_heat_front_j_k if front else car.disc_heat_rear_j_k
    loss = (still + moving * abs(x[S.speed_mps])) * (x[S.disc_k + i] - car.ambient_k)
    dx[S.disc_k + i] = (-torque * omega - loss) / heat
    dx[S.friction_j + i] = -torque * omega
