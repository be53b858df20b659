"""A motor gives more or less than it is told."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.effects.joints import J
from plant.layout import Vector

PARAMETERS = (Parameter("gain", "", -0.3, 0.3, -0.05),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """T*' = (1+e) T*."""
    for i in range(4):
        y[J.motor_demand + i] *= 1.0 + q[k + L.gain + i]


EFFECT = Effect(
    name="iwm_gain",
    row=47,
    title="A motor gives more or less than it is told",
    equation="T*' = (1+e) T*",
    joints=("motor.demand",),
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: +-3 to 5 %",
    signature="motor part only; seen in the current",
    manoeuvre="regenerative_pulses",
    confounded_with=("mass_offset", "tyre_radius"),
    static=static,
)
