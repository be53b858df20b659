"""Dead time of the pressure control off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("time_s", "s", -0.02, 0.08, 0.02, aliases=("ehb_dead_time_s",)),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """t_d' = t_d + e."""
    q[P.ehb_dead_time_s] = max(q[P.ehb_dead_time_s] + q[k + L.time_s], 0.0)


EFFECT = Effect(
    name="ehb_dead_time",
    row=41,
    title="Dead time of the pressure control off",
    equation="t_d' = t_d + e",
    injection_points=("ehb_dead_time_s",),
    acts_when=Excitation.BRAKES,
    baseline_section="ehb",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 10 to 40 ms",
    signature="pure shift between demand and pressure, whatever the step",
    manoeuvre="pressure_steps",
    confounded_with=("timestamp_offset", "ehb_rate_limit", "tyre_relaxation"),
    static=static,
)
