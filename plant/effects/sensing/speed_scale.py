"""Speed over ground measured too fast or too slow."""

from plant.effects.effect import GROUND, Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """v' = v (1+e)."""
    return values * (1.0 + number["gain"])


def undo(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """Inverse of `sense`."""
    return values / (1.0 + number["gain"])


EFFECT = Effect(
    name="speed_scale",
    row=76,
    title="Speed over ground measured too fast or too slow",
    equation="v' = v (1+e)",
    injection_points=("sensor.ground",),
    acts_when=Excitation.ALWAYS,
    scope=Scope.CAR,
    parameters=(Parameter("gain", "", -0.1, 0.1, 0.01, factor=1),),
    source="C: an optical sensor mounted askew by 8 degrees tells 1 % too little; a satellite receiver is far better",
    signature="constant ratio to all wheel speeds, and no force changes",
    manoeuvre="coast_down",
    confounded_with=("tyre_radius", "wrong_scale"),
    sense=sense,
    undo=undo,
    nodes=(GROUND,),
)
