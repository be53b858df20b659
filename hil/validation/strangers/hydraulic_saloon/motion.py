"""Equations of motion of the saloon: four wheels on a plane, loads that follow the accelerations with one pole.

Classical Runge-Kutta of fourth order at 1 ms; a quarter of it while a wheel is nearly at rest.
"""

from math import cos, sin, tanh

import numpy as np

from hil.validation.strangers.compiled import compiled
from hil.validation.strangers.hydraulic_saloon.brakes import (
    behind_valve_pa,
    disc_factor,
    drum_factor,
    master_pressure_pa,
)
from hil.validation.strangers.hydraulic_saloon.numbers import Numbers
from hil.validation.strangers.hydraulic_saloon.tyres import brush_forces_n
from hil.validation.strangers.signals import Vector

G = 9.81
STEP_S = 0.001
WAY, VX, VY, YAW, HEADING, OMEGA, ANGLE, SLIP, SIDE, TRANSFER, MASTER, PRESSURE, TEMPERATURE, STEER = (
    0, 1, 2, 3, 4, 5, 9, 13, 17, 21, 23, 24, 28, 32,
)  # fmt: skip
STATES = 33
"""Indices into the state: way, speeds, yaw rate, heading off the course, wheels' speeds and angles, slips along and
across, accelerations that the loads follow, master cylinder, wheel cylinders, discs and drums, steering wheel."""
AX, AY = STATES, STATES + 1
"""Behind the state in a row of the result: specific force at the centre of gravity, without tilt."""
ROW = STATES + 2
REST_RAD_S = 0.3
"""Width of the step of friction at rest."""


@compiled
def friction(car: Numbers, wheel: int, speed_mps: float, pressure_pa: float, temperature_k: float) -> float:
    """Friction of a pad or a lining."""
    cold = car.cold_loss[wheel] * min(max((423.0 - temperature_k) / 100.0, 0.0), 1.0)
    pressed = (max(pressure_pa, 1e5) / 3e6) ** -car.mu_exponent[wheel]
    return float(car.mu[wheel] * (1.0 - car.pad_speed_loss * abs(speed_mps) / 30.0) * (1.0 - cold) * pressed)


@compiled
def brake_torque_nm(car: Numbers, wheel: int, pressure_pa: float, speed_mps: float, temperature_k: float) -> float:
    """Torque of a sliding brake, a magnitude."""
    pressure_pa = max(pressure_pa, car.held_pa[wheel])
    mu = friction(car, wheel, speed_mps, pressure_pa, temperature_k)
    factor = disc_factor(mu) if wheel < 2 else drum_factor(mu)
    clamping = max(pressure_pa - car.threshold_pa[wheel], 0.0) * car.piston_m2[wheel] * car.efficiency
    return float(factor * clamping * car.radius_brake_m[wheel])


@compiled
def derivative(
    y: Vector, d: Vector, car: Numbers, foot_n: float, curvature: float, hand_rad: float, grade: float, wind_mps: float
) -> tuple[float, float]:
    """Derivative of the state into ``d``; gives the specific forces along and across."""
    v, heave = y[VX], abs(y[VX])
    air = (v + wind_mps) * abs(v + wind_mps)
    front = y[STEER] / car.steering_ratio + car.toe_rad
    base = car.to_axle_m[0] + car.to_axle_m[1]
    force_x, force_y, moment = 0.0, 0.0, 0.0
    for i in range(4):
        axle = i // 2
        lever = car.to_axle_m[0] if axle == 0 else -car.to_axle_m[1]
        left = 0.5 * car.track_m[axle] * (1.0 if i % 2 == 0 else -1.0)
        own = car.to_axle_m[1 - axle] / base
        pitch = car.mass_kg * y[TRANSFER] * car.height_m / base
        load = 0.5 * (car.mass_kg * G * own - (pitch if axle == 0 else -pitch) - car.lift_kg_m[axle] * air)
        roll = car.mass_kg * y[TRANSFER + 1] * car.height_m / car.track_m[axle] * (0.56 if axle == 0 else 0.44)
        load = max(load - (roll if i % 2 == 0 else -roll), 50.0)
        u, w = v - y[YAW] * left, y[VY] + y[YAW] * lever
        turned = front if axle == 0 else 0.0
        c, s = cos(turned), sin(turned)
        along, across = u * c + w * s, w * c - u * s
        speed = abs(along)
        radius = car.radius_m[i]
        sliding = y[OMEGA + i] * radius - along
        d[SLIP + i] = (sliding - speed * y[SLIP + i]) / car.length_m
        d[SIDE + i] = (-across - speed * y[SIDE + i]) / car.side_length_m
        fx, fy = brush_forces_n(y[SLIP + i], y[SIDE + i], load, car.stiffness, car.cornering[axle], car.friction)
        slow = max(1.0 - speed / 2.5, 0.0)
        fx += 4000.0 * slow * sliding
        fy -= 2000.0 * slow * across
        force_x += fx * c - fy * s
        force_y += fx * s + fy * c
        moment += lever * (fx * s + fy * c) - left * (fx * c - fy * s)
        torque = brake_torque_nm(car, i, y[PRESSURE + i], v, y[TEMPERATURE + i])
        torque *= 1.0 + car.judder[i] * sin(y[ANGLE + i])
        resisting = torque + car.rolling[i] * load * radius + car.drag_nm[i]
        if axle == 0:
            resisting += car.gearbox_nm + car.gearbox_nms * abs(y[OMEGA + i])
        d[OMEGA + i] = (-fx * radius - resisting * tanh(y[OMEGA + i] / REST_RAD_S)) / car.wheel_inertia_kg_m2[i]
        d[ANGLE + i] = y[OMEGA + i]
        cooled = car.cooling_w_k[i] * (0.3 + heave / 30.0) * (y[TEMPERATURE + i] - car.ambient_k)
        d[TEMPERATURE + i] = (torque * abs(y[OMEGA + i]) - cooled) / car.heat_j_k[i]
        supplied = y[MASTER] if axle == 0 else behind_valve_pa(y[MASTER], car.knee_pa, car.valve_slope)
        d[PRESSURE + i] = (supplied - y[PRESSURE + i]) / car.line_s[axle]
    ax = (force_x - car.drag_kg_m * air) / car.mass_kg
    ay = force_y / car.mass_kg
    d[WAY] = v
    d[VX] = ax - G * grade + y[YAW] * y[VY]
    d[VY] = ay - y[YAW] * v
    d[YAW] = moment / car.yaw_inertia_kg_m2
    d[HEADING] = y[YAW] - v * curvature
    d[TRANSFER] = (ax - y[TRANSFER]) / car.transfer_s
    d[TRANSFER + 1] = (ay - y[TRANSFER + 1]) / car.transfer_s
    d[MASTER] = (master_pressure_pa(foot_n) - y[MASTER]) / car.booster_s
    wanted = car.steering_ratio * (base + 0.0022 * v * v) * curvature + hand_rad
    wanted -= 1.2 * (y[YAW] - v * curvature) + 1.5 * y[HEADING]
    d[STEER] = (wanted - y[STEER]) / 0.12
    return ax, ay


@compiled
def run(
    start: Vector, car: Numbers, foot_n: Vector, curvature: Vector, hand_rad: Vector, wind_mps: Vector, hill: Vector,
    rest_s: float,
) -> Vector:  # fmt: skip
    """Drive until the inputs end, or the car has been at rest for a while.

    Parameters
    ----------
    start : (STATES,).  foot_n, curvature, hand_rad, wind_mps : (n,) at steps of 1 ms; linear between them.
    hill : (3, k) sizes, wave numbers (rad/m) and phases of the grade over the way.  rest_s : at rest, to the end.

    Returns
    -------
    (m, ROW) the state and the specific forces every 1 ms, m at most n.
    """  # fmt: skip
    count = len(foot_n)
    rows = np.zeros((count, ROW))
    y = start.copy()
    k = np.zeros((4, STATES))
    stage = np.zeros(STATES)
    rested, last = 0.0, count
    for n in range(count):
        least = min(y[OMEGA], y[OMEGA + 1], y[OMEGA + 2], y[OMEGA + 3])
        parts = 4 if least < 6.0 else 1
        h = STEP_S / parts
        for part in range(parts):
            for j in range(4):
                shift = (0.0, 0.5, 0.5, 1.0)[j]
                if j == 0:
                    stage[:] = y
                else:
                    stage[:] = y + (shift * h) * k[j - 1]
                x = (part + shift) / parts
                m = min(n + 1, count - 1)
                grade = car.grade
                for i in range(hill.shape[1]):
                    grade += hill[0, i] * sin(hill[1, i] * stage[WAY] + hill[2, i])
                ax, ay = derivative(
                    stage, k[j], car, foot_n[n] + x * (foot_n[m] - foot_n[n]),
                    curvature[n] + x * (curvature[m] - curvature[n]), hand_rad[n] + x * (hand_rad[m] - hand_rad[n]),
                    grade, car.wind_mps + wind_mps[n] + x * (wind_mps[m] - wind_mps[n]),
                )  # fmt: skip
                if part == 0 and j == 0:
                    rows[n, :STATES] = y
                    rows[n, AX], rows[n, AY] = ax, ay
            y += h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3])
        rested = rested + STEP_S if abs(y[VX]) < 0.03 else 0.0
        if rested > rest_s:
            last = n + 1
            break
    return rows[:last]
