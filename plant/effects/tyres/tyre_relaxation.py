"""Relaxation length off."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.layout import Vector
from plant.vectors import P

PARAMETERS = (Parameter("gain", "", -0.7, 2.0, 1.0, aliases=("tyre_lsgkp",), factor=1),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """sigma' = sigma (1+e)."""
    q[P.tyre_lsgkp] *= 1.0 + q[k + L.gain]


EFFECT = Effect(
    name="tyre_relaxation",
    row=15,
    title="Relaxation length off",
    equation="sigma' = sigma (1+e)",
    injection_points=("tyre_lsgkp",),
    acts_when=Excitation.MOVING,
    baseline_section="tyre",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="S: 0.12 m (IPG) against 0.60 m (PAC2002 sample)",
    signature="wheel speed lags by sigma/v, more at low speed; rings below 3 m/s",
    manoeuvre="regenerative_pulses",
    confounded_with=("ehb_dead_time", "motor_tau", "sus_compliance"),
    static=static,
)
