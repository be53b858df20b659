"""IMU scale and misalignment."""

import numpy as np

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vehicle import GRAVITY_MPS2


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """ax' = ax (1+e) + g sin m + c ay."""
    out = values.copy()
    constant = GRAVITY_MPS2 * np.sin(number["tilt_rad"][:, 0])
    out[:, 0] = values[:, 0] * (1.0 + number["gain"][:, 0]) + constant + number["cross"][:, 0] * values[:, 1]
    return out


def undo(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """Inverse of `sense`."""
    out = values.copy()
    constant = GRAVITY_MPS2 * np.sin(number["tilt_rad"][:, 0])
    out[:, 0] = (values[:, 0] - constant - number["cross"][:, 0] * values[:, 1]) / (1.0 + number["gain"][:, 0])
    return out


EFFECT = Effect(
    name="imu_gain",
    row=56,
    title="IMU scale and misalignment",
    equation="ax' = ax (1+e) + g sin m + c ay",
    injection_points=("sensor.imu",),
    acts_when=Excitation.NONE,
    scope=Scope.CAR,
    parameters=(
        Parameter("gain", "", -0.2, 0.2, 0.02, factor=1),
        Parameter("tilt_rad", "rad", -0.1, 0.1, 0.02),
        Parameter("cross", "", -0.1, 0.1, 0.02),
    ),
    source="M: 1 to 4 %, 1 to 2 degrees, 0.17 m/s2 per degree",
    signature="proportional to ax, to ay, and constant",
    manoeuvre="brake_in_turn",
    confounded_with=("pitch_dive", "road_grade"),
    twins=("imu_bias",),
    sense=sense,
    undo=undo,
    nodes=("imu",),
)
