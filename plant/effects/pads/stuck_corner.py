"""A caliper that gives too little, or does not let go."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import Y

PARAMETERS = (
    Parameter("loss", "", 0.0, 1.0, 0.4, factor=-1),
    Parameter("held_pa", "Pa", 0.0, 4000000.0, 400000.0, difference_step=0.5),
)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """T' = (1-e) T; clamping pressure at least p_s."""
    for i in range(4):
        y[J.brake_torque + i] *= 1.0 - q[k + L.loss + i]
        y[J.brake_pressure + 4 + i] += max(q[k + L.held_pa + i] - y[Y.pressure_pa + i], 0.0)


EFFECT = Effect(
    name="stuck_corner",
    row=31,
    title="A caliper that gives too little, or does not let go",
    equation="T' = (1-e) T; clamping pressure at least p_s",
    injection_points=("brake.torque", "brake.pressure"),
    acts_when=Excitation.ALWAYS,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: one wheel at 20 to 50 % less; a seized piston holds some bar",
    signature="one wheel's torque, yaw rate, slips left and right",
    manoeuvre="cold_stops",
    confounded_with=("split_mu", "pad_mu_gain", "residual_drag"),
    dissipates=True,
    dynamic=dynamic,
)
