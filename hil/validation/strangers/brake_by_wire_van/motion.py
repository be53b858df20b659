"""Equations of motion of the van: rolling body, tyre forces that lag, one motor on the rear axle, clamping actuators.

The midpoint rule at 0.25 ms; the control at 10 ms; dead times in whole steps of 1 ms, linear between.
"""

from math import cos, pi, sin, tanh

import numpy as np

from hil.validation.strangers.brake_by_wire_van.control import TICK_MS, motor_demand_nm, pressure_demands_pa
from hil.validation.strangers.brake_by_wire_van.numbers import Numbers
from hil.validation.strangers.brake_by_wire_van.tyres import forces_n
from hil.validation.strangers.compiled import compiled
from hil.validation.strangers.signals import Vector

G = 9.81
ROW_S = 0.001
PARTS = 4
WAY, VX, VY, YAW, HEADING, OMEGA, ANGLE, ALONG, ACROSS, PITCH, ROLL, ROLLING, CLAMP, CLAMPING, MOTOR, STEER = (
    0, 1, 2, 3, 4, 5, 9, 13, 17, 21, 22, 23, 24, 28, 32, 33,
)  # fmt: skip
STATES = 34
"""Indices into the state: way, speeds, yaw rate, heading off the course, wheels' speeds and angles, tyre forces,
accelerations that loads along and across follow with the latter's rate, clamping pressures with their rates, torque of
the motor at both wheels, steering wheel."""
AX, AY, FRONT_DEMAND, REAR_DEMAND, MOTOR_DEMAND = STATES, STATES + 1, STATES + 2, STATES + 3, STATES + 4
"""Behind the state in a row of the result: specific force at the centre of gravity without tilt, and the demands."""
ROW = STATES + 5
REST_RAD_S = 0.4
LEAST_MPS = 0.5


@compiled
def derivative(
    y: Vector, d: Vector, car: Numbers, targets: Vector, motor_nm: float, curvature: float, hand_rad: float,
    grade: float, wind_mps: float,
) -> tuple[float, float]:  # fmt: skip
    """Derivative of the state into ``d``; gives the specific forces along and across.

    Parameters
    ----------
    targets : (4,) clamping that the actuators follow, Pa.  motor_nm : torque that the motor follows, both wheels.
    """
    v = y[VX]
    air = (v + wind_mps) * abs(v + wind_mps)
    front = y[STEER] / car.steering_ratio + car.toe_rad
    base = car.to_axle_m[0] + car.to_axle_m[1]
    force_x, force_y, moment = 0.0, 0.0, 0.0
    for i in range(4):
        axle, sign = i // 2, (1.0 if i % 2 == 0 else -1.0)
        lever = car.to_axle_m[0] if axle == 0 else -car.to_axle_m[1]
        left = 0.5 * car.track_m[axle] * sign
        pitch = car.mass_kg * y[PITCH] * car.height_m / base
        load = 0.5 * (car.mass_kg * G * car.to_axle_m[1 - axle] / base - (pitch if axle == 0 else -pitch))
        load -= sign * car.mass_kg * y[ROLL] * car.height_m / car.track_m[axle] * (0.6 if axle == 0 else 0.4)
        load = max(load, 100.0)
        u, w = v - y[YAW] * left, y[VY] + y[YAW] * lever
        turned = front if axle == 0 else 0.0
        c, s = cos(turned), sin(turned)
        along, across = u * c + w * s, w * c - u * s
        speed = max(abs(along), LEAST_MPS)
        sliding = y[OMEGA + i] * car.radius_m[i] - along
        fx, fy = forces_n(sliding / speed, -across / speed, load, car.stiffness, car.cornering, car.friction)
        d[ALONG + i] = (fx - y[ALONG + i]) * speed / car.length_m
        d[ACROSS + i] = (fy - y[ACROSS + i]) * speed / car.side_length_m
        slow = max(1.0 - abs(along) / 2.5, 0.0)
        fx = y[ALONG + i] + 7000.0 * slow * sliding
        fy = y[ACROSS + i] - 4000.0 * slow * across
        force_x += fx * c - fy * s
        force_y += fx * s + fy * c
        moment += lever * (fx * s + fy * c) - left * (fx * c - fy * s)
        brake = car.gain_nm_pa[i] * (1.0 - car.pad_speed_loss * abs(v) / 30.0)
        brake *= max(y[CLAMP + i] - car.threshold_pa[i], 0.0)
        resisting = brake + car.rolling[i] * load * car.radius_m[i] + car.drag_nm[i]
        d[OMEGA + i] = -fx * car.radius_m[i] - resisting * tanh(y[OMEGA + i] / REST_RAD_S)
        d[ANGLE + i] = y[OMEGA + i]
        natural = 2.0 * pi * car.emb_hz[i]
        d[CLAMP + i] = y[CLAMPING + i]
        lag = 2.0 * car.emb_damping * natural * y[CLAMPING + i]
        d[CLAMPING + i] = natural * natural * (targets[i] - y[CLAMP + i]) - lag
    for i in range(2):
        d[OMEGA + i] /= car.wheel_inertia_kg_m2[i]
    # the rotor turns with the mean of its wheels: their equations are coupled by a quarter of its inertia
    own = car.wheel_inertia_kg_m2[2] + 0.25 * car.rotor_kg_m2
    other = 0.25 * car.rotor_kg_m2
    half = 0.5 * car.motor_gain * y[MOTOR]
    t_left, t_right = d[OMEGA + 2] + half, d[OMEGA + 3] + half
    determinant = own * own - other * other
    d[OMEGA + 2] = (own * t_left - other * t_right) / determinant
    d[OMEGA + 3] = (own * t_right - other * t_left) / determinant
    ax, ay = (force_x - car.drag_kg_m * air) / car.mass_kg, force_y / car.mass_kg
    d[WAY] = v
    d[VX] = ax - G * grade + y[YAW] * y[VY]
    d[VY] = ay - y[YAW] * v
    d[YAW] = moment / car.yaw_inertia_kg_m2
    d[HEADING] = y[YAW] - v * curvature
    d[PITCH] = (ax - y[PITCH]) / car.transfer_s
    natural = 2.0 * pi * car.roll_hz
    d[ROLL] = y[ROLLING]
    d[ROLLING] = natural * natural * (ay - y[ROLL]) - 2.0 * car.roll_damping * natural * y[ROLLING]
    d[MOTOR] = (motor_nm - y[MOTOR]) / car.motor_s
    wanted = car.steering_ratio * (base + 0.003 * v * v) * curvature + hand_rad
    wanted -= 1.5 * (y[YAW] - v * curvature) + 1.2 * y[HEADING]
    d[STEER] = (wanted - y[STEER]) / 0.15
    return ax, ay


@compiled
def late(rows: Vector, n: int, column: int, dead_ms: float) -> float:
    """A column as it was some time before row n; the first before the first."""
    whole = int(dead_ms)
    share = dead_ms - whole
    return float((1.0 - share) * rows[max(n - whole, 0), column] + share * rows[max(n - whole - 1, 0), column])


@compiled
def run(
    start: Vector, car: Numbers, asked_nm: Vector, curvature: Vector, hand_rad: Vector, wind_mps: Vector, hill: Vector,
    control: Vector, given: Vector, rest_s: float,
) -> Vector:  # fmt: skip
    """Drive until the inputs end, or the van has been at rest for a while.

    Parameters
    ----------
    start : (STATES,).  asked_nm : (n,) torque asked by the pedals, all wheels together; braking is negative.
    curvature, hand_rad, wind_mps : (n,) at steps of 1 ms, held.
    hill : (3, k) sizes, wave numbers (rad/m) and phases of the grade over the way.
    control : brake gains (N m/Pa) and radius (m) that the control knows: front, rear, radius.  rest_s : to the end.
    given : (k, 3) demands of clamping in front and behind and of the motor, that stand in for the control; (0, 3) none.

    Returns
    -------
    (m, ROW) the state, specific forces and demands every 1 ms, m at most n.
    """
    count = len(asked_nm)
    rows = np.zeros((count, ROW))
    y, middle = start.copy(), np.zeros(STATES)
    d, targets, closed = np.zeros(STATES), np.zeros(4), np.zeros(4)
    front, rear, motor, rested, last = 0.0, 0.0, 0.0, 0.0, count
    h = ROW_S / PARTS
    for n in range(count):
        if len(given):
            front, rear, motor = given[min(n, len(given) - 1)]
        elif n % TICK_MS == 0:
            motor = motor_demand_nm(asked_nm[n], motor, y[VX], control[2])
            friction = -asked_nm[n] + min(motor, 0.0) if asked_nm[n] < 0.0 else 0.0
            front, rear = pressure_demands_pa(friction, control[0], control[1])
        rows[n, FRONT_DEMAND], rows[n, REAR_DEMAND], rows[n, MOTOR_DEMAND] = front, rear, motor
        for i in range(4):
            command = late(rows, n, FRONT_DEMAND + i // 2, car.emb_dead_ms)
            command = command if command > car.dead_band_pa else 0.0
            # released pads stand off the disc: they travel before they clamp
            closed[i] = min(closed[i] + 1.0, car.clearance_ms[i]) if command > 0.0 else max(closed[i] - 0.2, 0.0)
            targets[i] = command if closed[i] >= car.clearance_ms[i] else 0.0
        followed = late(rows, n, MOTOR_DEMAND, car.motor_dead_ms)
        grade = car.grade
        for i in range(hill.shape[1]):
            grade += hill[0, i] * sin(hill[1, i] * y[WAY] + hill[2, i])
        wind = car.wind_mps + wind_mps[n]
        for part in range(PARTS):
            ax, ay = derivative(y, d, car, targets, followed, curvature[n], hand_rad[n], grade, wind)
            if part == 0:
                rows[n, :STATES] = y
                rows[n, AX], rows[n, AY] = ax, ay
            middle[:] = y + 0.5 * h * d
            derivative(middle, d, car, targets, followed, curvature[n], hand_rad[n], grade, wind)
            y += h * d
        rested = rested + ROW_S if abs(y[VX]) < 0.03 else 0.0
        if rested > rest_s:
            last = n + 1
            break
    return rows[:last]
