"""Hot disc and pads grow into the gap."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (Parameter("growth_pa_k", "Pa/K", 0.0, 2000.0, 500.0),)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """p' = p + g (T - 423 K)+."""
    for i in range(4):
        above = max(x[X.disc_temperature_k + i] - 423.15, 0.0)
        y[J.brake_pressure + 4 + i] += q[k + L.growth_pa_k + i // 2] * above


EFFECT = Effect(
    name="thermal_growth",
    row=39,
    title="Hot disc and pads grow into the gap",
    equation="p' = p + g (T - 423 K)+",
    injection_points=("brake.pressure",),
    acts_when=Excitation.BRAKES,
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="M: 0.1 mm, 1 to 2 bar of drag after a hot stop",
    signature="torque at zero pressure after a hot stop, decays with the cooling",
    manoeuvre="hot_coast",
    confounded_with=("residual_drag", "threshold"),
    dissipates=True,
    dynamic=dynamic,
)
