"""Mass off by passengers and luggage."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("mass_kg", "kg", -300.0, 800.0, 150.0, aliases=("vehicle_mass_kg",)),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """m' = m + dm."""
    q[P.vehicle_mass_kg] += q[k + L.mass_kg]


EFFECT = Effect(
    name="mass_offset",
    row=2,
    title="Mass off by passengers and luggage",
    equation="m' = m + dm",
    injection_points=("vehicle_mass_kg",),
    acts_when=Excitation.MOVING,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 75 to 350 kg, 5 to 25 % of the mass",
    signature="acceleration scales by m/(m+dm) for all torques, drive included; load front and rear",
    manoeuvre="regenerative_pulses",
    confounded_with=("pad_mu_gain", "iwm_gain", "tyre_radius", "rotating_inertia"),
    static=static,
)
