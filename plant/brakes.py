"""Friction brakes of all wheels: demand -> pressure -> clamping force -> torque, pad and disc."""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

import numpy as np
from numpy.typing import NDArray

from plant.brake_thermal import disc_temperature_rate
from plant.compiled import equation
from plant.friction import mu_rate, temperature_rate
from plant.hydraulics import pad_force, pressure_jerk, sliding_torque, windup_held
from plant.inject import J, inject_wheel
from plant.vectors import C, P, S, U, X, Y

Vector = NDArray[np.float64]


@equation
def per_axle(i: int, p: Vector, name: int) -> float:
    """Parameter of the wheel's axle; ``name`` is where the pair (front, rear) begins."""
    front, rear = p[name], p[name + 1]  # both read, and one taken: four wheels at once need no look-up
    return front if i < 2 else rear


@equation
def brakes(x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, y: Vector, wheels: int) -> None:
    """Rates of pressure, wind-up, pad and disc, and ``y.friction_torque_nm``."""
    ambient = p[P.friction_brake_ambient_k]
    stiffness, windup_s = p[P.wheel_brake_windup_nm_rad], p[P.wheel_brake_windup_time_s]
    for i in range(wheels):
        omega = x[X.wheel_speed_rad_s + i]
        rate = x[X.pressure_rate_pa_s + i]
        held_rate = min(max(rate, -p[P.ehb_release_rate_pa_s]), p[P.ehb_build_rate_pa_s])
        y[Y.rate + X.pressure_pa + i] = inject_wheel(held_rate, y, J.hydraulics_rate, i)
        demand = inject_wheel(u[U.pressure_demand_pa + i], y, J.hydraulics_demand, i)
        y[Y.rate + X.pressure_rate_pa_s + i] = pressure_jerk(
            min(max(demand, 0.0), p[P.ehb_max_pressure_pa]), x[X.pressure_pa + i], rate,
            p[P.ehb_natural_frequency_hz], p[P.ehb_damping_ratio], p[P.ehb_build_rate_pa_s],
            p[P.ehb_release_rate_pa_s],
        )  # fmt: skip
        own, measured = x[X.pressure_pa + i], u[U.pressure_pa + i]
        pressure = measured if cut[C.pressure + i] > 0.5 else own
        y[Y.pressure_pa + i] = pressure

        clamping = inject_wheel(pressure, y, J.brake_pressure, i)
        force = pad_force(
            clamping, per_axle(i, p, P.friction_brake_piston_area_m2),
            per_axle(i, p, P.friction_brake_threshold_pressure_pa), p[P.friction_brake_efficiency],
        )  # fmt: skip
        radius = per_axle(i, p, P.friction_brake_effective_radius_m)
        mu = x[X.pad_friction + i]
        acting = inject_wheel(mu * switch[S.pad_friction + i], y, J.friction_mu, i)
        sliding = sliding_torque(max(acting, 0.0), force, radius)
        limit = max(inject_wheel(sliding, y, J.brake_torque, i), 0.0) / stiffness
        held = windup_held(x[X.windup_rad + i], omega, windup_s, limit)
        sticks = abs(held) < limit
        torque = -stiffness * held
        y[Y.friction_torque_nm + i] = torque
        y[Y.rate + X.windup_rad + i] = (held - x[X.windup_rad + i]) / windup_s
        y[Y.decay_1_s + X.windup_rad + i] = 0.0 if sticks else 1.0 / windup_s
        damped = stiffness * windup_s / per_axle(i, p, P.wheel_inertia_kg_m2)
        y[Y.decay_1_s + X.wheel_speed_rad_s + i] = damped if sticks else 0.0

        power = force * radius * abs(omega)
        of_disc = p[P.pad_temperature_of_disc]
        pad_k, disc_k = x[X.pad_temperature_k + i], x[X.disc_temperature_k + i]
        y[Y.rate + X.pad_friction + i] = mu_rate(
            mu, power, of_disc * disc_k + (1.0 - of_disc) * pad_k, p[P.pad_a_1_ks], p[P.pad_b_1_j], p[P.pad_epsilon_w]
        )
        y[Y.decay_1_s + X.pad_friction + i] = p[P.pad_b_1_j] * (power + p[P.pad_epsilon_w])
        y[Y.rate + X.pad_temperature_k + i] = temperature_rate(
            pad_k, power * (1.0 + p[P.pad_heating_with_mu] * (mu - 1.0)), ambient, p[P.pad_c_1_s],
            per_axle(i, p, P.pad_gamma_k_w),
        )  # fmt: skip
        y[Y.rate + X.disc_temperature_k + i] = disc_temperature_rate(
            disc_k, -torque * omega, abs(x[X.speed_mps]), ambient, per_axle(i, p, P.friction_brake_heat_capacity_j_k),
            per_axle(i, p, P.friction_brake_cooling_w_k), per_axle(i, p, P.friction_brake_cooling_speed_ws_m_k),
        )  # fmt: skip
