"""New pads bed in."""

from math import exp

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, shape, slots
from plant.effects.shared import heat_rates
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (
    Parameter("deficit", "", -0.3, 0.4, 0.15),
    shape("energy_j", "J", 100000.0, 20000000.0, 1000000.0),
)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """mu' = mu (1 - d exp(-E/E0))."""
    for i in range(4):
        y[J.friction_mu + i] *= 1.0 - q[k + L.deficit + i // 2] * exp(-x[X.brake_heat_j + i] / q[k + L.energy_j])


@equation
def rates(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """Rates of the extra states."""
    heat_rates(x, y)


EFFECT = Effect(
    name="bedding",
    row=34,
    title="New pads bed in",
    equation="mu' = mu (1 - d exp(-E/E0))",
    injection_points=("friction.mu",),
    acts_when=Excitation.BRAKES,
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="M: -15 to +15 % over 20 to 50 stops",
    signature="monotonic with the work of the brake, never recovers",
    manoeuvre="cold_stops",
    confounded_with=("mu_warmup", "glazing", "pad_mu_gain"),
    dissipates=True,
    states=("brake_heat_j",),
    dynamic=dynamic,
    rates=rates,
)
