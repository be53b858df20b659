"""Damping of the contact at walking pace off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("damping", "", -0.95, 1.0, -0.6, aliases=("tyre_low_speed_damping_ns_m",), factor=1),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """k' = k (1+e)."""
    q[P.tyre_low_speed_damping_ns_m] *= 1.0 + q[k + L.damping]


EFFECT = Effect(
    name="low_speed",
    row=21,
    title="Damping of the contact at walking pace off",
    equation="k' = k (1+e)",
    injection_points=("tyre_low_speed_damping_ns_m",),
    acts_when=Excitation.MOVING,
    baseline_section="tyre",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: Pacejka 2006, section 8.6",
    signature="oscillation of 5 to 20 Hz when the car stops",
    manoeuvre="abrupt_stop",
    confounded_with=("cogging",),
    static=static,
)
