"""The paper's wheel-torque observer (eqs. 5-14) and pad friction (eqs. 16-21), as printed as far as it is printed.

A linear Kalman filter of 16 states, four for each wheel: speed, acceleration, longitudinal force, torque (eq. 5).
Its measurements are the wheel speed and a virtual force sensor (eq. 6); its input is the rate of the force that
Burckhardt's tyre model gives (eq. 7). With fixed coefficients the wheels do not couple, so that it falls into four
filters of four states. The virtual sensor's force on the whole car is shared among the wheels by the tyre model,
times a correction factor K (eqs. 12-14) smoothed by least squares over a window. The pad friction is the least-squares
ratio of observed friction torque and pressure over a window (eqs. 17-21).

Where the paper is silent: slip comes from a reference speed out of wheel speeds and acceleration; K and the friction
hold below a least force, on differing signs and while not braking; the pressure is delayed as the filter delays.
"""

from math import exp, isnan, sqrt

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import entry, helper
from ecu.law.gravity import GRAVITY_MPS2

Vector = NDArray[np.float64]

# filter states of one wheel (eq. 5)
OMEGA, OMEGA_RATE, FORCE, TORQUE = 0, 1, 2, 3
N = 4
MAX_WINDOW = 100

# vector of the whole state
FILTER = 0  # 4 x 4 estimates
COVARIANCE = 16  # 4 x 4 x 4
MODEL_FORCE = 80
WHEEL_TORQUE = 84
FRICTION = 88
CONFIDENCE = 92
PRESSURE_LAG = 96
MOTOR_LAG = 100
SPEED, K, LOAD_ACCELERATION, STARTED, K_NUMBER, K_NEXT, MU_NUMBER, MU_NEXT, OFFSET = range(104, 113)
K_MODEL = 113
K_SENSOR = K_MODEL + MAX_WINDOW
MU_TORQUE = K_SENSOR + MAX_WINDOW  # per wheel
MU_PRESSURE = MU_TORQUE + 4 * MAX_WINDOW
SIZE = MU_PRESSURE + 4 * MAX_WINDOW

# inputs as in joint.layout
AX, AY, YAW_RATE, STEER, DEMAND, WHEEL, PRESSURE, MOTOR = 0, 1, 2, 3, 4, 5, 9, 13

# parameters
P_MASS, P_BASE, P_FRONT, P_HEIGHT, P_RADIUS, P_INERTIA, P_DRAG, P_ROLL, P_STEER_RATIO = range(9)
P_TRACK, P_GAIN = 9, 11
P_THRESHOLD, P_MU, P_C1, P_C2, P_C3, P_CORNER = range(13, 19)
Q_RATE, Q_FORCE, Q_TORQUE, R_OMEGA, R_FORCE = range(19, 24)
P_K_WINDOW, P_K_LIMIT, P_FORCE_MIN, P_MU_WINDOW, P_DELAY, P_PRESSURE_MIN, P_SPEED_MIN, ROAD, P_DIVE = range(24, 33)

SPEED_GAIN, OFFSET_GAIN = 5.0, 5.0  # reference speed while the wheels roll free: 1/s, 1/s2


@helper
def burckhardt(slip: float, side_slip: float, load_n: float, c1: float, c2: float, c3: float) -> tuple[float, float]:
    """Tyre force in the wheel's axes, N (Kiencke/Nielsen): mu(s) Fz along the slip, mu = c1 (1 - exp(-c2 s)) - c3 s."""
    s = sqrt(slip * slip + side_slip * side_slip)
    if s < 1e-9:
        return 0.0, 0.0
    mu = c1 * (1.0 - exp(-c2 * s)) - c3 * s
    return mu * load_n * slip / s, mu * load_n * side_slip / s


@entry
def kalman_step(x: Vector, covariance: Vector, z: Vector, force_rate: Vector, q: Vector, r: Vector, radius: float,
                inertia: float, dt: float) -> None:  # fmt: skip
    """One step of the 16-state filter, in place: prediction (8a)-(8d), update with `z` (eq. 6).

    Parameters
    ----------
    x : (16,) four states a wheel.  covariance : (64,) four 4 x 4 blocks.  z : (8,) wheel speeds, virtual forces; NaN
        leaves a measurement out.  force_rate : (4,) the input, N/s.  q : (4,) process variances of the four states in
        one step.  r : (2,) measurement variances.
    """
    m = np.empty((4, 4))
    for wheel in range(4):
        o = 4 * wheel
        c = 16 * wheel
        omega, rate, force, torque = x[o], x[o + 1], x[o + 2], x[o + 3]
        x[o] = omega + dt * rate
        x[o + 1] = (torque - force * radius) / inertia
        x[o + 2] = force + dt * force_rate[wheel]
        # P <- A P A^T + Q with A = [[1, dt, 0, 0], [0, 0, -r/I, 1/I], [0, 0, 1, 0], [0, 0, 0, 1]]
        a, b = -radius / inertia, 1.0 / inertia
        for j in range(4):
            p0, p1, p2, p3 = (
                covariance[c + j],
                covariance[c + 4 + j],
                covariance[c + 8 + j],
                covariance[c + 12 + j],
            )
            m[0, j] = p0 + dt * p1
            m[1, j] = a * p2 + b * p3
            m[2, j] = p2
            m[3, j] = p3
        for i in range(4):
            p0, p1, p2, p3 = m[i, 0], m[i, 1], m[i, 2], m[i, 3]
            covariance[c + 4 * i] = p0 + dt * p1
            covariance[c + 4 * i + 1] = a * p2 + b * p3
            covariance[c + 4 * i + 2] = p2
            covariance[c + 4 * i + 3] = p3
        for i in range(4):
            covariance[c + 5 * i] += q[i]
        for k in range(2):
            value = z[4 * k + wheel]
            if isnan(value):
                continue
            at = 0 if k == 0 else 2
            variance = covariance[c + 5 * at] + r[k]
            residual = value - x[o + at]
            column0 = covariance[c + at]
            column1 = covariance[c + 4 + at]
            column2 = covariance[c + 8 + at]
            column3 = covariance[c + 12 + at]
            for i in range(4):
                column = column0 if i == 0 else (column1 if i == 1 else (column2 if i == 2 else column3))
                gain = column / variance
                x[o + i] += gain * residual
                for j in range(i + 1):
                    other = column0 if j == 0 else (column1 if j == 1 else (column2 if j == 2 else column3))
                    value_ij = covariance[c + 4 * i + j] - gain * other
                    covariance[c + 4 * i + j] = value_ij
                    covariance[c + 4 * j + i] = value_ij


@entry
def kalman_run(x: Vector, covariance: Vector, z: Vector, force_rate: Vector, q: Vector, r: Vector, radius: float,
               inertia: float, dt: float, out: Vector) -> None:  # fmt: skip
    """`kalman_step` over the rows of ``z`` (n, 8) and ``force_rate`` (n, 4); the states go into ``out`` (n, 16)."""
    for n in range(z.shape[0]):
        kalman_step(x, covariance, z[n], force_rate[n], q, r, radius, inertia, dt)
        for i in range(16):
            out[n, i] = x[i]


@helper
def fastest_wheel(z: Vector) -> float:
    """Speed of the fastest wheel, rad/s; -1 where no wheel has one."""
    fastest = -1.0
    for i in range(4):
        if z[WHEEL + i] > fastest:
            fastest = z[WHEEL + i]
    return fastest


@helper
def starts(s: Vector, z: Vector, p: Vector) -> bool:
    """Set the state at the first complete sample; whether this sample can be used."""
    fastest = fastest_wheel(z)
    missing = isnan(z[AX])
    for i in range(4):
        if isnan(z[WHEEL + i]) or isnan(z[PRESSURE + i]):
            missing = True
    if s[STARTED] == 0.0:
        for i in range(4):
            s[FRICTION + i] = p[P_MU]
        if missing or fastest < 0.0:
            return False
        s[STARTED] = 1.0
        s[SPEED] = fastest * p[P_RADIUS]
        s[K] = 1.0
        for i in range(4):
            s[FILTER + 4 * i] = z[WHEEL + i]
            for j in range(4):
                s[COVARIANCE + 16 * i + 5 * j] = 1e4
    return not missing


@helper
def update_reference_speed(s: Vector, z: Vector, p: Vector, dt: float) -> None:
    """Reference speed, m/s: of the wheels while they roll free, of the acceleration while they slip."""
    radius = p[P_RADIUS]
    level = z[AX] / (1.0 + GRAVITY_MPS2 * p[P_DIVE])
    s[SPEED] += dt * (level - s[OFFSET])
    if z[DEMAND] > 0.0:
        s[SPEED] = max(s[SPEED], fastest_wheel(z) * radius)
    else:
        mean = 0.25 * (z[WHEEL] + z[WHEEL + 1] + z[WHEEL + 2] + z[WHEEL + 3]) * radius
        s[OFFSET] -= min(dt * OFFSET_GAIN, 1.0) * (mean - s[SPEED])
        s[SPEED] += min(dt * SPEED_GAIN, 1.0) * (mean - s[SPEED])


@helper
def tyre_forces(s: Vector, z: Vector, p: Vector, dt: float, ay: float, model: Vector) -> tuple[float, float]:
    """Burckhardt's forces on the car, N, along and across it, with wheel loads as of Doumiati et al.

    ``model`` (4,) takes the longitudinal force of each wheel, the one whose rate is the filter's input (eq. 7).
    """
    speed = s[SPEED]
    yaw_rate = 0.0 if isnan(z[YAW_RATE]) else z[YAW_RATE]
    steer = 0.0 if isnan(z[STEER]) else z[STEER] / p[P_STEER_RATIO]
    s[LOAD_ACCELERATION] += min(dt / 0.05, 1.0) * (z[AX] - s[LOAD_ACCELERATION])
    base = p[P_BASE]
    rear_m = base - p[P_FRONT]
    lateral = rear_m * yaw_rate - speed * ay / (GRAVITY_MPS2 * p[P_CORNER])
    body_x = 0.0
    body_y = 0.0
    for i in range(4):
        axle = 0 if i < 2 else 1
        left = 1.0 if i % 2 == 0 else -1.0
        arm = rear_m if axle == 0 else p[P_FRONT]
        end = 1.0 if axle == 0 else -1.0
        load = 0.5 * p[P_MASS] * (GRAVITY_MPS2 * arm / base - end * s[LOAD_ACCELERATION] * p[P_HEIGHT] / base)
        load -= left * arm / base * p[P_MASS] * ay * p[P_HEIGHT] / p[P_TRACK + axle]
        angle = steer if axle == 0 else 0.0
        ground = speed - yaw_rate * left * 0.5 * p[P_TRACK + axle]
        across = lateral + yaw_rate * (p[P_FRONT] if axle == 0 else -rear_m)
        along = ground * np.cos(angle) + across * np.sin(angle)
        side = across * np.cos(angle) - ground * np.sin(angle)
        reference = max(along, 1.0)
        slip = (z[WHEEL + i] * p[P_RADIUS] - along) / reference
        fl, fs = burckhardt(slip, -side / reference, max(load, 200.0), p[P_C1], p[P_C2], p[P_C3])
        model[i] = fl
        body_x += fl * np.cos(angle) - fs * np.sin(angle)
        body_y += fl * np.sin(angle) + fs * np.cos(angle)
    return body_x, body_y


@helper
def update_correction_factor(s: Vector, z: Vector, p: Vector, ay: float, body_x: float, body_y: float) -> None:
    """Correction factor K (eq. 12), least squares over a window; held where it cannot be estimated."""
    resistance = 0.5 * p[P_DRAG] * s[SPEED] * s[SPEED] + p[P_MASS] * GRAVITY_MPS2 * p[P_ROLL]
    sensed_x = p[P_MASS] * z[AX] + resistance
    sensed_y = p[P_MASS] * ay
    sensed = sqrt(sensed_x * sensed_x + sensed_y * sensed_y)
    modelled = sqrt(body_x * body_x + body_y * body_y)
    if z[DEMAND] > 0.0 and modelled > p[P_FORCE_MIN] and sensed > p[P_FORCE_MIN] and sensed_x * body_x > 0.0:
        window = int(p[P_K_WINDOW])
        at = int(s[K_NEXT])
        s[K_MODEL + at] = modelled
        s[K_SENSOR + at] = sensed
        s[K_NEXT] = (at + 1) % window
        s[K_NUMBER] = min(s[K_NUMBER] + 1.0, window)
        top = 0.0
        bottom = 0.0
        for n in range(int(s[K_NUMBER])):
            top += s[K_MODEL + n] * s[K_SENSOR + n]
            bottom += s[K_MODEL + n] * s[K_MODEL + n]
        s[K] = min(max(top / bottom, 1.0 / p[P_K_LIMIT]), p[P_K_LIMIT])


@helper
def update_wheel_filters(s: Vector, z: Vector, p: Vector, model: Vector, dt: float) -> None:
    """Kalman filter of the wheels (eqs. 5 to 8): the virtual sensor's force is K times the tyre model's (13), (14)."""
    factor = s[K] if p[ROAD] > 0.5 else 1.0
    measurement = np.empty(8)
    rate = np.empty(4)
    for i in range(4):
        rate[i] = (model[i] - s[MODEL_FORCE + i]) / dt
        s[MODEL_FORCE + i] = model[i]
        measurement[i] = z[WHEEL + i]
        measurement[4 + i] = factor * model[i]
    q = np.array([0.0, p[Q_RATE] ** 2 * dt, p[Q_FORCE] ** 2 * dt, p[Q_TORQUE] ** 2 * dt])
    r = np.array([p[R_OMEGA] ** 2, p[R_FORCE] ** 2])
    kalman_step(
        s[FILTER : FILTER + 16], s[COVARIANCE : COVARIANCE + 64], measurement, rate, q, r, p[P_RADIUS], p[P_INERTIA], dt
    )
    for i in range(4):
        s[WHEEL_TORQUE + i] = s[FILTER + 4 * i + TORQUE]


@helper
def update_pad_friction(s: Vector, z: Vector, p: Vector, dt: float) -> None:
    """Pad friction (eqs. 16 to 21): least squares of friction torque over pressure, over a window."""
    share = min(dt / (p[P_DELAY] + 0.5 * dt), 1.0)
    for i in range(4):
        clamp = max(z[PRESSURE + i] - p[P_THRESHOLD], 0.0)
        motor = 0.0 if isnan(z[MOTOR + i]) else z[MOTOR + i]
        s[PRESSURE_LAG + i] += share * (clamp - s[PRESSURE_LAG + i])
        s[MOTOR_LAG + i] += share * (motor - s[MOTOR_LAG + i])
    least = min(min(s[PRESSURE_LAG], s[PRESSURE_LAG + 1]), min(s[PRESSURE_LAG + 2], s[PRESSURE_LAG + 3]))
    if not (z[DEMAND] > 0.0 and least > p[P_PRESSURE_MIN] and s[SPEED] > p[P_SPEED_MIN]):
        return
    window = int(p[P_MU_WINDOW])
    at = int(s[MU_NEXT])
    s[MU_NEXT] = (at + 1) % window
    s[MU_NUMBER] = min(s[MU_NUMBER] + 1.0, window)
    number = int(s[MU_NUMBER])
    for i in range(4):
        gain = p[P_GAIN] if i < 2 else p[P_GAIN + 1]
        s[MU_TORQUE + i * MAX_WINDOW + at] = s[MOTOR_LAG + i] - s[WHEEL_TORQUE + i]
        s[MU_PRESSURE + i * MAX_WINDOW + at] = gain * s[PRESSURE_LAG + i]
        top = 0.0
        bottom = 0.0
        for n in range(number):
            phi = s[MU_PRESSURE + i * MAX_WINDOW + n]
            top += phi * s[MU_TORQUE + i * MAX_WINDOW + n]
            bottom += phi * phi
        if 2 * number >= window:
            s[FRICTION + i] = min(max(top / bottom, 0.05), 1.2)
            s[CONFIDENCE + i] = min(bottom / (number * (gain * 10e5) ** 2), 1.0)


@entry
def paper_step(s: Vector, z: Vector, p: Vector, dt: float) -> Vector:
    """Advance observer and friction estimation by one sample.

    Parameters
    ----------
    s : state of the last sample (layout of this file); not changed.  z : inputs as of `joint.layout`, NaN where not
        available.  p : parameters, `estimator.paper_parameters`.  dt : s.
    """
    s = s.copy()
    if not starts(s, z, p):
        return s
    ay = 0.0 if isnan(z[AY]) else z[AY]
    update_reference_speed(s, z, p, dt)
    model = np.empty(4)
    body_x, body_y = tyre_forces(s, z, p, dt, ay, model)
    update_correction_factor(s, z, p, ay, body_x, body_y)
    update_wheel_filters(s, z, p, model, dt)
    update_pad_friction(s, z, p, dt)
    return s
