"""Power of the motors off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("power", "", -0.95, 0.5, -0.8, aliases=("motor_peak_power_w",), factor=1),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """P' = P (1+e)."""
    q[P.motor_peak_power_w] *= 1.0 + q[k + L.power]


EFFECT = Effect(
    name="iwm_field",
    row=49,
    title="Power of the motors off",
    equation="P' = P (1+e)",
    injection_points=("motor_peak_power_w",),
    acts_when=Excitation.MOTORS,
    baseline_section="motor",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source=(
        "M: field weakening begins at another speed with voltage and temperature; C: large, because the "
        "battery binds first"
    ),
    signature="torque is a hyperbola over the speed",
    manoeuvre="full_regeneration",
    confounded_with=("iwm_derating", "battery_soc"),
    static=static,
)
