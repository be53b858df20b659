"""An effect of your own: a parking brake that was left on.

Any distribution can offer effects. This one would say, in its ``pyproject.toml``::

    [project.entry-points."brakebench.effects"]
    parking_brake = "parking_brake:EFFECT"

From then on ``brakebench effects`` lists it and scenarios switch it on with ``[effects.parking_brake]``. Its equation
is compiled alone when a run first needs it; nothing of brakebench is compiled again.
"""

from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (Parameter("torque_nm", "N m", 0.0, 400.0, 60.0),)
L = slots(Scope.CAR, PARAMETERS)


def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """T' = T + T_p at the rear wheels, a little less once the wheels turn fast: T_p / (1 + omega / 200).

    ``x`` is the state, ``u`` the inputs, ``q[k + ...]`` the effect's own numbers, ``y`` the outputs and injection
    points: the factor of a point of four begins at ``J.name``, its addend (used here) four places later.
    """
    for i in range(2, 4):
        slower = 1.0 + abs(x[X.wheel_speed_rad_s + i]) / 200.0
        y[J.brake_torque + 4 + i] += q[k + L.torque_nm] / slower


EFFECT = Effect(
    name="parking_brake",
    row=0,
    title="The parking brake was left on",
    equation="T' = T + T_p / (1 + omega / 200)",
    injection_points=("brake.torque",),
    scope=Scope.CAR,
    parameters=PARAMETERS,
    source="C: an example",
    signature="drag of the rear wheels from the first metre on",
    manoeuvre="coast_down",
    confounded_with=("residual_drag",),
    dissipates=True,
    dynamic=dynamic,
)
