"""Pedal sensor zero and scale off."""

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """s' = s (1+e) + o."""
    return values * (1.0 + number["gain"]) + number["offset"]


def undo(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """Inverse of `sense`."""
    return (values - number["offset"]) / (1.0 + number["gain"])


EFFECT = Effect(
    name="pedal_sensor",
    row=70,
    title="Pedal sensor zero and scale off",
    equation="s' = s (1+e) + o",
    injection_points=("sensor.driver",),
    acts_when=Excitation.NONE,
    scope=Scope.CAR,
    parameters=(
        Parameter("offset", "", -0.1, 0.1, 0.01),
        Parameter("gain", "", -0.1, 0.1, 0.01, factor=1),
    ),
    source="M: 1 %",
    signature="demand shifted",
    manoeuvre="straight_stop",
    sense=sense,
    undo=undo,
    nodes=("driver",),
)
