"""Battery accepts more or less."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("power", "", -0.95, 1.0, -0.4, aliases=("battery_charge_power_w",), factor=1),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """P' = P (1+e)."""
    q[P.battery_charge_power_w] *= 1.0 + q[k + L.power]


EFFECT = Effect(
    name="battery_soc",
    row=50,
    title="Battery accepts more or less",
    equation="P' = P (1+e)",
    injection_points=("battery_charge_power_w",),
    acts_when=Excitation.MOTORS,
    baseline_section="battery",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 60 to 100 kW; none above 90 to 95 % charge, less in the cold",
    signature="sum over the wheels clipped, hyperbola over the speed",
    manoeuvre="full_regeneration",
    confounded_with=("iwm_field", "iwm_derating"),
    static=static,
)
