"""Motors answer later."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("time_s", "s", -0.005, 0.06, 0.01, aliases=("motor_time_constant_s",)),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """tau' = tau + e."""
    q[P.motor_time_constant_s] += q[k + L.time_s]


EFFECT = Effect(
    name="motor_tau",
    row=54,
    title="Motors answer later",
    equation="tau' = tau + e",
    injection_points=("motor_time_constant_s",),
    acts_when=Excitation.MOTORS,
    baseline_section="motor",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: 8 ms of the torque loop and 10 ms of CAN",
    signature="constant lag of the motor torque",
    manoeuvre="regenerative_pulses",
    confounded_with=("tyre_relaxation", "timestamp_offset"),
    static=static,
)
