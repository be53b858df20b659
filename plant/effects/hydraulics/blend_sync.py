"""Friction comes late when regeneration goes out."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.effects.shared import brake_gain_nm_pa
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import U, X, Y

PARAMETERS = (Parameter("lag_s", "s", 0.0, 0.5, 0.15),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """p*' = p* - (T - T_lag) / gain, T_lag follows T with tau."""
    on = 1.0 if q[k + L.lag_s] != 0.0 else 0.0
    for i in range(4):
        late = x[X.motor_torque_nm + i] - x[X.handed_nm + i]
        pressed = 1.0 if u[U.pressure_demand_pa + i] > 0.0 else 0.0
        y[J.hydraulics_demand + 4 + i] -= on * pressed * late / brake_gain_nm_pa(i, q)


@equation
def rates(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """Rates of the extra states."""
    lag = max(q[k + L.lag_s], 1e-3)
    for i in range(4):
        y[Y.rate + X.handed_nm + i] = (x[X.motor_torque_nm + i] - x[X.handed_nm + i]) / lag
        y[Y.decay_1_s + X.handed_nm + i] = 1.0 / lag


EFFECT = Effect(
    name="blend_sync",
    row=53,
    title="Friction comes late when regeneration goes out",
    equation="p*' = p* - (T - T_lag) / gain, T_lag follows T with tau",
    injection_points=("hydraulics.demand",),
    acts_when=Excitation.BRAKES,
    baseline_section="ehb",
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: dips of 0.1 to 0.3 m/s2 for 100 to 300 ms",
    signature="at changes of the blending factor only",
    manoeuvre="blending_steps",
    confounded_with=("ehb_dead_time",),
    states=("handed_nm",),
    dynamic=dynamic,
    rates=rates,
)
