"""Uneven road under the tyres."""

from math import pi, sin, sqrt

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import P, X

TYRE_N_M = 200e3  # vertical stiffness; S: IPG, 195/65 R15
WAVES = 6

PARAMETERS = (Parameter("height_m", "m", 0.0, 0.004, 0.0012),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """dFz = c z(s), dR = -z(s)/3, six waves of 0.9 to 7 m, left and right apart."""
    for i in range(4):
        wheel_x = q[P.vehicle_cog_to_axle_m] if i < 2 else -q[P.vehicle_cog_to_axle_m + 1]
        place = x[X.distance_m] + wheel_x
        z, wave = 0.0, 7.0
        for n in range(WAVES):
            z += sqrt(wave) * sin(2.0 * pi * place / wave + 2.3 * n + 1.7 * (i % 2) * (n + 1))
            wave /= 1.5
        z *= 0.35 * q[k + L.height_m]
        y[J.wheel_load + 4 + i] += TYRE_N_M * z
        y[J.wheel_radius + 4 + i] -= z / 3.0


EFFECT = Effect(
    name="road_roughness",
    row=11,
    title="Uneven road under the tyres",
    equation="dFz = c z(s), dR = -z(s)/3, six waves of 0.9 to 7 m, left and right apart",
    injection_points=("wheel.load", "wheel.radius"),
    acts_when=Excitation.ALWAYS,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: ISO 8608 class B to C, rms height of the short waves",
    signature="broad band 1 to 15 Hz in all wheels; the front leads the rear by L/v",
    manoeuvre="coast_down",
    confounded_with=("wheel_tooth_error",),
    dynamic=dynamic,
)
