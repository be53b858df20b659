"""Rolling radius off: wear, inflation."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (Parameter("gain", "", -0.05, 0.05, -0.01, part_to_part=0.0012, factor=1),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """R' = R (1+e)."""
    for i in range(4):
        y[J.wheel_radius + i] *= 1.0 + q[k + L.gain + i]


EFFECT = Effect(
    name="tyre_radius",
    row=13,
    title="Rolling radius off: wear, inflation",
    equation="R' = R (1+e)",
    injection_points=("wheel.radius",),
    acts_when=Excitation.MOVING,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="S: wheel to wheel 0.12 % (comma2k19); M: wear -1.5 %",
    signature="constant ratio of wheel speeds at zero torque; force per torque",
    manoeuvre="coast_down",
    confounded_with=("wheel_tooth_error", "wrong_scale"),
    static=static,
)
