"""One step of the joint filter."""

from math import isnan

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import entry, helper
from ecu.law.gravity import GRAVITY_MPS2
from ecu.law.joint.kalman import keep_in_bounds, predict, start
from ecu.law.joint.layout import (
    AX,
    AY,
    BIAS,
    EXPECTED,
    FORCE_LAG,
    GRADE,
    HOLD,
    LAST_WHEEL,
    LOAD_ACCELERATION,
    LOCKED,
    MASS,
    MOTOR,
    MOTOR_LAG,
    P_BASE,
    P_CORNER,
    P_FRONT,
    P_MASS,
    P_RADIUS,
    P_SPEED_MIN,
    P_STEER_RATIO,
    P_STIFF,
    R_ACC,
    REPEATED_S,
    ROAD,
    SLID_S,
    SLIDING,
    SPEED,
    STARTED,
    STEER,
    STIFFNESS,
    WHEEL,
    YAW_RATE,
)
from ecu.law.joint.measurements import balance_forces, compare_wheel_speed
from ecu.law.joint.motion import (
    apply_standstill,
    expected_acceleration,
    level_acceleration,
    median_wheel,
    watch_accelerometer,
    wheel_states,
)
from ecu.law.joint.sliding import LOST_S, count_odd_wheels, reinitialise_speed, torque_of_standing_wheels, watch_wheel
from ecu.law.joint.torque import track_pressure_zero, update_torques, wheel_force

Vector = NDArray[np.float64]

FRESH_S = 0.05
EXPECTED_MPS2 = 1.0  # what the acceleration out of the force balance can be off


@helper
def fastest_wheel(z: Vector) -> float:
    """Speed of the fastest wheel, rad/s; -1 where no wheel has one."""
    fastest = -1.0
    for i in range(4):
        if z[WHEEL + i] > fastest:
            fastest = z[WHEEL + i]
    return fastest


@helper
def predict_motion(
    s: Vector, z: Vector, p: Vector, dt: float, body: bool, force: float, side_n: float, ay: float, yaw_rate: float
) -> tuple[float, float, float]:
    """Predict the state with the body acceleration as input, or with the force balance's where it is not believed.

    Returns
    -------
    level acceleration as sensed, true acceleration, both m/s2, and lateral speed at the centre of gravity, m/s.
    """
    if body:
        ax, uncertainty = level_acceleration(s, z, p, dt), p[R_ACC]
    else:
        ax, uncertainty = expected_acceleration(s, p, force, side_n) + s[BIAS], EXPECTED_MPS2
        s[LOAD_ACCELERATION] += min(dt / 0.05, 1.0) * (ax - s[BIAS] - s[LOAD_ACCELERATION])
    lateral = (p[P_BASE] - p[P_FRONT]) * yaw_rate - s[SPEED] * ay / (GRAVITY_MPS2 * p[P_CORNER])
    acceleration = ax - s[BIAS] - GRAVITY_MPS2 * s[GRADE] + yaw_rate * lateral
    predict(s, p, acceleration, uncertainty, dt)
    return ax, acceleration, lateral


@helper
def watch_wheels(
    s: Vector, z: Vector, p: Vector, dt: float, acceleration: float, loads: Vector, along: Vector, spin: Vector
) -> bool:
    """Find the wheels that slide, with their spin, rad/s2, into ``spin``; whether any does."""
    sliding = False
    for i in range(4):
        s[SLIDING + i] = max(s[SLIDING + i] - dt, 0.0)
        omega = z[WHEEL + i]
        if p[ROAD] > 0.5 and not isnan(omega) and s[SPEED] > 1.0:
            expected = wheel_force(s, p, i, loads[i], acceleration) / (loads[i] * p[P_STIFF] * s[STIFFNESS])
            spin[i] = watch_wheel(s, p, i, omega, along[i], expected, dt)
        else:
            s[LOCKED + i] = 0.0
        s[LAST_WHEEL + i] = 0.0 if isnan(omega) else omega
        s[SLID_S + i] = s[SLID_S + i] + dt if s[SLIDING + i] > 0.0 else 0.0
        sliding = sliding or s[SLIDING + i] > 0.0
    if z[HOLD] == 0.0:
        count_odd_wheels(s, dt)
    return sliding


@helper
def compare_wheels(
    s: Vector, z: Vector, p: Vector, speed: float, acceleration: float, force_rate: float, loads: Vector, along: Vector,
    applied: bool, learning: bool, pressures: bool,
) -> None:  # fmt: skip
    """Update by the speed of each wheel that rolls; ``speed`` is the car's as predicted, m/s."""
    fast = speed > p[P_SPEED_MIN]
    for i in range(4):
        if isnan(z[WHEEL + i]) or s[SLIDING + i] > 0.0 or along[i] < 1.0:
            continue
        ground = along[i] + s[SPEED] - speed  # what the measurements so far have changed
        compare_wheel_speed(
            s, p, i, z[WHEEL + i], ground, loads[i], acceleration, force_rate, learning and fast and pressures,
            applied, not (learning and pressures),
        )  # fmt: skip


@entry
def joint_step(s: Vector, z: Vector, p: Vector, dt: float) -> Vector:
    """Advance the filter by one sample.

    Parameters
    ----------
    s : state of the last step (`layout`); not changed.  z : inputs, NaN where not available; pressures Pa,
        motor torques Nm negative braking, ``DEMAND`` the demanded deceleration.  p : parameters,
        `estimator.joint_parameters`.  dt : time since the last sample, s.

    Returns
    -------
    new state; ``TORQUE`` holds the wheel torques, Nm, negative braking.

    Without a believable acceleration the speed comes from the wheels and the force balance, and nothing is learned; nor
    is anything while a pressure or a motor torque is missing.
    """
    s = s.copy()
    fastest = fastest_wheel(z)
    if s[STARTED] == 0.0:
        if fastest < 0.0 or isnan(z[AX]):
            return s
        start(s, p, median_wheel(z) * p[P_RADIUS])
        for i in range(4):
            s[MOTOR_LAG + i] = 0.0 if isnan(z[MOTOR + i]) else z[MOTOR + i]
    body = watch_accelerometer(s, z, p, dt)
    yaw_rate = 0.0 if isnan(z[YAW_RATE]) else z[YAW_RATE]
    ay = 0.0 if isnan(z[AY]) else z[AY]
    steer = 0.0 if isnan(z[STEER]) else z[STEER] / p[P_STEER_RATIO]

    pressures = track_pressure_zero(s, z, p, dt) and z[HOLD] == 0.0
    force, applied = update_torques(s, z, p, dt)
    force_rate = (force - s[FORCE_LAG]) / dt
    s[FORCE_LAG] = force
    if fastest <= 0.0 and s[SPEED] < 1.0:
        apply_standstill(s, p)
        return s

    # predict
    side_n = ((p[P_BASE] - p[P_FRONT]) / p[P_BASE]) * p[P_MASS] * s[MASS] * ay * np.sin(steer)
    ax, acceleration, lateral = predict_motion(s, z, p, dt, body, force, side_n, ay, yaw_rate)
    speed = s[SPEED]
    loads, along, spin = np.empty(4), np.empty(4), np.zeros(4)
    wheel_states(s, p, ay, yaw_rate, steer, lateral, loads, along)

    # update
    sliding = watch_wheels(s, z, p, dt, acceleration, loads, along, spin)
    if min(min(s[SLID_S], s[SLID_S + 1]), min(s[SLID_S + 2], s[SLID_S + 3])) > LOST_S:
        reinitialise_speed(s, z, p)
    learning = body and s[REPEATED_S] < FRESH_S
    if learning and pressures and speed > p[P_SPEED_MIN] and not sliding:
        balance_forces(s, p, ax, ay, side_n, force, force_rate, applied, dt)
    compare_wheels(s, z, p, speed, acceleration, force_rate, loads, along, applied, learning, pressures)

    # bound
    keep_in_bounds(s)
    s[EXPECTED] = expected_acceleration(s, p, force, side_n) + s[BIAS]
    if body and s[LOCKED] + s[LOCKED + 1] + s[LOCKED + 2] + s[LOCKED + 3] > 0.0:
        torque_of_standing_wheels(s, p, ax, acceleration, loads, spin)
    return s
