"""Softer springs: more dive and a lower pitch frequency."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("softness", "", -0.4, 1.0, 0.25, aliases=("suspension_ride_rate_n_m",), factor=1),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """c' = c / (1+e)."""
    for axle in range(2):
        q[P.suspension_ride_rate_n_m + axle] /= 1.0 + q[k + L.softness]


EFFECT = Effect(
    name="pitch_dive",
    row=8,
    title="Softer springs: more dive and a lower pitch frequency",
    equation="c' = c / (1+e)",
    injection_points=("suspension_ride_rate_n_m",),
    acts_when=Excitation.MOVING,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: Reimpell; 1 to 1.5 deg/g, 1.3 to 1.6 Hz",
    signature="in the IMU's acceleration only, follows it with a lag of second order",
    manoeuvre="straight_stop",
    confounded_with=("imu_gain", "road_grade"),
    static=static,
)
