"""Friction over the sliding speed (Stribeck)."""

from math import exp

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import P, X

STRIBECK_MPS = 1.5

PARAMETERS = (
    Parameter("slope_s_m", "s/m", -0.01, 0.01, -0.004),
    Parameter("stribeck", "", 0.0, 0.5, 0.15),
)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """mu' = mu (1 + s exp(-(v/v_s)^2)) (1 + k v), v_s = 1.5 m/s."""
    for i in range(4):
        speed = abs(x[X.wheel_speed_rad_s + i]) * q[P.wheel_rolling_radius_m]
        ratio = speed / STRIBECK_MPS
        rise = 1.0 + q[k + L.stribeck + i // 2] * exp(-ratio * ratio)
        y[J.friction_mu + i] *= rise * max(1.0 + q[k + L.slope_s_m + i // 2] * speed, 0.1)


EFFECT = Effect(
    name="mu_speed",
    row=26,
    title="Friction over the sliding speed (Stribeck)",
    equation="mu' = mu (1 + s exp(-(v/v_s)^2)) (1 + k v), v_s = 1.5 m/s",
    injection_points=("friction.mu",),
    acts_when=Excitation.BRAKES,
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="M: -10 to -25 % from 5 to 120 km/h, +20 % in the last half second",
    signature="function of the speed alone, alike in repeated stops",
    manoeuvre="fast_stop",
    confounded_with=("pad_temp_fade", "headwind", "regen_fadeout"),
    dissipates=True,
    dynamic=dynamic,
)
