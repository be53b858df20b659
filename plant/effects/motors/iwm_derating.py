"""Motor derates early."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, shape, slots
from plant.effects.shared import clip
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (
    Parameter("loss", "", 0.0, 1.0, 0.4),
    shape("start_k", "K", 310.0, 400.0, 350.0),
)
L = slots(Scope.CAR, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """able' = able (1 - d sat((T_w - T_s)/40 K))."""
    for i in range(4):
        hot = clip((x[X.winding_temperature_k + i] - q[k + L.start_k]) / 40.0, 0.0, 1.0)
        y[J.motor_available + i] *= 1.0 - q[k + L.loss] * hot


EFFECT = Effect(
    name="iwm_derating",
    row=48,
    title="Motor derates early",
    equation="able' = able (1 - d sat((T_w - T_s)/40 K))",
    injection_points=("motor.available",),
    acts_when=Excitation.MOTORS,
    baseline_section="motor",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: -20 to -50 %, time constant 60 s",
    signature="plateau after much energy",
    manoeuvre="hot_motors",
    confounded_with=("battery_soc", "iwm_field"),
    dynamic=dynamic,
)
