"""Judder of an uneven disc."""

from math import cos, sin

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (
    Parameter("first_sine", "", -0.3, 0.3, 0.05),
    Parameter("first_cosine", "", -0.3, 0.3, 0.03),
    Parameter("second_sine", "", -0.3, 0.3, 0.03),
)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """T' = T (1 + a sin th + b cos th + c sin 2 th)."""
    for i in range(4):
        angle = x[X.wheel_angle_rad + i]
        first = q[k + L.first_sine + i] * sin(angle) + q[k + L.first_cosine + i] * cos(angle)
        y[J.brake_torque + i] *= 1.0 + first + q[k + L.second_sine + i] * sin(2.0 * angle)


EFFECT = Effect(
    name="dtv_judder",
    row=37,
    title="Judder of an uneven disc",
    equation="T' = T (1 + a sin th + b cos th + c sin 2 th)",
    injection_points=("brake.torque",),
    acts_when=Excitation.BRAKES,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: thickness off by 10 to 20 um gives 3 to 10 %; S: cold judder has orders 1 and 2",
    signature="torque and speed at wheel orders 1 and 2, proportional to the pressure",
    manoeuvre="straight_stop",
    confounded_with=("wheel_tooth_error", "cogging"),
    dissipates=True,
    dynamic=dynamic,
)
