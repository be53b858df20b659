"""Bandwidth and damping of the pressure control off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (
    Parameter("frequency", "", -0.7, 1.5, -0.3, aliases=("ehb_natural_frequency_hz",), factor=1),
    Parameter("damping", "", -0.6, 1.0, -0.25, aliases=("ehb_damping_ratio",), factor=1),
)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """f' = f (1+e), zeta' = zeta (1+d)."""
    q[P.ehb_natural_frequency_hz] *= 1.0 + q[k + L.frequency]
    q[P.ehb_damping_ratio] *= 1.0 + q[k + L.damping]


EFFECT = Effect(
    name="ehb_bandwidth",
    row=42,
    title="Bandwidth and damping of the pressure control off",
    equation="f' = f (1+e), zeta' = zeta (1+d)",
    injection_points=("ehb_natural_frequency_hz", "ehb_damping_ratio"),
    acts_when=Excitation.BRAKES,
    baseline_section="ehb",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 4 to 10 Hz, 0.7 to 1",
    signature="overshoot and lag over the frequency",
    manoeuvre="pressure_steps",
    confounded_with=("air_in_line", "fluid_temp"),
    static=static,
)
