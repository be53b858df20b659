"""Equations of the car `dead_time`: a rigid body on four wheels, by the millisecond.

Body in the plane: Newton and Euler about the centre of gravity (Rajamani, Vehicle Dynamics and Control, 2.1 and 8.1).
Loads: static and aerodynamic share, transfer by the accelerations through one pole. Tyre without relaxation: with
slips kappa and tan(alpha) and stiffnesses per load C, force over load mu tanh(sigma / mu), sigma = |(C_x kappa,
C_y tan(alpha))|, along the slip. Motors and hydraulics: dead time, one pole, hydraulics with rates beside.
"""

from math import exp, hypot, tanh
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Vector = NDArray[np.float64]
STEP_S = 0.001
STANDING_MPS = 0.05
SLOWEST_MPS = 0.5  # of a slip's reference speed
G_MPS2 = 9.81


class Numbers(NamedTuple):
    """Numbers of the car; SI."""

    mass_kg: float = 1832.0
    wheelbase_m: float = 2.77
    cog_to_front_axle_m: float = 1.36
    cog_height_m: float = 0.575
    track_m: float = 1.58
    yaw_inertia_kg_m2: float = 2790.0
    drag_coefficient: float = 0.285
    frontal_area_m2: float = 2.44
    air_density_kg_m3: float = 1.19
    lift_front: float = 0.03
    lift_rear: float = 0.06
    rolling_resistance: float = 0.0102
    wheel_inertia_kg_m2: float = 1.75
    slip_stiffness: float = 21.0
    cornering_stiffness: float = 17.0
    tyre_friction: float = 1.04
    friction_by_load: float = -0.12
    load_pole_s: float = 0.1
    roll_share_front: float = 0.55
    steering_ratio: float = 15.4
    threshold_pressure_pa: float = 45e3
    ehb_dead_time_s: float = 0.022
    ehb_pole_s: float = 0.04
    ehb_build_pa_s: float = 22e6
    ehb_release_pa_s: float = 33e6
    motor_dead_time_s: float = 0.014
    motor_lag_s: float = 0.011
    disc_front_j_k: float = 2900.0
    disc_rear_j_k: float = 2050.0
    disc_cooling_w_k: float = 4.0
    disc_cooling_ws_m_k: float = 0.33
    ambient_k: float = 293.0
    wind_mps: float = 0.0
    grade: float = 0.0
    fade_front_1_k: float = 0.0
    fade_start_k: float = 573.0
    friction_speed_front_s_m: float = 0.0


class Corners(NamedTuple):
    """What each wheel (fl, fr, rl, rr) has of its own, (4,) each."""

    radius_m: Vector
    brake_gain_nm_pa: Vector
    drag_nm: Vector
    motor_gain: Vector


class Motion(NamedTuple):
    """What moved: time first, a row a millisecond; wheels are fl, fr, rl, rr."""

    speed_mps: Vector
    force_mps2: Vector
    side_mps2: Vector
    yaw_rate_rad_s: Vector
    omega_rad_s: Vector
    pressure_pa: Vector
    torque_nm: Vector
    disc_k: Vector
    load_n: Vector


@njit(cache=True, error_model="numpy")
def move(
    car: Numbers, corners: Corners, pressure_demand: Vector, torque_demand: Vector, steer: Vector, gust: Vector,
    slope: Vector, speed_mps: float, disc_k: float,
) -> Any:  # fmt: skip
    """Drive; gust (m/s2) is felt by an accelerometer, slope (m/s2) is g times the grade.

    Parameters
    ----------
    pressure_demand, torque_demand : (n, 4), Pa and N m; steer, gust, slope : (n,).

    Returns
    -------
    `Motion`; once the car stands it stays there.
    """
    n, dt = steer.size, STEP_S
    front, rear = car.cog_to_front_axle_m, car.wheelbase_m - car.cog_to_front_axle_m
    weight = car.mass_kg * G_MPS2 / car.wheelbase_m
    nominal_n = 0.25 * car.mass_kg * G_MPS2
    v, side, yaw = speed_mps, 0.0, 0.0
    transfer_x, transfer_y = 0.0, 0.0
    omega = speed_mps / corners.radius_m
    pressure, torque = pressure_demand[0].copy(), torque_demand[0].copy()
    disc = np.full(4, disc_k)
    load = np.zeros(4)
    ehb_late, motor_late = round(car.ehb_dead_time_s / dt), round(car.motor_dead_time_s / dt)
    ehb_step, motor_step = 1.0 - exp(-dt / car.ehb_pole_s), 1.0 - exp(-dt / car.motor_lag_s)
    speeds, along, across, yaws = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    omegas, pressures, torques, discs, loads = (
        np.zeros((n, 4)), np.zeros((n, 4)), np.zeros((n, 4)), np.zeros((n, 4)), np.zeros((n, 4)),
    )  # fmt: skip
    stands, gained = False, 0.0
    for k in range(n):
        air = 0.5 * car.air_density_kg_m3 * car.frontal_area_m2 * (v + car.wind_mps) * abs(v + car.wind_mps)
        angle = steer[k] / car.steering_ratio
        rises = slope[k] + G_MPS2 * car.grade
        force_x, force_y, moment = 0.0, 0.0, 0.0
        for i in range(4):
            is_front, left = i < 2, 1.0 if i % 2 == 0 else -1.0
            x = front if is_front else -rear
            y = left * 0.5 * car.track_m
            share = car.roll_share_front if is_front else 1.0 - car.roll_share_front
            load[i] = 0.5 * weight * (rear if is_front else front)
            load[i] -= (0.5 if is_front else -0.5) * car.mass_kg * car.cog_height_m * transfer_x / car.wheelbase_m
            load[i] -= left * share * car.mass_kg * car.cog_height_m * transfer_y / car.track_m
            load[i] -= 0.5 * (car.lift_front if is_front else car.lift_rear) * air
            load[i] = max(load[i], 1.0)
            # hydraulics and motor
            aim = pressure_demand[max(k - ehb_late, 0), i]
            step = ehb_step * (aim - pressure[i])
            pressure[i] += min(max(step, -car.ehb_release_pa_s * dt), car.ehb_build_pa_s * dt)
            torque[i] += motor_step * (torque_demand[max(k - motor_late, 0), i] - torque[i])
            # brake
            pads = corners.brake_gain_nm_pa[i] * max(pressure[i] - car.threshold_pressure_pa, 0.0)
            if is_front:
                fade = max(1.0 - car.fade_front_1_k * max(disc[i] - car.fade_start_k, 0.0), 0.2)
                pads *= fade * (1.0 + car.friction_speed_front_s_m * v)
            heat = car.disc_front_j_k if is_front else car.disc_rear_j_k
            cooling = (car.disc_cooling_w_k + car.disc_cooling_ws_m_k * v) * (0.67 if not is_front else 1.0)
            disc[i] += dt * (pads * omega[i] - cooling * (disc[i] - car.ambient_k)) / heat
            if stands:
                continue
            # tyre
            radius = corners.radius_m[i]
            vx, vy = v - y * yaw, side + x * yaw
            turned = angle if is_front else 0.0
            cos, sin = np.cos(turned), np.sin(turned)
            forward, sideways = cos * vx + sin * vy, cos * vy - sin * vx
            reference = max(forward, SLOWEST_MPS)
            slip_x = car.slip_stiffness * (omega[i] * radius - forward) / reference
            slip_y = -car.cornering_stiffness * sideways / reference
            sigma = hypot(slip_x, slip_y)
            grip = car.tyre_friction * (1.0 + car.friction_by_load * (load[i] / nominal_n - 1.0))
            secant = load[i] * (grip * tanh(sigma / grip) / sigma if sigma > 1e-9 else 1.0)
            long_n, lat_n = secant * slip_x, secant * slip_y
            force_x += cos * long_n - sin * lat_n
            force_y += sin * long_n + cos * lat_n
            moment += x * (sin * long_n + cos * lat_n) - y * (cos * long_n - sin * lat_n)
            # wheel; tyre stiffer than the step allows, so its force is that at the end: d(slip) = R d(omega) - d(v)
            against = pads + corners.drag_nm[i] + car.rolling_resistance * load[i] * radius
            stiff = dt * radius * secant * car.slip_stiffness / reference
            net = corners.motor_gain[i] * torque[i] - against - radius * long_n + stiff * gained
            omega[i] = max(omega[i] + dt * net / (car.wheel_inertia_kg_m2 + stiff * radius), 0.0)
        felt_x = (force_x - car.drag_coefficient * air) / car.mass_kg + gust[k]
        felt_y = force_y / car.mass_kg
        if stands:
            felt_x, felt_y = rises, 0.0
        else:
            gained = felt_x - rises + side * yaw
            v, side = v + dt * gained, side + dt * (felt_y - v * yaw)
            yaw += dt * moment / car.yaw_inertia_kg_m2
            if v < STANDING_MPS:
                stands, v, side, yaw = True, 0.0, 0.0, 0.0
                omega[:] = 0.0
        transfer_x += dt / car.load_pole_s * (felt_x - transfer_x)
        transfer_y += dt / car.load_pole_s * (felt_y - transfer_y)
        speeds[k], along[k], across[k], yaws[k] = v, felt_x, felt_y, yaw
        omegas[k], pressures[k], torques[k], discs[k], loads[k] = omega, pressure, torque, disc, load
    return speeds, along, across, yaws, omegas, pressures, torques, discs, loads
