"""Road grade."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (Parameter("grade", "", -0.2, 0.2, 0.02, sign_along_road=True),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """grade' = grade + e."""
    y[J.road_grade + 1] += q[k + L.grade]


EFFECT = Effect(
    name="road_grade",
    row=1,
    title="Road grade",
    equation="grade' = grade + e",
    injection_points=("road.grade",),
    acts_when=Excitation.ALWAYS,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: roads have up to 8 %, usually within 2 %",
    signature="wheel deceleration changes, the IMU's specific force does not",
    manoeuvre="coast_down",
    confounded_with=("imu_bias", "mass_offset", "rolling_resistance", "headwind"),
    static=static,
)
