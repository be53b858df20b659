"""What the controller knows about the car beyond its signals: one result, whichever observer it comes from."""

import math
from functools import lru_cache
from struct import Struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.law import friction
from ecu.law import paper_observer as paper
from ecu.law.joint import layout as joint
from ecu.law.joint.estimates import read_estimates
from ecu.law.joint.filter import joint_step
from ecu.law.types import UNKNOWN, ZERO, Four, Inputs, Source
from ecu.parameters.ecu import EcuParameters

Vector = NDArray[np.float64]
PLAUSIBLE = (False, False, False, False)
_PACK = Struct(f"{joint.INPUTS}d").pack


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
    nan = math.nan
    body = not lost[Source.BODY_MOTION]
    w, q, i = inputs.wheel_speed_rad_s, inputs.pressure_pa, inputs.motor_current_a
    k = torque_per_current_nm_a
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
    return np.frombuffer(bytearray(packed))  # writable; half the time of np.array


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


def estimate(state: Vector, z: Vector, parameters: EcuParameters, dt_s: float) -> tuple[Vector, Estimates]:
    """Advance the chosen observer by one sample.

    Parameters
    ----------
    state : of the last sample; not changed.  z : from `measured`.  dt_s : time since the last sample.
    """
    nominal = parameters.friction_brake.pad_friction
    if parameters.compensation.method == "joint":
        state = joint_step(state, z, joint_parameters(parameters), dt_s)
        started, speed, torque, mu, confidence, mass, implausible, stuck, expected, level = read_estimates(
            state, parameters.compensation.confidence_full
        )
        if not started:
            return state, Estimates(0.0, UNKNOWN, (nominal, nominal, nominal, nominal), ZERO, 1.0)
        return state, Estimates(speed, torque, mu, confidence, mass, implausible, stuck, expected, level)
    state = paper.paper_step(state, z, paper_parameters(parameters), dt_s)
    return state, Estimates(
        float(state[paper.SPEED]),
        _four(state, paper.WHEEL_TORQUE),
        _four(state, paper.FRICTION),
        _four(state, paper.CONFIDENCE),
        1.0,
    )


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
