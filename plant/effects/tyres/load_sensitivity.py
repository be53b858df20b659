"""Grip falls faster or slower with the load."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("per_load", "", -0.4, 0.4, -0.15, aliases=("tyre_pdx2",)),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """p_Dx2' = p_Dx2 + e."""
    q[P.tyre_pdx2] += q[k + L.per_load]


EFFECT = Effect(
    name="load_sensitivity",
    row=20,
    title="Grip falls faster or slower with the load",
    equation="p_Dx2' = p_Dx2 + e",
    injection_points=("tyre_pdx2",),
    acts_when=Excitation.MOVING,
    baseline_section="tyre",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="S: -0.16 in the PAC2002 sample",
    signature="the front saturates earlier",
    manoeuvre="hard_stop",
    confounded_with=("cog_height", "mu_road"),
    static=static,
)
