"""Threshold pressure off, and a gap to close after knock-back."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.effects.shared import clip
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X, Y

PARAMETERS = (
    Parameter("pressure_pa", "Pa", -50000.0, 400000.0, 80000.0),
    Parameter("gap_pa_s", "Pa s", 0.0, 300000.0, 100000.0),
)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """p' = p - p0; no torque until the pressure has acted long enough on the gap."""
    for i in range(4):
        y[J.brake_pressure + 4 + i] -= q[k + L.pressure_pa + i]
        gap, taken = q[k + L.gap_pa_s + i], x[X.taken_up_pa_s + i]
        y[J.brake_torque + i] *= clip((taken - 0.8 * gap) / max(0.2 * gap, 1.0), 0.0, 1.0) if gap > 0.0 else 1.0


@equation
def rates(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """Rates of the extra states."""
    for i in range(4):
        y[Y.rate + X.taken_up_pa_s + i] = y[Y.pressure_pa + i]


EFFECT = Effect(
    name="threshold",
    row=29,
    title="Threshold pressure off, and a gap to close after knock-back",
    equation="p' = p - p0; no torque until the pressure has acted long enough on the gap",
    injection_points=("brake.pressure", "brake.torque"),
    acts_when=Excitation.BRAKES,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: 0.3 to 1 bar (Breuer/Bill); knock-back of 0.2 to 0.5 mm costs 50 to 150 ms",
    signature="offset of torque over pressure; torque late at the first application",
    manoeuvre="cold_stops",
    confounded_with=("pressure_offset", "ehb_dead_time"),
    dissipates=True,
    states=("taken_up_pa_s",),
    dynamic=dynamic,
    rates=rates,
)
