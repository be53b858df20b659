"""Cogging torque."""

from math import sin

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

POLES = 28.0

PARAMETERS = (Parameter("amplitude_nm", "N m", -20.0, 20.0, 5.0),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """T' = T + T_c sin(28 th)."""
    for i in range(4):
        y[J.motor_torque + 4 + i] += q[k + L.amplitude_nm + i] * sin(POLES * x[X.wheel_angle_rad + i])


EFFECT = Effect(
    name="cogging",
    row=51,
    title="Cogging torque",
    equation="T' = T + T_c sin(28 th)",
    injection_points=("motor.torque",),
    acts_when=Excitation.ALWAYS,
    baseline_section="motor",
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: 0.5 to 2 % of the peak, orders 28 to 84",
    signature="wheel order 28, constant amplitude, also without torque",
    manoeuvre="creep",
    confounded_with=("dtv_judder", "wheel_tooth_error"),
    dynamic=dynamic,
)
