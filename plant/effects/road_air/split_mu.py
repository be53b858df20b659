"""Less grip under the right wheels."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (Parameter("right", "", -0.9, 0.2, -0.6, factor=1),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """mu' = mu (1+e) on the right."""
    y[J.road_friction + 1] *= 1.0 + q[k + L.right]
    y[J.road_friction + 3] *= 1.0 + q[k + L.right]


EFFECT = Effect(
    name="split_mu",
    row=12,
    title="Less grip under the right wheels",
    equation="mu' = mu (1+e) on the right",
    injection_points=("road.friction",),
    acts_when=Excitation.MOVING,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 0.2 against 0.9",
    signature="slips left and right split, yaw moment",
    manoeuvre="hard_stop",
    confounded_with=("stuck_corner", "tyre_radius"),
    static=static,
)
