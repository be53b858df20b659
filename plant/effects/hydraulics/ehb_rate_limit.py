"""Rate limits of the pressure control off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (
    Parameter("gain", "", -0.9, 1.0, -0.4, aliases=("ehb_build_rate_pa_s", "ehb_release_rate_pa_s"), factor=1),
)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """r' = r (1+e)."""
    q[P.ehb_build_rate_pa_s] *= 1.0 + q[k + L.gain]
    q[P.ehb_release_rate_pa_s] *= 1.0 + q[k + L.gain]


EFFECT = Effect(
    name="ehb_rate_limit",
    row=43,
    title="Rate limits of the pressure control off",
    equation="r' = r (1+e)",
    injection_points=("ehb_build_rate_pa_s", "ehb_release_rate_pa_s"),
    acts_when=Excitation.BRAKES,
    baseline_section="ehb",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 180 to 400 bar/s",
    signature="large steps only: straight flanks",
    manoeuvre="pressure_steps",
    confounded_with=("ehb_bandwidth", "air_in_line"),
    static=static,
)
