"""Pad friction off by a constant share."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (Parameter("gain", "", -0.6, 0.6, -0.12, part_to_part=0.01, factor=1),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """mu' = mu (1+e)."""
    for i in range(4):
        y[J.friction_mu + i] *= 1.0 + q[k + L.gain + i]


EFFECT = Effect(
    name="pad_mu_gain",
    row=22,
    title="Pad friction off by a constant share",
    equation="mu' = mu (1+e)",
    injection_points=("friction.mu",),
    acts_when=Excitation.BRAKES,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: batches differ by 15 % (Breuer/Bill, Bremsenhandbuch)",
    signature="torque over pressure off, constant in v, T and t",
    manoeuvre="straight_stop",
    confounded_with=("mass_offset", "pressure_gain", "bedding", "glazing"),
    twins=("caliper_asymmetry",),
    dissipates=True,
    static=static,
)
