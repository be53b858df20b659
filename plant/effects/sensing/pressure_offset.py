"""Pressure sensor zero off."""

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """p' = p + o."""
    return values + number["offset_pa"]


def undo(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """Inverse of `sense`."""
    return values - number["offset_pa"]


EFFECT = Effect(
    name="pressure_offset",
    row=61,
    title="Pressure sensor zero off",
    equation="p' = p + o",
    injection_points=("sensor.pressure",),
    acts_when=Excitation.ALWAYS,
    scope=Scope.WHEEL,
    parameters=(Parameter("offset_pa", "Pa", -500000.0, 500000.0, 100000.0, part_to_part=7e3),),
    source="M: +-1 bar",
    signature="intercept of torque over pressure; at zero pressure it reads the offset",
    manoeuvre="coast_down",
    confounded_with=("threshold",),
    sense=sense,
    undo=undo,
    nodes=("pressure",),
)
