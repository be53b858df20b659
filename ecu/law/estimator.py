"""What the controller knows about the car beyond its signals: one result, whichever observer it comes from."""

import math
from functools import lru_cache
from struct import Struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.law import friction
from ecu.law import paper_observer as paper
from ecu.law.compiled import entry
from ecu.law.gravity import GRAVITY_MPS2
from ecu.law.joint import layout as joint
from ecu.law.joint.estimates import TOLD, write_estimates
from ecu.law.joint.filter import advance
from ecu.law.plausibility.judge import judge, judge_parameters, judge_sample
from ecu.law.types import UNKNOWN, ZERO, Four, Inputs, Source
from ecu.parameters.ecu import EcuParameters

Vector = NDArray[np.float64]
PLAUSIBLE = (False, False, False, False)
_PACK = Struct(f"{joint.INPUTS}d").pack
_new = tuple.__new__  # without the Python-made one of a NamedTuple


class Estimates(NamedTuple):
    """Speed over ground, wheel torques (negative braking), pad friction with confidence 0..1, mass over nominal.

    ``implausible`` wheels have not turned as the car moves for longer than a wheel slides; ``stuck``: the acceleration
    sensor repeats itself while the wheels tell of another acceleration. ``expected_mps2``: what it should show by
    the wheels' torques, NaN where that is not known; ``grade_mps2``: what it shows of its offset and of the grade.
    """

    speed_mps: float
    wheel_torque_nm: Four
    pad_friction: Four
    confidence: Four
    mass_factor: float
    implausible: tuple[bool, bool, bool, bool] = PLAUSIBLE
    stuck: bool = False
    expected_mps2: float = math.nan
    grade_mps2: float = 0.0


def _four(values: Vector, start: int) -> Four:
    a, b, c, d = values[start : start + 4].tolist()
    return (a, b, c, d)


def measured(
    inputs: Inputs,
    lost: tuple[bool, ...],
    demand_mps2: float,
    asked_pressure_pa: Four,
    asked_motor_nm: Four,
    torque_per_current_nm_a: float,
) -> Vector:
    """Inputs of the observers (`joint.layout`), NaN where a source is lost.

    Parameters
    ----------
    demand_mps2 : demanded deceleration.
    asked_pressure_pa, asked_motor_nm : what was asked of the actuators in the last step; NaN of one that does not
        follow.
    """
    nan, k = math.nan, torque_per_current_nm_a
    w, q, i = inputs.wheel_speed_rad_s, inputs.pressure_pa, inputs.motor_current_a
    if True not in lost:
        a, b, c, d = i
        packed = _PACK(
            inputs.acceleration_x_mps2, inputs.acceleration_y_mps2, inputs.yaw_rate_rad_s,
            inputs.steering_wheel_angle_rad, demand_mps2, *w, *q, k * a, k * b, k * c, k * d,
            *inputs.motor_available_nm, *asked_pressure_pa, *asked_motor_nm, 0.0,
        )  # fmt: skip
        return np.frombuffer(bytearray(packed))  # writable; half the time of np.array
    body = not lost[Source.BODY_MOTION]
    front_w, rear_w = not lost[Source.WHEEL_SPEED_FRONT], not lost[Source.WHEEL_SPEED_REAR]
    front_q, rear_q = not lost[Source.EHB_PRESSURE_FRONT], not lost[Source.EHB_PRESSURE_REAR]
    front_i, rear_i = not lost[Source.MOTOR_FRONT], not lost[Source.MOTOR_REAR]
    packed = _PACK(
        inputs.acceleration_x_mps2 if body else nan,
        inputs.acceleration_y_mps2 if body else nan,
        inputs.yaw_rate_rad_s if body else nan,
        nan if lost[Source.STEERING] else inputs.steering_wheel_angle_rad,
        demand_mps2,
        w[0] if front_w else nan,
        w[1] if front_w else nan,
        w[2] if rear_w else nan,
        w[3] if rear_w else nan,
        q[0] if front_q else nan,
        q[1] if front_q else nan,
        q[2] if rear_q else nan,
        q[3] if rear_q else nan,
        k * i[0] if front_i else nan,
        k * i[1] if front_i else nan,
        k * i[2] if rear_i else nan,
        k * i[3] if rear_i else nan,
        *inputs.motor_available_nm,
        *asked_pressure_pa,
        *asked_motor_nm,
        0.0,
    )
    return np.frombuffer(bytearray(packed))


@lru_cache(maxsize=16)
def joint_parameters(parameters: EcuParameters) -> Vector:
    """Parameter vector of the joint filter."""
    v, b, t, s, j = (
        parameters.vehicle,
        parameters.friction_brake,
        parameters.tyre,
        parameters.signal,
        parameters.joint_filter,
    )
    brake = friction.gains(b)
    return np.array(
        (
            v.mass_kg,
            v.wheelbase_m,
            v.cog_to_front_axle_m,
            v.cog_height_m,
            v.rolling_radius_m,
            v.force_arm_m,
            v.wheel_inertia_kg_m2,
            v.air_density_kg_m3 * v.drag_area_m2,
            v.rolling_resistance,
            v.dive_gradient_rad_s2_m,
            v.steering_ratio,
            *v.track_m,
            brake[0],
            brake[2],
            b.threshold_pressure_pa,
            t.stiffness_per_load,
            t.stiffness_load_slope_1_n,
            t.peak_friction,
            t.cornering_stiffness_per_load,
            t.relaxation_m,
            s.acceleration_lag_s,
            s.wheel_speed_lag_s,
            2.0 * math.pi * s.pitch_frequency_hz,
            s.pitch_damping,
            s.pressure_zero_time_s,
            s.pressure_zero_limit_pa,
            s.friction_speed_min_mps,
            s.sliding_slip,
            math.pi * v.rolling_radius_m / s.teeth,  # half the way between two teeth
            j.drift_bias_mps2**2,
            j.drift_grade**2,
            j.drift_stiffness**2,
            *(d * d for d in j.drift_friction),
            j.drift_friction_released**2,
            j.acceleration_mps2,
            j.alignment_s,
            j.wheel_speed,
            j.gate,
            float(parameters.compensation.road_correction),
            j.start_bias_mps2**2,
            j.start_grade**2,
            j.start_mass**2,
            j.start_stiffness**2,
            j.start_stiffness_axle**2,
            j.start_radius**2,
            *(d * d for d in j.start_friction),
            b.pad_friction,
        )
    )


def initial_state(parameters: EcuParameters) -> Vector:
    """State of the chosen observer before anything was measured."""
    size = joint.SIZE if parameters.compensation.method == "joint" else paper.SIZE
    return np.zeros(size)


@entry
def _observe(
    watch: Vector, state: Vector, z: Vector, checks: Vector, p: Vector, full: float, dt: float, told: Vector
) -> None:
    started = state[joint.STARTED] != 0.0
    speed = state[joint.SPEED] if started else 0.0
    expected = state[joint.EXPECTED] if started else np.nan
    grade = state[joint.BIAS] + GRAVITY_MPS2 * state[joint.GRADE] if started else 0.0
    bits, top = judge_sample(watch, z, checks, speed, expected, grade, dt)
    advance(state, z, p, dt)
    write_estimates(state, full, told)
    told[TOLD], told[TOLD + 1] = bits, top


def observe(
    watch: Vector, state: Vector, known: Estimates, z: Vector, parameters: EcuParameters, dt_s: float
) -> tuple[Vector, int, float, Vector, Estimates]:
    """Judge one sample, and advance the chosen observer by what is left of it.

    Parameters
    ----------
    watch, state : of the checks and of the observer, after the last sample; not changed.  known : estimates then.
    z : from `measured`; what is not believed is changed in place (see `plausibility.judge`).
    dt_s : time since the last sample.

    Returns
    -------
    new state of the checks; bits of what they found (`plausibility.layout`); speed of the fastest wheel that can be,
    rad/s; new state of the observer; estimates.
    """
    checks = judge_parameters(parameters)
    if parameters.compensation.method != "joint":
        watch, found, top = judge(watch, z, checks, known.speed_mps, known.expected_mps2, known.grade_mps2, dt_s)
        state = paper.paper_step(state, z, paper_parameters(parameters), dt_s)
        speed, mu = float(state[paper.SPEED]), _four(state, paper.FRICTION)
        estimates = Estimates(speed, _four(state, paper.WHEEL_TORQUE), mu, _four(state, paper.CONFIDENCE), 1.0)
        return watch, found, top, state, estimates
    watch, state, told = watch.copy(), state.copy(), np.empty(TOLD + 2)  # arrays made by compiled code cost more
    full = parameters.compensation.confidence_full
    _observe(watch, state, z, checks, joint_parameters(parameters), full, dt_s, told)
    (
        started, speed, mass, stuck, expected, grade, t0, t1, t2, t3, m0, m1, m2, m3, c0, c1, c2, c3, o0, o1, o2, o3,
        bits, top,
    ) = told.tolist()  # fmt: skip
    if not started:
        nominal = parameters.friction_brake.pad_friction
        return watch, int(bits), top, state, Estimates(0.0, UNKNOWN, (nominal,) * 4, ZERO, 1.0)
    odd = (o0 > 0.0, o1 > 0.0, o2 > 0.0, o3 > 0.0) if o0 or o1 or o2 or o3 else PLAUSIBLE
    torque, mu, confidence = (t0, t1, t2, t3), (m0, m1, m2, m3), (c0, c1, c2, c3)
    estimates = _new(Estimates, (speed, torque, mu, confidence, mass, odd, stuck != 0.0, expected, grade))
    return watch, int(bits), top, state, estimates


@lru_cache(maxsize=16)
def paper_parameters(parameters: EcuParameters) -> Vector:
    """Parameter vector of the paper's observer."""
    v, b, o = parameters.vehicle, parameters.friction_brake, parameters.paper_observer
    t = parameters.tyre
    brake = friction.gains(b)
    return np.array(
        (
            v.mass_kg,
            v.wheelbase_m,
            v.cog_to_front_axle_m,
            v.cog_height_m,
            v.force_arm_m,
            v.wheel_inertia_kg_m2,
            v.air_density_kg_m3 * v.drag_area_m2,
            v.rolling_resistance,
            v.steering_ratio,
            *v.track_m,
            brake[0],
            brake[2],
            b.threshold_pressure_pa,
            b.pad_friction,
            *t.burckhardt,
            t.cornering_stiffness_per_load,
            o.drift_acceleration_rad_s2,
            o.drift_force_n,
            o.drift_torque_nm,
            o.wheel_speed_rad_s,
            o.force_n,
            o.k_window,
            o.k_limit,
            o.force_min_n,
            o.friction_window,
            o.pressure_delay_s,
            o.pressure_min_pa,
            o.speed_min_mps,
            float(parameters.compensation.road_correction),
            v.dive_gradient_rad_s2_m,
        ),
        dtype=np.float64,
    )
