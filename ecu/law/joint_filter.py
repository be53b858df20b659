"""Joint filter: one extended Kalman filter over the car's motion, its tyres and its four pad frictions.

What the paper does in two stages (wheel torque, then pad friction) is one estimation problem: the wheel torque is
T = T_motor - mu G (p - p0), and the accelerations of car and wheels tell what sum and which shares of T were true.
States: speed v, offset b of the acceleration sensor, grade theta, mass factor c, tyre stiffness factor s with the
difference d between the axles, four rolling-radius factors, four pad frictions mu. The body acceleration is an input;
the measurements are the force balance and the four wheel speeds (their slip), each used once.

Decisions that make it work: the pad friction only moves while pressure is applied; the mass factor is only learned
while no friction brake is (else it would take part of the friction's error); wheels that slide are left out;
torques are delayed as the sensors delay the accelerations.
"""

from math import isnan

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import compiled

Vector = NDArray[np.float64]

# estimated states
SPEED, BIAS, GRADE, MASS, STIFFNESS, AXLE = 0, 1, 2, 3, 4, 5
RADIUS, FRICTION = 6, 10
N = 14
# vector of the whole state: estimates, covariance, then what is merely remembered
COVARIANCE = N
PRESSURE_ZERO = N + N * N
PRESSURE_LAG = PRESSURE_ZERO + 4
MOTOR_LAG = PRESSURE_LAG + 4
SLIDING = MOTOR_LAG + 4  # seconds that a wheel still counts as sliding
TORQUE = SLIDING + 4
LOCKED = TORQUE + 4  # seconds that a wheel has stood while the car moves
LAST_WHEEL = LOCKED + 4
SPIN = LAST_WHEEL + 4  # speed and rate with which a wheel spins down
SPIN_RATE = SPIN + 4
SLID_S = SPIN_RATE + 4  # how long a wheel has been sliding by now
PITCH, PITCH_RATE, LOAD_ACCELERATION, FORCE_LAG, RELEASED_S, STARTED, REJECTED_S = (SLID_S + 4 + i for i in range(7))
SIZE = SLID_S + 11

# inputs
AX, AY, YAW_RATE, STEER, DEMAND = 0, 1, 2, 3, 4
WHEEL, PRESSURE, MOTOR = 5, 9, 13
INPUTS = 17

# parameters
(P_MASS, P_BASE, P_FRONT, P_HEIGHT, P_RADIUS, P_ARM, P_INERTIA, P_DRAG, P_ROLL, P_DIVE, P_STEER_RATIO) = range(11)
P_TRACK, P_GAIN = 11, 13
P_THRESHOLD, P_STIFF, P_STIFF_SLOPE, P_PEAK, P_CORNER, P_RELAX = range(15, 21)
P_LAG, P_WHEEL_LAG, P_PITCH_W, P_PITCH_D, P_ZERO_TIME, P_ZERO_LIMIT, P_SPEED_MIN, P_SLIDE, P_TOOTH = range(21, 30)
(Q_BIAS, Q_GRADE, Q_STIFF, Q_COMMON, Q_AXLE, Q_SINGLE, Q_RELEASED, R_ACC, R_ALIGN, R_WHEEL, GATE, ROAD) = range(30, 42)
START = 42  # variances: bias, grade, mass, stiffness, axle, radius, friction common, axle, single; nominal friction
PARAMETERS = 52

G0 = 9.80665
SLIDING_HOLD_S = 0.15
COARSE_MPS = 0.1  # what tooth sensing can be off at low speed
LOST_S, AGREE = 0.3, 0.03  # all wheels "slide" for so long and agree so well: it is the speed that is wrong
REJECT_S = 0.5
LOCKED_SHARE = 0.15  # of the speed of the car: slower than that a wheel may be locked
SPIN_UP_RAD_S = 1.0  # faster in one sample: it is turning again
TOOTH_RAD_S = 14.0  # about one tooth in a sample
STANDING_RAD_S = 1.0
TOOTH_WAIT_S = 0.08  # a wheel that stops jumps back to what the missing tooth allows at most, and decays from there
RELEASED_PA = 3e5
SETTLED_S = 0.4
APPLIED_PA = 1e5
MASS_FORCE_SHARE = 0.7  # m/s2 of steady motor drive or drag from which on the mass is learned
CURVATURE = 0.38  # extra slip near the grip limit, kappa = F / C (1 + 0.38 (F / D)^2): the Magic Formula to third order


@compiled
def start(s: Vector, p: Vector, speed_mps: float) -> None:
    """Set the state ``s`` to what is believed before anything was measured, at a speed."""
    s[:] = 0.0
    s[SPEED] = speed_mps
    s[MASS] = 1.0
    s[STIFFNESS] = 1.0
    for i in range(4):
        s[RADIUS + i] = 1.0
        s[FRICTION + i] = p[START + 9]
    c = COVARIANCE
    s[c] = 0.25
    for k, state in enumerate((BIAS, GRADE, MASS, STIFFNESS, AXLE)):
        s[c + state * N + state] = p[START + k]
    for i in range(4):
        s[c + (RADIUS + i) * N + RADIUS + i] = p[START + 5]
        for j in range(4):
            same_axle = 1.0 if (i < 2) == (j < 2) else -1.0
            s[c + (FRICTION + i) * N + FRICTION + j] = (
                p[START + 6] + same_axle * p[START + 7] + (p[START + 8] if i == j else 0.0)
            )
    s[STARTED] = 1.0


@compiled
def correct(
    s: Vector, h: Vector, residual: float, variance: float, gate: float, hold_mass: bool, hold_pads: bool
) -> bool:
    """One scalar measurement: gain, gate, symmetric covariance. Held states keep their value and their uncertainty.

    With a gain K that is zero in the held rows, P' = P - K (P h)^T - (P h) K^T + S K K^T (Schmidt's consider states).
    """
    ph = np.empty(N)
    total = variance
    for i in range(N):
        row = 0.0
        for j in range(N):
            if h[j] != 0.0:
                row += s[COVARIANCE + i * N + j] * h[j]
        ph[i] = row
    for i in range(N):
        total += h[i] * ph[i]
    if residual * residual > gate * gate * total:
        return False
    k = ph / total
    if hold_mass:
        k[MASS] = 0.0
    if hold_pads:
        for i in range(4):
            k[FRICTION + i] = 0.0
    for i in range(N):
        s[i] += k[i] * residual
    for i in range(N):
        for j in range(i + 1):
            value = s[COVARIANCE + i * N + j] - k[i] * ph[j] - ph[i] * k[j] + total * k[i] * k[j]
            s[COVARIANCE + i * N + j] = value
            s[COVARIANCE + j * N + i] = value
    return True


@compiled
def track_pressure_zero(s: Vector, z: Vector, p: Vector, dt: float) -> bool:
    """Follow the offsets of the pressure sensors while the pedal is free; returns whether all pressures are known."""
    settled = z[DEMAND] <= 0.0
    known = True
    for i in range(4):
        if isnan(z[PRESSURE + i]):
            known = False
        elif abs(z[PRESSURE + i]) > RELEASED_PA:
            settled = False
    s[RELEASED_S] = s[RELEASED_S] + dt if settled else 0.0
    if s[RELEASED_S] > SETTLED_S:
        share = min(dt / p[P_ZERO_TIME], 1.0)
        for i in range(4):
            if not isnan(z[PRESSURE + i]):
                zero = s[PRESSURE_ZERO + i] + share * (z[PRESSURE + i] - s[PRESSURE_ZERO + i])
                s[PRESSURE_ZERO + i] = min(max(zero, -p[P_ZERO_LIMIT]), p[P_ZERO_LIMIT])
    return known


@compiled
def lagged_torque(s: Vector, p: Vector, i: int) -> float:
    """Torque of wheel ``i`` as the sensors see its effect, Nm: T = T_motor - mu G (p - p0), delayed."""
    gain = p[P_GAIN] if i < 2 else p[P_GAIN + 1]
    return float(s[MOTOR_LAG + i] - s[FRICTION + i] * gain * s[PRESSURE_LAG + i])


@compiled
def update_torques(s: Vector, z: Vector, p: Vector, dt: float) -> tuple[float, bool]:
    """Torques now and as the sensors and the tyres delay what they do.

    Returns the force of all wheels together, N, and whether any friction brake is applied.
    """
    lag = p[P_LAG] + p[P_RELAX] / max(s[SPEED], 2.0)
    share = min(dt / (lag + 0.5 * dt), 1.0)
    applied = False
    force = 0.0
    for i in range(4):
        gain = p[P_GAIN] if i < 2 else p[P_GAIN + 1]
        clamp = 0.0
        if not isnan(z[PRESSURE + i]):
            clamp = max(z[PRESSURE + i] - s[PRESSURE_ZERO + i] - p[P_THRESHOLD], 0.0)
        motor = 0.0 if isnan(z[MOTOR + i]) else z[MOTOR + i]
        s[TORQUE + i] = motor - s[FRICTION + i] * gain * clamp
        if s[RELEASED_S] > 0.0:
            clamp = 0.0
        s[PRESSURE_LAG + i] += share * (clamp - s[PRESSURE_LAG + i])
        s[MOTOR_LAG + i] += share * (motor - s[MOTOR_LAG + i])
        if s[PRESSURE_LAG + i] > APPLIED_PA:
            applied = True
        force += lagged_torque(s, p, i) / p[P_ARM]
    return force, applied


@compiled
def level_acceleration(s: Vector, z: Vector, p: Vector, dt: float) -> float:
    """Measured longitudinal acceleration with the body's pitch taken out (the sensor pitches with it), m/s2."""
    if isnan(z[AX]):
        return float(s[LOAD_ACCELERATION] + s[BIAS])
    w, d = p[P_PITCH_W], p[P_PITCH_D]
    level = (z[AX] - s[BIAS]) / (1.0 + G0 * p[P_DIVE])
    s[PITCH_RATE] += dt * (w * w * (-p[P_DIVE] * level - s[PITCH]) - 2.0 * d * w * s[PITCH_RATE])
    s[PITCH] += dt * s[PITCH_RATE]
    ax = z[AX] + G0 * s[PITCH]
    s[LOAD_ACCELERATION] += min(dt / 0.05, 1.0) * (ax - s[BIAS] - s[LOAD_ACCELERATION])
    return float(ax)


@compiled
def predict(s: Vector, p: Vector, acceleration: float, dt: float) -> None:
    """Speed by the acceleration; every other state drifts. Pads drift fast while pressed, slowly while they cool."""
    c = COVARIANCE
    s[SPEED] = max(s[SPEED] + dt * acceleration, 0.0)
    for j in range(N):
        s[c + SPEED * N + j] -= dt * (s[c + BIAS * N + j] + G0 * s[c + GRADE * N + j])
    for j in range(N):
        s[c + j * N + SPEED] -= dt * (s[c + j * N + BIAS] + G0 * s[c + j * N + GRADE])
    s[c] += p[R_ACC] ** 2 * dt * dt + 1e-8
    s[c + BIAS * N + BIAS] += p[Q_BIAS] * dt
    s[c + GRADE * N + GRADE] += p[Q_GRADE] * dt
    s[c + STIFFNESS * N + STIFFNESS] += p[Q_STIFF] * dt
    for i in range(4):
        for j in range(4):
            same_axle = 1.0 if (i < 2) == (j < 2) else -1.0
            at = c + (FRICTION + i) * N + FRICTION + j
            if s[PRESSURE_LAG + i] > APPLIED_PA and s[PRESSURE_LAG + j] > APPLIED_PA:
                s[at] += dt * (p[Q_COMMON] + same_axle * p[Q_AXLE] + (p[Q_SINGLE] if i == j else 0.0))
            elif s[at] < p[START + 6]:
                s[at] += dt * p[Q_RELEASED]


@compiled
def wheel_force(s: Vector, p: Vector, i: int, load_n: float, acceleration: float) -> float:
    """Longitudinal tyre force of wheel ``i`` while it rolls, N: F = (T - I a / r) / r - f_r Fz."""
    rolling = p[P_ROLL] * load_n
    return float((lagged_torque(s, p, i) - p[P_INERTIA] * acceleration / p[P_RADIUS]) / p[P_ARM] - rolling)


@compiled
def wheel_states(
    s: Vector, p: Vector, ay: float, yaw_rate: float, steer: float, lateral: float, loads: Vector, along: Vector
) -> None:
    """Fill vertical loads, N, and the ground's speed along each wheel, m/s."""
    base = p[P_BASE]
    rear_m = base - p[P_FRONT]
    mass = p[P_MASS] * s[MASS]
    shift_x = mass * p[P_HEIGHT] * s[LOAD_ACCELERATION] / (2.0 * base)
    for i in range(4):
        axle = 0 if i < 2 else 1
        arm_m = rear_m if axle == 0 else p[P_FRONT]
        left = 1.0 if i % 2 == 0 else -1.0
        share_y = arm_m / base * mass * ay * p[P_HEIGHT] / p[P_TRACK + axle]
        load = 0.5 * mass * G0 * arm_m / base - (shift_x if axle == 0 else -shift_x) - left * share_y
        loads[i] = max(load, 200.0)
        ground = s[SPEED] - yaw_rate * left * 0.5 * p[P_TRACK + axle]
        if axle == 0:
            ground = ground * np.cos(steer) + (lateral + yaw_rate * p[P_FRONT]) * np.sin(steer)
        along[i] = ground


@compiled
def watch_wheel(s: Vector, p: Vector, i: int, omega: float, ground: float, expected_slip: float, dt: float) -> float:
    """Tell whether wheel ``i`` slides (``SLIDING``) or stands (``LOCKED``); returns its angular acceleration, rad/s2.

    A toothed wheel reports standstill long after it: below about a tooth a sample the spin-down seen before goes on.
    """
    slip = (omega * p[P_RADIUS] - ground) / max(ground, 1.0)
    if abs(slip - expected_slip) > p[P_SLIDE] + COARSE_MPS / max(ground, 1.0):
        s[SLIDING + i] = SLIDING_HOLD_S
    step = omega - s[LAST_WHEEL + i]
    s[SPIN + i] += s[SPIN_RATE + i] * dt
    if omega > TOOTH_RAD_S and (step < SPIN_UP_RAD_S or s[LAST_WHEEL + i] > TOOTH_RAD_S):  # else it rocks as it stops
        behind = omega + s[SPIN_RATE + i] * p[P_WHEEL_LAG] - s[SPIN + i]
        s[SPIN + i] += 0.5 * behind
        s[SPIN_RATE + i] += 0.2 * behind / dt
    slow = slip < LOCKED_SHARE - 1.0
    if s[LOCKED + i] > 0.0:
        s[LOCKED + i] += dt
        if s[LOCKED + i] > TOOTH_WAIT_S and (not slow or step > SPIN_UP_RAD_S):
            s[LOCKED + i] = 0.0
            s[SPIN + i], s[SPIN_RATE + i] = TOOTH_RAD_S, 0.0
    elif (s[SPIN + i] + 0.75 * s[SPIN_RATE + i] * dt <= 0.0 and slip < -0.5) or (slow and omega < STANDING_RAD_S):
        s[LOCKED + i] = dt
    return float(step / dt)


@compiled
def find_speed_again(s: Vector, z: Vector, p: Vector) -> None:
    """Take the speed from the wheels where all of them seem to slide and yet agree, as after driving off."""
    mean = 0.25 * (z[WHEEL] + z[WHEEL + 1] + z[WHEEL + 2] + z[WHEEL + 3])
    if mean * p[P_RADIUS] < 0.7 * s[SPEED]:  # all locked, as on ice
        return
    for i in range(4):
        if not abs(z[WHEEL + i] - mean) <= AGREE * mean:
            return
    s[SPEED] = mean * p[P_RADIUS]
    for j in range(N):
        s[COVARIANCE + SPEED * N + j] = 0.0
        s[COVARIANCE + j * N + SPEED] = 0.0
    s[COVARIANCE] = 0.25
    for i in range(4):
        s[SLIDING + i], s[SLID_S + i], s[LOCKED + i] = 0.0, 0.0, 0.0


@compiled
def balance_forces(
    s: Vector, p: Vector, ax: float, ay: float, side_n: float, force: float, force_rate: float, applied: bool,
    dt: float,
) -> None:  # fmt: skip
    """Force balance: what the body feels against what the wheels give.

    (m + J) (a - b) = sum(T) / r - F_R + J g theta with J = 4 I / r^2. A sudden change is the road's before it is the
    pads': it is believed only after `REJECT_S`.
    """
    mass = p[P_MASS] * s[MASS]
    turn = 4.0 * p[P_INERTIA] / (p[P_RADIUS] * p[P_ARM])
    resistance = 0.5 * p[P_DRAG] * s[SPEED] * s[SPEED] + mass * G0 * p[P_ROLL]
    predicted = (force - resistance - side_n + turn * G0 * s[GRADE]) / (mass + turn) + s[BIAS]
    change = abs(p[R_ALIGN] * force_rate / mass)
    drive = not applied and abs(force) > MASS_FORCE_SHARE * mass and change < p[R_ACC]
    h = np.zeros(N)
    h[BIAS] = 1.0
    h[GRADE] = turn * G0 / (mass + turn)
    if drive:
        h[MASS] = -(predicted - s[BIAS] + G0 * p[P_ROLL]) * p[P_MASS] / (mass + turn)
    for i in range(4):
        gain = p[P_GAIN] if i < 2 else p[P_GAIN + 1]
        h[FRICTION + i] = -gain * s[PRESSURE_LAG + i] / p[P_ARM] / (mass + turn)
    variance = p[R_ACC] ** 2 + change * change + (0.05 * ay) ** 2
    gate = p[GATE] if p[ROAD] > 0.5 and s[REJECTED_S] < REJECT_S else 1e6
    if correct(s, h, ax - predicted, variance, gate, not drive, not applied):
        s[REJECTED_S] = 0.0
    else:
        s[REJECTED_S] += dt


@compiled
def compare_wheel_speed(
    s: Vector, p: Vector, i: int, omega: float, ground: float, load: float, acceleration: float, force_rate: float,
    learn: bool, applied: bool,
) -> None:  # fmt: skip
    """Wheel speed and its slip: omega = v (1 + kappa) / (R delta), kappa = F / C (1 + 0.38 (F / D)^2).

    ``ground`` is the speed under the wheel, m/s; the sensor shows it half a sample and half a tooth late.
    """
    end = 1.0 if i < 2 else -1.0
    gain = p[P_GAIN] if i < 2 else p[P_GAIN + 1]
    stiffness = load * (p[P_STIFF] + p[P_STIFF_SLOPE] * (load - 0.25 * p[P_MASS] * G0))
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
    correct(s, h, omega - predicted, sigma * sigma, p[GATE], True, not applied)


@compiled
def torque_of_standing_wheels(
    s: Vector, p: Vector, ax: float, acceleration: float, loads: Vector, spin: Vector
) -> None:
    """Torque of locked wheels: what the road gives, the force that the turning wheels leave over, by load."""
    locked_load = 0.0
    rest = p[P_MASS] * s[MASS] * (ax - s[BIAS]) + 0.5 * p[P_DRAG] * s[SPEED] * s[SPEED]
    for i in range(4):
        if s[LOCKED + i] > 0.0:
            locked_load += loads[i]
        else:
            own = wheel_force(s, p, i, loads[i], acceleration)
            if s[SLIDING + i] > 0.0:
                own += p[P_INERTIA] * (acceleration / p[P_RADIUS] - spin[i]) / p[P_ARM]
            rest -= own
    for i in range(4):
        if s[LOCKED + i] > 0.0:
            s[TORQUE + i] = min(max(rest * p[P_ARM] * loads[i] / locked_load, s[TORQUE + i]), 0.0)


@compiled
def stand(s: Vector, p: Vector) -> None:
    """The car stands: nothing to learn; a standing brake gives what holds the car, and no more than it can."""
    s[SPEED] = 0.0
    holding = 0.25 * p[P_MASS] * s[MASS] * G0 * s[GRADE] * p[P_ARM]
    for i in range(4):
        most = abs(s[TORQUE + i])
        s[TORQUE + i] = min(max(holding, -most), most)


@compiled
def keep_in_bounds(s: Vector) -> None:
    """Hold every estimate where it can make sense."""
    for i in range(4):
        s[FRICTION + i] = min(max(s[FRICTION + i], 0.05), 1.2)
        s[RADIUS + i] = min(max(s[RADIUS + i], 0.97), 1.03)
    s[MASS] = min(max(s[MASS], 0.7), 1.5)
    s[STIFFNESS] = min(max(s[STIFFNESS], 0.3), 3.0)
    s[AXLE] = min(max(s[AXLE], -0.3), 0.3)


@compiled
def joint_step(s: Vector, z: Vector, p: Vector, dt: float) -> Vector:
    """Advance the filter by one sample.

    Parameters
    ----------
    s : state of the last step (layout of this file); not changed.  z : inputs, NaN where not available; pressures Pa,
        motor torques Nm negative braking, ``DEMAND`` the demanded deceleration.  p : parameters,
        `estimator.joint_parameters`.  dt : time since the last sample, s.

    Returns
    -------
    new state; ``TORQUE`` holds the wheel torques, Nm, negative braking.
    """
    s = s.copy()
    fastest = -1.0
    for i in range(4):
        if z[WHEEL + i] > fastest:
            fastest = z[WHEEL + i]
    body = not isnan(z[AX])
    if s[STARTED] == 0.0:
        if fastest < 0.0 or not body:
            return s
        start(s, p, np.nanmedian(z[WHEEL : WHEEL + 4]) * p[P_RADIUS])
        for i in range(4):
            s[MOTOR_LAG + i] = 0.0 if isnan(z[MOTOR + i]) else z[MOTOR + i]
    yaw_rate = 0.0 if isnan(z[YAW_RATE]) else z[YAW_RATE]
    ay = 0.0 if isnan(z[AY]) else z[AY]
    steer = 0.0 if isnan(z[STEER]) else z[STEER] / p[P_STEER_RATIO]

    pressures = track_pressure_zero(s, z, p, dt)
    force, applied = update_torques(s, z, p, dt)
    force_rate = (force - s[FORCE_LAG]) / dt
    s[FORCE_LAG] = force
    if fastest <= 0.0 and s[SPEED] < 1.0:
        stand(s, p)
        return s

    ax = level_acceleration(s, z, p, dt)
    rear_m = p[P_BASE] - p[P_FRONT]
    lateral = rear_m * yaw_rate - s[SPEED] * ay / (G0 * p[P_CORNER])
    acceleration = ax - s[BIAS] - G0 * s[GRADE] + yaw_rate * lateral
    predict(s, p, acceleration, dt)
    speed = s[SPEED]
    loads, along, spin = np.empty(4), np.empty(4), np.zeros(4)
    wheel_states(s, p, ay, yaw_rate, steer, lateral, loads, along)

    sliding = False
    for i in range(4):
        s[SLIDING + i] = max(s[SLIDING + i] - dt, 0.0)
        omega = z[WHEEL + i]
        if p[ROAD] > 0.5 and not isnan(omega) and speed > 1.0:
            expected = wheel_force(s, p, i, loads[i], acceleration) / (loads[i] * p[P_STIFF] * s[STIFFNESS])
            spin[i] = watch_wheel(s, p, i, omega, along[i], expected, dt)
        else:
            s[LOCKED + i] = 0.0
        s[LAST_WHEEL + i] = 0.0 if isnan(omega) else omega
        s[SLID_S + i] = s[SLID_S + i] + dt if s[SLIDING + i] > 0.0 else 0.0
        sliding = sliding or s[SLIDING + i] > 0.0

    if min(min(s[SLID_S], s[SLID_S + 1]), min(s[SLID_S + 2], s[SLID_S + 3])) > LOST_S:
        find_speed_again(s, z, p)
    fast = speed > p[P_SPEED_MIN]
    if body and pressures and fast and not sliding:
        side_n = (rear_m / p[P_BASE]) * p[P_MASS] * s[MASS] * ay * np.sin(steer)
        balance_forces(s, p, ax, ay, side_n, force, force_rate, applied, dt)
    for i in range(4):
        if isnan(z[WHEEL + i]) or s[SLIDING + i] > 0.0 or along[i] < 1.0:
            continue
        ground = along[i] + s[SPEED] - speed  # what the measurements so far have changed
        compare_wheel_speed(
            s, p, i, z[WHEEL + i], ground, loads[i], acceleration, force_rate, fast and pressures, applied
        )
    keep_in_bounds(s)
    if body and s[LOCKED] + s[LOCKED + 1] + s[LOCKED + 2] + s[LOCKED + 3] > 0.0:
        torque_of_standing_wheels(s, p, ax, acceleration, loads, spin)
    return s
