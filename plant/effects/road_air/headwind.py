"""Headwind, and drag area off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (
    Parameter("wind_mps", "m/s", -20.0, 20.0, 5.0, sign_along_road=True),
    Parameter("drag_gain", "", -0.5, 0.6, 0.15, aliases=("vehicle_drag_coefficient",), factor=1),
)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """F = rho/2 cd (1+e) A (v+w)|v+w|."""
    y[J.air_speed + 1] += q[k + L.wind_mps]
    q[P.vehicle_drag_coefficient] *= 1.0 + q[k + L.drag_gain]


EFFECT = Effect(
    name="headwind",
    row=4,
    title="Headwind, and drag area off",
    equation="F = rho/2 cd (1+e) A (v+w)|v+w|",
    injection_points=("air.speed", "vehicle_drag_coefficient"),
    acts_when=Excitation.ALWAYS,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 5 m/s of wind at 36 m/s is 29 % of the drag; roof loads to 60 %, weather",
    signature="grows with v^2, the wind's part with v; changes sign with the direction; alike at all torques",
    manoeuvre="coast_down",
    confounded_with=("rolling_resistance", "road_grade"),
    static=static,
)
