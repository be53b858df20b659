"""Rotating inertia of a wheel off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("inertia_kg_m2", "kg m2", -0.8, 2.0, 0.4, aliases=("wheel_inertia_kg_m2",)),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """I' = I + dI."""
    q[P.wheel_inertia_kg_m2] += q[k + L.inertia_kg_m2]
    q[P.wheel_inertia_kg_m2 + 1] += q[k + L.inertia_kg_m2]


EFFECT = Effect(
    name="rotating_inertia",
    row=3,
    title="Rotating inertia of a wheel off",
    equation="I' = I + dI",
    injection_points=("wheel_inertia_kg_m2",),
    acts_when=Excitation.MOVING,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="D: 4 to 6 % of the mass for four wheels with rotors",
    signature="as mass, but absent in m a - F; wheel speed answers torque steps later",
    manoeuvre="regenerative_pulses",
    confounded_with=("mass_offset", "tyre_relaxation"),
    static=static,
)
