"""Regeneration fades out at another speed."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("speed_mps", "m/s", -1.8, 5.0, 1.5, difference_step=0.6, aliases=("motor_fade_start_mps",)),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """v_1' = v_1 + e."""
    q[P.motor_fade_start_mps] += q[k + L.speed_mps]


EFFECT = Effect(
    name="regen_fadeout",
    row=52,
    title="Regeneration fades out at another speed",
    equation="v_1' = v_1 + e",
    injection_points=("motor_fade_start_mps",),
    acts_when=Excitation.MOTORS,
    baseline_section="motor",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: between 3 and 10 km/h",
    signature="bump in the last second",
    manoeuvre="creep_stop",
    confounded_with=("mu_speed",),
    static=static,
)
