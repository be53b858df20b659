"""Torque per current falls with the temperature."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.effects.shared import REFERENCE_K
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (Parameter("loss_1_k", "1/K", -0.001, 0.004, 0.001),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """T' = T (1 - k (T_w - 293 K))."""
    for i in range(4):
        y[J.motor_torque + i] *= 1.0 - q[k + L.loss_1_k + i] * (x[X.winding_temperature_k + i] - REFERENCE_K)


EFFECT = Effect(
    name="current_torque",
    row=71,
    title="Torque per current falls with the temperature",
    equation="T' = T (1 - k (T_w - 293 K))",
    injection_points=("motor.torque",),
    acts_when=Excitation.MOTORS,
    baseline_section="motor",
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: magnets lose 0.1 %/K, 8 % at 80 K",
    signature="reported torque is not the true one; deficit of the motor part, grows with heat",
    manoeuvre="hot_motors",
    confounded_with=("iwm_gain",),
    dynamic=dynamic,
)
