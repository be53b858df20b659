"""Friction drifts with wear, glazing, taper."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.effects.shared import heat_rates
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (Parameter("drift_1_mj", "1/MJ", -0.3, 1.0, 0.2),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """mu' = mu (1 - d E), at least 0.3 mu."""
    for i in range(4):
        y[J.friction_mu + i] *= max(1.0 - q[k + L.drift_1_mj + i] * 1e-6 * x[X.brake_heat_j + i], 0.3)


@equation
def rates(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """Rates of the extra states."""
    heat_rates(x, y)


EFFECT = Effect(
    name="glazing",
    row=35,
    title="Friction drifts with wear, glazing, taper",
    equation="mu' = mu (1 - d E), at least 0.3 mu",
    injection_points=("friction.mu",),
    acts_when=Excitation.BRAKES,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: 5 to 10 % over weeks; here over the work of the brake in one log",
    signature="slow, of one wheel",
    manoeuvre="cold_stops",
    confounded_with=("bedding", "pad_temp_fade"),
    dissipates=True,
    states=("brake_heat_j",),
    dynamic=dynamic,
    rates=rates,
)
