"""Cold, viscous brake fluid."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

SLOWED = ("ehb_natural_frequency_hz", "ehb_build_rate_pa_s", "ehb_release_rate_pa_s")

PARAMETERS = (Parameter("slowness", "", 0.0, 3.0, 0.6, aliases=SLOWED, factor=1),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """f' = f/(1+e), rates' = rates/(1+e)^2."""
    slow = 1.0 + q[k + L.slowness]
    q[P.ehb_natural_frequency_hz] /= slow
    q[P.ehb_build_rate_pa_s] /= slow * slow
    q[P.ehb_release_rate_pa_s] /= slow * slow


EFFECT = Effect(
    name="fluid_temp",
    row=33,
    title="Cold, viscous brake fluid",
    equation="f' = f/(1+e), rates' = rates/(1+e)^2",
    injection_points=SLOWED,
    acts_when=Excitation.BRAKES,
    baseline_section="ehb",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: two to four times slower at -20 degC",
    signature="pressure lags at all wheels",
    manoeuvre="pressure_steps",
    confounded_with=("ehb_bandwidth", "ehb_rate_limit"),
    static=static,
)
