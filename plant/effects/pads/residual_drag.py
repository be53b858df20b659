"""Pads drag with the brake released."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (Parameter("torque_nm", "N m", 0.0, 200.0, 6.0),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """T' = T + T_d, against the rotation."""
    for i in range(4):
        y[J.brake_torque + 4 + i] += q[k + L.torque_nm + i]


EFFECT = Effect(
    name="residual_drag",
    row=30,
    title="Pads drag with the brake released",
    equation="T' = T + T_d, against the rotation",
    injection_points=("brake.torque",),
    acts_when=Excitation.ALWAYS,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="S: limits of 6.9 and 9.8 N m (Mitsubishi Fuso service manual); M: 0.5 to 10 N m; C: 200, where it binds",
    signature="wheel slows and disc warms at zero pressure",
    manoeuvre="coast_down",
    confounded_with=("rolling_resistance", "stuck_corner"),
    dissipates=True,
    static=static,
)
