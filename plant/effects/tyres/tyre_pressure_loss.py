"""Air lost."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (Parameter("share", "", 0.0, 0.7, 0.3),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """at a share s lost: C_k (1+s/4), f_rr (1+s/3), R (1-s/100)."""
    for i in range(4):
        share = q[k + L.share + i]
        y[J.tyre_stiffness + i] *= 1.0 + 0.25 * share
        y[J.wheel_rolling_torque + i] *= 1.0 + share / 3.0
        y[J.wheel_radius + i] *= 1.0 - 0.01 * share


EFFECT = Effect(
    name="tyre_pressure_loss",
    row=14,
    title="Air lost",
    equation="at a share s lost: C_k (1+s/4), f_rr (1+s/3), R (1-s/100)",
    injection_points=("tyre.stiffness", "wheel.rolling_torque", "wheel.radius"),
    acts_when=Excitation.MOVING,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: -30 % gives C_k +5..10 %, f_rr +10 %, R -0.3 %",
    signature="one wheel: speed ratio, drag and slip change together",
    manoeuvre="coast_down",
    confounded_with=("tyre_radius", "rolling_resistance", "residual_drag"),
    static=static,
)
