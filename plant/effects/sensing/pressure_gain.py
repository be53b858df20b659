"""Pressure sensor scale off, drifting."""

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """p' = p (1 + e + d t)."""
    return values * (1.0 + number["gain"] + number["drift_1_s"] * time_s[:, None])


def undo(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """Inverse of `sense`."""
    return values / (1.0 + number["gain"] + number["drift_1_s"] * time_s[:, None])


EFFECT = Effect(
    name="pressure_gain",
    row=62,
    title="Pressure sensor scale off, drifting",
    equation="p' = p (1 + e + d t)",
    injection_points=("sensor.pressure",),
    acts_when=Excitation.BRAKES,
    scope=Scope.WHEEL,
    parameters=(
        Parameter("gain", "", -0.2, 0.2, 0.02, part_to_part=0.005, factor=1),
        Parameter("drift_1_s", "1/s", -0.001, 0.001, 0.0002),
    ),
    source="M: +-1 to 2 %",
    signature="as a pad gain of one wheel, but the wheel does not feel it",
    manoeuvre="pressure_triangle",
    confounded_with=("pad_mu_gain",),
    sense=sense,
    undo=undo,
    nodes=("pressure",),
)
