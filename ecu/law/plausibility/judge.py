"""All checks of one sample, compiled in one."""

from functools import lru_cache
from math import isnan

import numpy as np
from numpy.typing import NDArray

from ecu.law.compiled import entry, helper
from ecu.law.joint.layout import AX, AY, INPUTS, MOTOR, PRESSURE, STEER, WHEEL, YAW_RATE
from ecu.law.plausibility.acceleration import believe_reports, judge_acceleration
from ecu.law.plausibility.actuators import judge_motors, judge_pressures
from ecu.law.plausibility.layout import (
    ACCELERATION_BIT,
    BEGUN,
    EXCLUDED_S,
    MOTOR_BIT,
    OPPOSING,
    PRESSURE_BIT,
    REPORTED,
    SIZE,
    WHEEL_BIT,
)
from ecu.law.plausibility.wheels import judge_wheels
from ecu.law.types import Four, Plausibility
from ecu.parameters.ecu import EcuParameters

Vector = NDArray[np.float64]

# beyond any value that the contract of the vehicle bus can carry, by an order of magnitude
ACCELERATION_LIMIT, RATE_LIMIT, ANGLE_LIMIT = 500.0, 50.0, 200.0
WHEEL_LIMIT, PRESSURE_LIMIT, TORQUE_LIMIT = 5e3, 5e8, 2e4


@helper
def drop_unlimited(z: Vector) -> None:
    """Take out of ``z`` what is infinite or beyond all limits."""
    for k in range(INPUTS):
        if k in (AX, AY):
            most = ACCELERATION_LIMIT
        elif k == YAW_RATE:
            most = RATE_LIMIT
        elif k == STEER:
            most = ANGLE_LIMIT
        elif WHEEL <= k < PRESSURE:
            most = WHEEL_LIMIT
        elif PRESSURE <= k < MOTOR:
            most = PRESSURE_LIMIT
        elif MOTOR <= k < MOTOR + 4:
            most = TORQUE_LIMIT
        else:
            most = np.inf
        if abs(z[k]) > most:
            z[k] = np.nan


@helper
def judge_sample(
    s: Vector, z: Vector, p: Vector, speed: float, expected: float, grade: float, dt: float
) -> tuple[int, float]:
    """Judge one sample; the state ``s`` is advanced in place, for the rest see `judge`."""
    begun = s[BEGUN] > 0.0
    drop_unlimited(z)
    ax = z[AX]
    excluded = s[EXCLUDED_S] + s[EXCLUDED_S + 1] + s[EXCLUDED_S + 2] + s[EXCLUDED_S + 3] > 0.0
    if excluded:
        believe_reports(s, z, p, ax, expected, dt)
    else:
        s[REPORTED] = 0.0
    bits, top = judge_wheels(s, z, p, 0.0 if isnan(speed) else speed, begun, dt)
    bits |= judge_pressures(s, z, p, dt)
    bits |= judge_motors(s, z, p, dt)
    bits |= judge_acceleration(s, z, p, 0.0 if isnan(speed) else speed, expected, grade, begun, dt)
    s[BEGUN] = 1.0
    return bits, top


@entry
def judge(
    s: Vector, z: Vector, p: Vector, speed: float, expected: float, grade: float, dt: float
) -> tuple[Vector, int, float]:
    """Judge one sample.

    Parameters
    ----------
    s : state of the last sample (`layout`); not changed.
    z : inputs of the observers (`joint.layout`); what is not believed is changed in place, to NaN or to what is likely,
        and ``HOLD`` is set where nothing may be learned from the sample.
    p : from `judge_parameters`.  speed : the observer's, m/s.
    expected : acceleration that the force balance expects of the sensor, m/s2; NaN where there is none.
    grade : what the sensor shows of its offset and of the grade, m/s2.
    dt : time since the last sample, s.

    Returns
    -------
    new state; bits of what has been wrong for long enough (`layout`); speed of the fastest wheel that can be, rad/s.
    """
    s = s.copy()
    bits, top = judge_sample(s, z, p, speed, expected, grade, dt)
    return s, bits, top


def initial_state() -> Vector:
    """State before the first sample."""
    return np.zeros(SIZE)


@lru_cache(maxsize=16)
def judge_parameters(parameters: EcuParameters) -> Vector:
    """Parameter vector of `judge`."""
    v, q = parameters.vehicle, parameters.plausibility
    return np.array(
        (
            q.forget, q.heal_s, v.rolling_radius_m, v.mass_kg, v.force_arm_m,
            q.wheel_s, q.wheel_fall_rad_s2, q.wheel_rise_rad_s2, q.wheel_above, q.wheel_above_mps, q.speed_max_mps,
            q.pressure_s, q.pressure_pa, q.pressure_share, q.pressure_lag_s,
            q.motor_s, q.motor_nm, q.motor_share, q.motor_lag_s, q.motor_rate_nm_s, q.motor_start_s, q.motor_retry_s,
            q.acceleration_s, q.acceleration_mps2, q.acceleration_share, q.acceleration_lag_s,
            q.acceleration_jump_mps2, q.acceleration_rough_mps2, parameters.motor.torque_max_nm,
        )
    )  # fmt: skip


def plausibility_of(
    bits: int, slow_wheels: tuple[bool, bool, bool, bool], stuck: bool, pedal: tuple[bool, bool], pedal_disagree: bool
) -> Plausibility:
    """Faults as `supervise` takes them.

    Parameters
    ----------
    bits : from `judge`.  slow_wheels, stuck : from the observer.  pedal, pedal_disagree : from `pedal.read_pedal`.
    """
    w = WHEEL_BIT
    a, b, c, d = slow_wheels
    return Plausibility(
        (a or bool(bits >> w & 1), b or bool(bits >> w + 1 & 1), c or bool(bits >> w + 2 & 1),
         d or bool(bits >> w + 3 & 1)),
        _four_bits(bits, PRESSURE_BIT),
        _four_bits(bits, MOTOR_BIT),
        pedal,
        pedal_disagree,
        stuck or bool(bits >> ACCELERATION_BIT & 1),
    )  # fmt: skip


def _four_bits(bits: int, start: int) -> tuple[bool, bool, bool, bool]:
    b = bits >> start
    return (bool(b & 1), bool(b & 2), bool(b & 4), bool(b & 8))


def opposing_torque(s: Vector) -> Four:
    """Torque of each wheel with which its motor drives against the brake, Nm, positive."""
    a, b, c, d = s[OPPOSING : OPPOSING + 4].tolist()
    return (a, b, c, d)
