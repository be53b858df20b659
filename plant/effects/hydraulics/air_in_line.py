"""Air in the brake line."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

COMPLIANCE_M3_PA = 5e-13
AMBIENT_PA = 1e5

PARAMETERS = (Parameter("volume_m3", "m3", 0.0, 6e-06, 2e-06),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """p' = c/(c + V p0/(p+p0)^2) times the rate, c = 0.5 cm3/MPa."""
    for i in range(4):
        absolute = max(x[X.pressure_pa + i], 0.0) + AMBIENT_PA
        air = q[k + L.volume_m3 + i] * AMBIENT_PA / (absolute * absolute)
        y[J.hydraulics_rate + i] *= COMPLIANCE_M3_PA / (COMPLIANCE_M3_PA + air)


EFFECT = Effect(
    name="air_in_line",
    row=32,
    title="Air in the brake line",
    equation="p' = c/(c + V p0/(p+p0)^2) times the rate, c = 0.5 cm3/MPa",
    injection_points=("hydraulics.rate",),
    acts_when=Excitation.BRAKES,
    baseline_section="ehb",
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: 1 to 3 cm3",
    signature="slow first rise of the pressure, as usual above 20 bar",
    manoeuvre="pressure_steps",
    confounded_with=("ehb_rate_limit", "ehb_bandwidth"),
    dynamic=dynamic,
)
