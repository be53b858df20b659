"""Tread warms in the contact."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X, Y

CAPACITY_J_K = 1000.0
COOLING_S = 60.0

PARAMETERS = (
    Parameter("stiffness_1_k", "1/K", -0.03, 0.01, -0.01),
    Parameter("grip_1_k", "1/K", -0.01, 0.01, -0.002),
)
L = slots(Scope.CAR, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """C_k' = C_k (1 + a dT), mu' = mu (1 + b dT), dT' = |F v_s| / C - dT / tau."""
    for i in range(4):
        heat = min(x[X.tread_heat_k + i], 60.0)
        y[J.tyre_stiffness + i] *= max(1.0 + q[k + L.stiffness_1_k] * heat, 0.1)
        y[J.road_friction + i] *= max(1.0 + q[k + L.grip_1_k] * heat, 0.1)


@equation
def rates(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """Rates of the extra states."""
    for i in range(4):
        power = abs(y[Y.longitudinal_force_n + i] * y[Y.slip_speed_mps + i])
        y[Y.rate + X.tread_heat_k + i] = power / CAPACITY_J_K - x[X.tread_heat_k + i] / COOLING_S
        y[Y.decay_1_s + X.tread_heat_k + i] = 1.0 / COOLING_S


EFFECT = Effect(
    name="tyre_temperature",
    row=19,
    title="Tread warms in the contact",
    equation="C_k' = C_k (1 + a dT), mu' = mu (1 + b dT), dT' = |F v_s| / C - dT / tau",
    injection_points=("tyre.stiffness", "road.friction"),
    acts_when=Excitation.MOVING,
    baseline_section="tyre",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: -0.5 %/K of the carcass, grip within 5 % over three stops; C: tread of 1 kJ/K, 60 s",
    signature="drifts within and between stops, all wheels",
    manoeuvre="fast_stop",
    confounded_with=("slip_stiffness", "pad_temp_fade"),
    states=("tread_heat_k",),
    dynamic=dynamic,
    rates=rates,
)
