"""Wet or rusty discs at the first application."""

from math import exp

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, shape, slots
from plant.effects.shared import applied_rates
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (
    Parameter("wet", "", -0.5, 0.7, 0.3),
    shape("dry_s", "s", 0.2, 5.0, 1.0),
)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """mu' = mu (1 - w exp(-t/tau)), t the time braked so far."""
    for i in range(4):
        y[J.friction_mu + i] *= 1.0 - q[k + L.wet + i // 2] * exp(-x[X.braked_s + i] / q[k + L.dry_s])


@equation
def rates(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """Rates of the extra states."""
    applied_rates(x, y)


EFFECT = Effect(
    name="water",
    row=36,
    title="Wet or rusty discs at the first application",
    equation="mu' = mu (1 - w exp(-t/tau)), t the time braked so far",
    injection_points=("friction.mu",),
    acts_when=Excitation.BRAKES,
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="M: 10 to 50 % less for 0.5 to 2 s; rust grips up to 30 % more",
    signature="first stop after rain or rest only",
    manoeuvre="cold_stops",
    confounded_with=("bedding", "threshold"),
    dissipates=True,
    states=("applied_s", "braked_s"),
    dynamic=dynamic,
    rates=rates,
)
