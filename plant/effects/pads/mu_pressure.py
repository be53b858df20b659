"""Friction over the pressure."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import Y

REFERENCE_PA = 30e5
LEAST_PA = 1e5

PARAMETERS = (Parameter("exponent", "", -0.2, 0.3, 0.08),)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """mu' = mu (p / 30 bar)^-n, p at least 1 bar."""
    for i in range(4):
        pressure = max(y[Y.pressure_pa + i], LEAST_PA) / REFERENCE_PA
        y[J.friction_mu + i] *= pressure ** -q[k + L.exponent + i // 2]


EFFECT = Effect(
    name="mu_pressure",
    row=27,
    title="Friction over the pressure",
    equation="mu' = mu (p / 30 bar)^-n, p at least 1 bar",
    injection_points=("friction.mu",),
    acts_when=Excitation.BRAKES,
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="M: n of 0.05 to 0.1",
    signature="torque over pressure falls with the pressure",
    manoeuvre="pressure_steps",
    confounded_with=("pressure_hysteresis", "threshold"),
    dissipates=True,
    dynamic=dynamic,
)
