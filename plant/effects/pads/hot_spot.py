"""Judder of hot spots."""

from math import sin

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.effects.shared import clip
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

ORDER = 10.0
HOT_K = 523.15

PARAMETERS = (Parameter("amplitude", "", -0.3, 0.3, 0.1),)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """T' = T (1 + a sat((T-523 K)/100 K) sin 10 th)."""
    for i in range(4):
        hot = clip((x[X.disc_temperature_k + i] - HOT_K) / 100.0, 0.0, 1.0)
        y[J.brake_torque + i] *= 1.0 + q[k + L.amplitude + i // 2] * hot * sin(ORDER * x[X.wheel_angle_rad + i])


EFFECT = Effect(
    name="hot_spot",
    row=38,
    title="Judder of hot spots",
    equation="T' = T (1 + a sat((T-523 K)/100 K) sin 10 th)",
    injection_points=("brake.torque",),
    acts_when=Excitation.BRAKES,
    free_phase=True,
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="S: hot judder has orders 6 to 20; M: above 300 degC",
    signature="wheel order 10, grows within a hot stop",
    manoeuvre="hot_stop",
    confounded_with=("dtv_judder",),
    dissipates=True,
    dynamic=dynamic,
)
