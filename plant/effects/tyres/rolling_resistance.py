"""Rolling resistance off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (Parameter("gain", "", -0.95, 1.5, 0.3, factor=1),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """M' = M (1+e)."""
    for i in range(4):
        y[J.wheel_rolling_torque + i] *= 1.0 + q[k + L.gain + i]


EFFECT = Effect(
    name="rolling_resistance",
    row=5,
    title="Rolling resistance off",
    equation="M' = M (1+e)",
    injection_points=("wheel.rolling_torque",),
    acts_when=Excitation.MOVING,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="S: 0.0164 (IPG) against 0.009 of eco tyres; warms up in 15 to 30 min",
    signature="constant deceleration, no function of the pressure",
    manoeuvre="coast_down",
    confounded_with=("residual_drag", "imu_bias", "road_grade", "headwind"),
    dissipates=True,
    static=static,
)
