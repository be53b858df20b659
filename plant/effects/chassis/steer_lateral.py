"""Front wheels do not point where the steering wheel says."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (Parameter("offset_rad", "rad", -0.05, 0.05, 0.005),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """delta' = delta + e."""
    y[J.steering_angle + 1] += q[k + L.offset_rad]


EFFECT = Effect(
    name="steer_lateral",
    row=10,
    title="Front wheels do not point where the steering wheel says",
    equation="delta' = delta + e",
    injection_points=("steering.angle",),
    acts_when=Excitation.MOVING,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: alignment and steering compliance, 0.1 to 1 deg at the wheel",
    signature="goes with steering, lateral acceleration and yaw; left and right wheel speeds split",
    manoeuvre="straight_stop",
    confounded_with=("tyre_radius", "stuck_corner", "split_mu"),
    static=static,
)
