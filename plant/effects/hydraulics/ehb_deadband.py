"""Pressure control does not answer small errors."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.effects.shared import clip
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import U, X

PARAMETERS = (Parameter("band_pa", "Pa", 0.0, 400000.0, 80000.0),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """p* = p + dead zone of (p* - p)."""
    band = q[k + L.band_pa]
    for i in range(4):
        y[J.hydraulics_demand + 4 + i] -= clip(u[U.pressure_demand_pa + i] - x[X.pressure_pa + i], -band, band)


EFFECT = Effect(
    name="ehb_deadband",
    row=44,
    title="Pressure control does not answer small errors",
    equation="p* = p + dead zone of (p* - p)",
    injection_points=("hydraulics.demand",),
    acts_when=Excitation.ALWAYS,
    baseline_section="ehb",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 0.3 to 1 bar",
    signature="staircases in slow ramps, rests short of the demand",
    manoeuvre="pressure_triangle",
    confounded_with=("quantisation",),
    dynamic=dynamic,
)
