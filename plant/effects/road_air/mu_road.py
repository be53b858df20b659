"""Grip of the road off: wet, snow, ice."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (Parameter("scale", "", -0.95, 0.3, -0.5, factor=1),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """mu' = mu (1+e)."""
    for i in range(4):
        y[J.road_friction + i] *= 1.0 + q[k + L.scale]


EFFECT = Effect(
    name="mu_road",
    row=17,
    title="Grip of the road off: wet, snow, ice",
    equation="mu' = mu (1+e)",
    injection_points=("road.friction",),
    acts_when=Excitation.MOVING,
    baseline_section="tyre",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 0.8 wet, 0.2 snow, 0.05 ice (Burckhardt)",
    signature="at high slip only; slip jumps while the torque does not",
    manoeuvre="hard_stop",
    confounded_with=("pad_temp_fade", "aquaplaning"),
    static=static,
)
