"""Height of the centre of gravity off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("height_m", "m", -0.25, 0.4, 0.06, aliases=("vehicle_cog_height_m",)),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """h' = h + dh."""
    q[P.vehicle_cog_height_m] += q[k + L.height_m]


EFFECT = Effect(
    name="cog_height",
    row=7,
    title="Height of the centre of gravity off",
    equation="h' = h + dh",
    injection_points=("vehicle_cog_height_m",),
    acts_when=Excitation.MOVING,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="S: 5 to 10 % of the load transfer; roof loads more",
    signature="ratio of front to rear slip over the deceleration",
    manoeuvre="fast_stop",
    confounded_with=("load_sensitivity", "slip_stiffness"),
    static=static,
)
