"""Friction falls above a temperature."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, shape, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (
    Parameter("fade_1_k", "1/K", 0.0, 0.004, 0.0015),
    shape("start_k", "K", 400.0, 800.0, 573.15),
)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """mu' = mu max(1 - k (T - T_f)+, 0.2)."""
    for i in range(4):
        above = max(x[X.disc_temperature_k + i] - q[k + L.start_k], 0.0)
        y[J.friction_mu + i] *= max(1.0 - q[k + L.fade_1_k + i // 2] * above, 0.2)


EFFECT = Effect(
    name="pad_temp_fade",
    row=23,
    title="Friction falls above a temperature",
    equation="mu' = mu max(1 - k (T - T_f)+, 0.2)",
    injection_points=("friction.mu",),
    acts_when=Excitation.BRAKES,
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="M: -20 to -40 % from 350 to 600 degC (Breuer/Bill)",
    signature="falls within a hot stop, recovers between stops; goes with energy, not with speed",
    manoeuvre="hot_stop",
    confounded_with=("mu_speed", "accumulator", "mass_offset"),
    dissipates=True,
    dynamic=dynamic,
)
