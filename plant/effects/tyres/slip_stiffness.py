"""Slip stiffness off: temperature, tread, wear."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector

PARAMETERS = (Parameter("gain", "", -0.5, 0.6, 0.2, factor=1),)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def static(q: Vector, k: int, y: Vector) -> None:
    """C_k' = C_k (1+e)."""
    for i in range(4):
        y[J.tyre_stiffness + i] *= 1.0 + q[k + L.gain + i // 2]


EFFECT = Effect(
    name="slip_stiffness",
    row=16,
    title="Slip stiffness off: temperature, tread, wear",
    equation="C_k' = C_k (1+e)",
    injection_points=("tyre.stiffness",),
    acts_when=Excitation.MOVING,
    baseline_section="tyre",
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="M: +-25 %; -0.5 %/K of the carcass",
    signature="slip proportional to force, the same at all pressures",
    manoeuvre="straight_stop",
    confounded_with=("tyre_radius", "mu_road", "tyre_temperature"),
    static=static,
)
