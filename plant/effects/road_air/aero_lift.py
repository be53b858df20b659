"""Aerodynamic lift off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("coefficient", "", -0.4, 0.4, 0.15, aliases=("vehicle_lift_coefficient",)),)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """cl' = cl + e of an axle."""
    for axle in range(2):
        q[P.vehicle_lift_coefficient + axle] += q[k + L.coefficient + axle]


EFFECT = Effect(
    name="aero_lift",
    row=6,
    title="Aerodynamic lift off",
    equation="cl' = cl + e of an axle",
    injection_points=("vehicle_lift_coefficient",),
    acts_when=Excitation.MOVING,
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="M: Hucho; 1 to 3 % of the load at 130 km/h",
    signature="slip stiffness changes with v^2",
    manoeuvre="fast_stop",
    confounded_with=("slip_stiffness", "mu_road"),
    static=static,
)
