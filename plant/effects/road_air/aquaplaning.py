"""Water film."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

FILM_S2_M3 = 0.33

PARAMETERS = (Parameter("film_m", "m", 0.0, 0.006, 0.002),)
L = slots(Scope.CAR, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """mu' = mu max(1 - k v^2 h, 0.05), k = 0.33 s2/m3."""
    left = max(1.0 - FILM_S2_M3 * x[X.speed_mps] * x[X.speed_mps] * q[k + L.film_m], 0.05)
    for i in range(4):
        y[J.road_friction + i] *= left


EFFECT = Effect(
    name="aquaplaning",
    row=18,
    title="Water film",
    equation="mu' = mu max(1 - k v^2 h, 0.05), k = 0.33 s2/m3",
    injection_points=("road.friction",),
    acts_when=Excitation.MOVING,
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="M: begins at 70 km/h with 3 mm",
    signature="grows with v^2, gone at low speed",
    manoeuvre="hard_stop",
    confounded_with=("mu_road", "headwind"),
    dynamic=dynamic,
)
