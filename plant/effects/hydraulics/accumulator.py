"""Accumulator runs empty."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X, Y

CAPACITY_PA = 8.0 * 4.0 * 30e5
PUMP_S = 20.0

PARAMETERS = (Parameter("droop", "", 0.0, 0.8, 0.3),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """p*' = p* (1 - d s), s' = sum(p'+)/P - s/20 s, P = 8 applications of 4 x 30 bar."""
    left = 1.0 - q[k + L.droop] * min(x[X.drawn], 1.0)
    for i in range(4):
        y[J.hydraulics_demand + i] *= left


@equation
def rates(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """Rates of the extra states."""
    drawn = 0.0
    for i in range(4):
        drawn += max(x[X.pressure_rate_pa_s + i], 0.0)
    y[Y.rate + X.drawn] = drawn / CAPACITY_PA - x[X.drawn] / PUMP_S
    y[Y.decay_1_s + X.drawn] = 1.0 / PUMP_S


EFFECT = Effect(
    name="accumulator",
    row=45,
    title="Accumulator runs empty",
    equation="p*' = p* (1 - d s), s' = sum(p'+)/P - s/20 s, P = 8 applications of 4 x 30 bar",
    injection_points=("hydraulics.demand",),
    acts_when=Excitation.BRAKES,
    baseline_section="ehb",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: -10 to -30 % after eight applications",
    signature="pressure falls with the number of applications, restored by the pump",
    manoeuvre="cold_stops",
    confounded_with=("pad_temp_fade",),
    states=("drawn",),
    dynamic=dynamic,
    rates=rates,
)
