"""A motor gives more or less torque than demanded, or than its current indicates.

``gain`` is of the demand and shows in the current; ``unseen`` is of the constant that makes a torque of a current.
"""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (
    Parameter("gain", "", -0.3, 0.3, -0.05, part_to_part=0.005, factor=1),
    Parameter("unseen", "", -0.3, 0.3, -0.05, part_to_part=0.005, factor=1),
)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """T*' = (1+e) T*, T' = (1+e_u) T."""
    for i in range(4):
        y[J.motor_demand + i] *= 1.0 + q[k + L.gain + i]
        y[J.motor_torque + i] *= 1.0 + q[k + L.unseen + i]


EFFECT = Effect(
    name="iwm_gain",
    row=47,
    title="A motor gives more or less torque than demanded, or than its current indicates",
    equation="T*' = (1+e) T*, T' = (1+e_u) T",
    injection_points=("motor.demand", "motor.torque"),
    acts_when=Excitation.MOTORS,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: +-3 to 5 %",
    signature="motor part only; e is seen in the current, e_u is not",
    manoeuvre="regenerative_pulses",
    confounded_with=("mass_offset", "tyre_radius", "current_torque", "wrong_scale"),
    static=static,
)
