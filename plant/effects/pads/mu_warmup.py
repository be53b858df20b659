"""Cold pads grip less."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.effects.shared import clip
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

WARM_K = 423.15
RANGE_K = 100.0

PARAMETERS = (Parameter("cold_loss", "", -0.3, 0.5, 0.15),)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """mu' = mu (1 - c sat((423 K - T)/100 K))."""
    for i in range(4):
        cold = clip((WARM_K - x[X.disc_temperature_k + i]) / RANGE_K, 0.0, 1.0)
        y[J.friction_mu + i] *= 1.0 - q[k + L.cold_loss + i // 2] * cold


EFFECT = Effect(
    name="mu_warmup",
    row=25,
    title="Cold pads grip less",
    equation="mu' = mu (1 - c sat((423 K - T)/100 K))",
    injection_points=("friction.mu",),
    acts_when=Excitation.BRAKES,
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="M: 10 to 25 % gained over the first three stops",
    signature="rises with the temperature in the first stops",
    manoeuvre="cold_stops",
    confounded_with=("bedding", "water"),
    dissipates=True,
    dynamic=dynamic,
)
