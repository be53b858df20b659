"""A valve leaks."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (Parameter("leak_1_s", "1/s", 0.0, 8.0, 1.5),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """p' = rate - k p."""
    for i in range(4):
        y[J.hydraulics_rate + 4 + i] -= q[k + L.leak_1_s + i] * x[X.pressure_pa + i]


EFFECT = Effect(
    name="valve_leak",
    row=46,
    title="A valve leaks",
    equation="p' = rate - k p",
    injection_points=("hydraulics.rate",),
    acts_when=Excitation.BRAKES,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source=("M: 1 to 5 bar/min at a closed valve; C: larger here, because the closed pressure loop makes good for it"),
    signature="pressure rests below the demand, one wheel",
    manoeuvre="pressure_steps",
    confounded_with=("pressure_gain", "ehb_deadband"),
    dynamic=dynamic,
)
