"""Where a number of the car can matter: nothing a brake does shows while the brakes are released.

Sensitivities are replayed over those segments only (`hil.diagnosis.simulation.simulator.Simulator.keep`). The lists follow from
sensitivities over a whole set of drives: what they leave out holds less than a hundredth of a number's information.
"""

from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.prepare import STRAIGHT_RAD
from hil.diagnosis.simulation.sensors import OUTPUT_SENSORS
from plant.effects.effect import NODES
from plant.inject import J
from plant.injection.theta import THETA
from plant.injection_points import INJECTION_POINTS, field
from plant.vectors import INPUT, PARAMETER


class Excitation(IntFlag):
    """What is going on in a segment, or has to be for a number to matter."""

    NOTHING = 0
    BRAKES = 1
    MOTORS = 2
    TURNING = 4
    DRIVING = 8
    MOVING = 16


_LEAST_PA, _LEAST_NM, _LEAST_MPS2, _LEAST_MPS = 5e4, 8.0, 0.3, 0.3
"""Below in all of a segment, brakes and motors change nothing that noise would not hide, the car runs straight, or it
stands: one that no motor pulls tells nothing of its tyres, wheels, springs and masses."""
_SECTIONS = {
    "ehb_": Excitation.BRAKES, "friction_brake_": Excitation.BRAKES, "pad_": Excitation.BRAKES, "motor_": Excitation.MOTORS,
    "battery_": Excitation.MOTORS,
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
"""Effects that act while nothing is applied, or on demands too small to count."""
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
"""What must be going on for the latency of each node (`hil.diagnosis.simulation.parameter_set.LATENCY_NODES`) to matter."""


def _of_number(name: str) -> Excitation:
    if name in _LATERAL:
        return Excitation.TURNING
    return next((acting for start, acting in _SECTIONS.items() if name.startswith(start)), Excitation.MOVING)


def _of_joint(joint: str) -> Excitation:
    return _AT_JOINT.get(joint, Excitation.DRIVING) if joint in INJECTION_POINTS else _of_number(joint)


def _of_parameters() -> NDArray[np.int64]:
    found = np.zeros(PARAMETER.size, np.int64)
    for name in PARAMETER.sizes:
        found[PARAMETER.slice(name)] = _of_number(name)
    return found


def _of_theta() -> NDArray[np.int64]:
    found = np.full(THETA.size, int(Excitation.DRIVING), np.int64)
    for effect in THETA.effects:
        joints = [_of_joint(joint) for joint in effect.injection_points]
        for parameter in effect.strengths:
            where = THETA.slice(effect.name, parameter.name)
            if effect.name not in _ALWAYS and Excitation.DRIVING not in joints:
                found[where] = int(np.bitwise_or.reduce([int(one) for one in joints]))
            elif effect.name == "pressure_gain":
                found[where] = Excitation.BRAKES
            elif effect.name in _PER_NODE:
                for node, acting in _OF_NODE.items():
                    found[where.start + NODES.index(node)] = acting
                if effect.name != _MOVES_START:
                    found[where.start + NODES.index("wheel")] = Excitation.NOTHING
    found[OUTPUT_SENSORS] = Excitation.NOTHING
    found[THETA.slice("speed_scale", "gain")] = Excitation.DRIVING  # where no wheel tells how fast a segment begins
    return found


_PARAMETER, _THETA = _of_parameters(), _of_theta()
_TERM = {int(getattr(J, field(joint))): acting for joint, acting in _AT_JOINT.items()}


def of_parameters(one: Floats, other: Floats) -> Excitation:
    """What must be going on for two sets of parameters to differ."""
    return Excitation(int(np.bitwise_or.reduce(_PARAMETER[one != other], initial=0)))


def of_effects(one: Floats, other: Floats) -> Excitation:
    """What must be going on for two thetas to differ."""
    return Excitation(int(np.bitwise_or.reduce(_THETA[one != other], initial=0)))


def of_terms(one: Floats, other: Floats) -> Excitation:
    """What must be going on for two banks of terms to differ, one of which has a few rows more."""
    more, fewer = (one, other) if len(one) >= len(other) else (other, one)
    if not np.array_equal(more[: len(fewer)], fewer):
        return Excitation.DRIVING
    found = Excitation.NOTHING
    for row in more[len(fewer) :]:
        found |= _TERM.get(int(row[0]), Excitation.DRIVING)
    return found


def excitation_of(inputs: Floats, speed_mps: Floats, ay_mps2: Floats | None) -> Excitation:
    """What is going on in a segment, (rows, INPUT.size) of inputs; ``ay_mps2`` where it is measured."""

    def most(*parts: str) -> float:
        return max(float(np.abs(inputs[:, INPUT.slice(part)]).max(initial=0.0)) for part in parts)

    found = Excitation.DRIVING
    if most("pressure_pa", "pressure_demand_pa") > _LEAST_PA:
        found |= Excitation.BRAKES
    if most("motor_torque_nm", "motor_demand_nm") > _LEAST_NM:
        found |= Excitation.MOTORS | Excitation.MOVING
    if float(np.abs(speed_mps).max(initial=0.0)) > _LEAST_MPS:
        found |= Excitation.MOVING
    turned = ay_mps2 is not None and float(np.nanquantile(np.abs(ay_mps2), 0.9)) > _LEAST_MPS2
    if turned or most("steering_wheel_rad") > STRAIGHT_RAD:
        found |= Excitation.TURNING
    return found
