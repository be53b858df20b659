"""Excitation: what happens in a segment (brakes, motors, steering, motion) that lets a parameter show.

Takes two parameter sets, gives the excitation that a segment needs for them to differ; the others need not be simulated
(`hil.diagnosis.simulation.simulator.Simulator.with_baseline`). The lists follow from sensitivities over a whole set of
recordings: what they leave out holds less than a hundredth of a parameter's information.
"""

from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.data.dataset import Recording
from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.prepare import STRAIGHT_RAD
from hil.diagnosis.simulation.sensors import OUTPUT_SENSORS
from plant.effects.effect import NODES
from plant.inject import J
from plant.injection.theta import THETA
from plant.injection_points import INJECTION_POINTS, field
from plant.vectors import INPUT, PARAMETER


class Excitation(IntFlag):
    """What a segment has, or needs for a parameter to matter."""

    NOTHING = 0
    BRAKES = 1
    MOTORS = 2
    TURNING = 4
    DRIVING = 8
    MOVING = 16


_LEAST_PA, _LEAST_NM, _LEAST_MPS2, _LEAST_MPS = 5e4, 8.0, 0.3, 0.3
"""A segment that stays below has no excitation of brakes (Pa), motors (N m), turning (m/s^2) or motion (m/s): what they
change there is below noise. A standing car that no motor pulls shows nothing of tyres, wheels, springs and masses."""
_SECTIONS = {
    "ehb_": Excitation.BRAKES, "friction_brake_": Excitation.BRAKES, "pad_": Excitation.BRAKES,
    "motor_": Excitation.MOTORS, "battery_": Excitation.MOTORS,
}  # fmt: skip
_LATERAL = (
    "tyre_lky", "tyre_lmuy", "vehicle_steering_ratio", "vehicle_yaw_inertia_kg_m2", "suspension_anti_roll_nm_rad",
    "suspension_roll_centre_height_m", "vehicle_slip_angle_share", "tyre_pky2",
)  # fmt: skip
_AT_JOINT = {
    "friction.mu": Excitation.BRAKES, "brake.pressure": Excitation.BRAKES, "brake.torque": Excitation.BRAKES,
    "hydraulics.rate": Excitation.BRAKES, "hydraulics.demand": Excitation.BRAKES, "motor.demand": Excitation.MOTORS,
    "motor.available": Excitation.MOTORS, "motor.torque": Excitation.MOTORS, "tyre.stiffness": Excitation.MOVING,
    "road.friction": Excitation.MOVING, "wheel.radius": Excitation.MOVING, "wheel.rolling_torque": Excitation.MOVING,
    "contact.speed": Excitation.MOVING, "steering.angle": Excitation.MOVING,
}  # fmt: skip
_ALWAYS = ("residual_drag", "stuck_corner", "ehb_deadband", "cogging")
"""Effects that act while nothing is applied, or on demands below these limits."""
_OF_NODE = {
    "imu": Excitation.NOTHING,
    "pressure": Excitation.BRAKES,
    "motor": Excitation.MOTORS,
    "driver": Excitation.NOTHING,
}
_MOVES_START = "wrong_scale"
_PER_NODE = (_MOVES_START, "timestamp_offset", "clock_drift")
OF_LATENCY = (
    Excitation.NOTHING,
    Excitation.BRAKES,
    Excitation.MOTORS,
    Excitation.BRAKES | Excitation.MOTORS,
    Excitation.TURNING,
    Excitation.TURNING,
)
"""For the latency of each node (`hil.diagnosis.vehicle.priors.LATENCY_NODES`)."""


def _of_parameter(name: str) -> Excitation:
    if name in _LATERAL:
        return Excitation.TURNING
    return next((needed for start, needed in _SECTIONS.items() if name.startswith(start)), Excitation.MOVING)


def _of_joint(joint: str) -> Excitation:
    return _AT_JOINT.get(joint, Excitation.DRIVING) if joint in INJECTION_POINTS else _of_parameter(joint)


def _of_parameters() -> NDArray[np.int64]:
    needed = np.zeros(PARAMETER.size, np.int64)
    for name in PARAMETER.sizes:
        needed[PARAMETER.slice(name)] = _of_parameter(name)
    return needed


def _of_theta() -> NDArray[np.int64]:
    needed = np.full(THETA.size, int(Excitation.DRIVING), np.int64)
    for effect in THETA.effects:
        joints = [_of_joint(joint) for joint in effect.injection_points]
        for parameter in effect.strengths:
            where = THETA.slice(effect.name, parameter.name)
            if effect.name not in _ALWAYS and Excitation.DRIVING not in joints:
                needed[where] = int(np.bitwise_or.reduce([int(one) for one in joints]))
            elif effect.name == "pressure_gain":
                needed[where] = Excitation.BRAKES
            elif effect.name in _PER_NODE:
                for node, of_node in _OF_NODE.items():
                    needed[where.start + NODES.index(node)] = of_node
                if effect.name != _MOVES_START:
                    needed[where.start + NODES.index("wheel")] = Excitation.NOTHING
    needed[OUTPUT_SENSORS] = Excitation.NOTHING
    needed[THETA.slice("speed_scale", "gain")] = Excitation.DRIVING  # the start speed where no wheel speed is measured
    return needed


_PARAMETER, _THETA = _of_parameters(), _of_theta()
_TERM = {int(getattr(J, field(joint))): needed for joint, needed in _AT_JOINT.items()}


def of_parameters(one: Floats, other: Floats) -> Excitation:
    """Excitation for two vectors of vehicle parameters, (PARAMETER.size,), to differ."""
    return Excitation(int(np.bitwise_or.reduce(_PARAMETER[one != other], initial=0)))


def of_effects(one: Floats, other: Floats) -> Excitation:
    """Excitation for two vectors of effect parameters, (THETA.size,), to differ."""
    return Excitation(int(np.bitwise_or.reduce(_THETA[one != other], initial=0)))


def of_terms(one: Floats, other: Floats) -> Excitation:
    """Excitation for two banks of nonparametric terms to differ, one of which has a few rows more."""
    more, fewer = (one, other) if len(one) >= len(other) else (other, one)
    if not np.array_equal(more[: len(fewer)], fewer):
        return Excitation.DRIVING
    needed = Excitation.NOTHING
    for row in more[len(fewer) :]:
        needed |= _TERM.get(int(row[0]), Excitation.DRIVING)
    return needed


def excitation_of(inputs: Floats, speed_mps: Floats, ay_mps2: Floats | None) -> Excitation:
    """Excitation of a segment: inputs (rows, INPUT.size), speed and lateral acceleration (samples,), where measured."""

    def most(*parts: str) -> float:
        return max(float(np.abs(inputs[:, INPUT.slice(part)]).max(initial=0.0)) for part in parts)

    present = Excitation.DRIVING
    if most("pressure_pa", "pressure_demand_pa") > _LEAST_PA:
        present |= Excitation.BRAKES
    if most("motor_torque_nm", "motor_demand_nm") > _LEAST_NM:
        present |= Excitation.MOTORS | Excitation.MOVING
    if float(np.abs(speed_mps).max(initial=0.0)) > _LEAST_MPS:
        present |= Excitation.MOVING
    turns = ay_mps2 is not None and float(np.nanquantile(np.abs(ay_mps2), 0.9)) > _LEAST_MPS2
    if turns or most("steering_wheel_rad") > STRAIGHT_RAD:
        present |= Excitation.TURNING
    return present


def segment_excitations(recording: Recording) -> tuple[Excitation, ...]:
    """Excitation of each segment of a recording."""
    ay, stride = recording.measured.get("ay"), recording.stride
    excitations = []
    for segment in recording.segments:
        samples = slice(segment.first // stride, segment.last // stride)
        inputs, speed_mps = recording.inputs[segment.first : segment.last], recording.speed_mps[samples]
        excitations.append(excitation_of(inputs, speed_mps, None if ay is None else ay[samples]))
    return tuple(excitations)
