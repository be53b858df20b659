"""Pressure is measured before the line."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X, Y

PARAMETERS = (Parameter("lag_s", "s", 0.0, 0.06, 0.012),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """p_caliper' = (p - p_caliper) / tau."""
    on = 1.0 if q[k + L.lag_s] != 0.0 else 0.0
    for i in range(4):
        y[J.brake_pressure + 4 + i] += on * (x[X.caliper_pa + i] - y[Y.pressure_pa + i])


@equation
def rates(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """Rates of the extra states."""
    lag = max(q[k + L.lag_s], 1e-3)
    for i in range(4):
        y[Y.rate + X.caliper_pa + i] = (y[Y.pressure_pa + i] - x[X.caliper_pa + i]) / lag
        y[Y.decay_1_s + X.caliper_pa + i] = 1.0 / lag


EFFECT = Effect(
    name="pressure_location",
    row=63,
    title="Pressure is measured before the line",
    equation="p_caliper' = (p - p_caliper) / tau",
    injection_points=("brake.pressure",),
    acts_when=Excitation.BRAKES,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 5 to 20 ms, some bar in transients",
    signature="loop of torque over pressure that grows with the rate",
    manoeuvre="pressure_steps",
    confounded_with=("pressure_hysteresis", "timestamp_offset"),
    dissipates=True,
    states=("caliper_pa",),
    dynamic=dynamic,
    rates=rates,
)
