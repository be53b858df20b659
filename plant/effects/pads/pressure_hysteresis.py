"""Caliper friction: the clamping pressure lags the pressure."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.effects.shared import clip
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X, Y

FADE_PA = 2e5
FOLLOW_S = 0.002

PARAMETERS = (Parameter("half_width_pa", "Pa", 0.0, 400000.0, 100000.0, difference_step=0.5),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """play of half width h (Prandtl), faded out below 2 bar."""
    for i in range(4):
        pressure, h = y[Y.pressure_pa + i], q[k + L.half_width_pa + i]
        fade = min(pressure / FADE_PA, 1.0)
        y[J.brake_pressure + 4 + i] += fade * clip(x[X.play_pa + i] - pressure, -h, h)


@equation
def rates(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """Rates of the extra states."""
    for i in range(4):
        pressure, h, at = y[Y.pressure_pa + i], q[k + L.half_width_pa + i], x[X.play_pa + i]
        held = clip(at, pressure - h, pressure + h)
        y[Y.rate + X.play_pa + i] = (held - at) / FOLLOW_S
        y[Y.decay_1_s + X.play_pa + i] = 0.0 if held == at else 1.0 / FOLLOW_S


EFFECT = Effect(
    name="pressure_hysteresis",
    row=28,
    title="Caliper friction: the clamping pressure lags the pressure",
    equation="play of half width h (Prandtl), faded out below 2 bar",
    injection_points=("brake.pressure",),
    acts_when=Excitation.BRAKES,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: 3 to 8 % of p, 1 to 3 bar (Shyrokau 2013); S: loop measured at TU Ilmenau (Tretsiak 2008)",
    signature="loop of torque over pressure, release above build, the same at every rate",
    manoeuvre="pressure_triangle",
    confounded_with=("mu_nv_dynamics", "pressure_location"),
    dissipates=True,
    states=("play_pa",),
    dynamic=dynamic,
    rates=rates,
)
