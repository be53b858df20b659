"""Pad friction follows faster or slower."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("rate", "", -0.7, 3.0, 1.0, aliases=("pad_a_1_ks", "pad_b_1_j"), factor=1),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """both rates of equation (3) times 1+e, the same rest value."""
    q[P.pad_a_1_ks] *= 1.0 + q[k + L.rate]
    q[P.pad_b_1_j] *= 1.0 + q[k + L.rate]


EFFECT = Effect(
    name="mu_nv_dynamics",
    row=24,
    title="Pad friction follows faster or slower",
    equation="both rates of equation (3) times 1+e, the same rest value",
    injection_points=("pad_a_1_ks", "pad_b_1_j"),
    acts_when=Excitation.BRAKES,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="D: time constants of 8 to 30 s in the published fits",
    signature="release branch below the build branch, an area that depends on the frequency",
    manoeuvre="pressure_triangle",
    confounded_with=("pressure_hysteresis",),
    dissipates=True,
    static=static,
)
