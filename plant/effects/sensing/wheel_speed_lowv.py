"""Wheel speeds drop out at low speed."""

import numpy as np

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """w' = 0 below a threshold."""
    return np.where(np.abs(values) < number["threshold_rad_s"], 0.0, values)


EFFECT = Effect(
    name="wheel_speed_lowv",
    row=60,
    title="Wheel speeds drop out at low speed",
    equation="w' = 0 below a threshold",
    injection_points=("sensor.wheel",),
    acts_when=Excitation.NONE,
    scope=Scope.CAR,
    parameters=(Parameter("threshold_rad_s", "rad/s", 0.0, 20.0, 2.5),),
    source="S: zero below 2 to 3 km/h on many cars",
    signature="drop to zero before the stop",
    manoeuvre="straight_stop",
    confounded_with=("low_speed",),
    sense=sense,
    nodes=("wheel",),
)
