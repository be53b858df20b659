"""Caliper grips unlike forward and backward."""

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, slots
from plant.effects.shared import clip
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X

PARAMETERS = (Parameter("gain", "", -0.3, 0.3, 0.06),)
L = slots(Scope.WHEEL, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """mu' = mu (1 + e sign(omega))."""
    for i in range(4):
        turning = clip(x[X.wheel_speed_rad_s + i], -1.0, 1.0)
        y[J.friction_mu + i] *= 1.0 + q[k + L.gain + i] * turning


EFFECT = Effect(
    name="caliper_asymmetry",
    row=40,
    title="Caliper grips unlike forward and backward",
    equation="mu' = mu (1 + e sign(omega))",
    injection_points=("friction.mu",),
    acts_when=Excitation.BRAKES,
    scope=Scope.WHEEL,
    parameters=PARAMETERS,
    source="M: +-2 %, of the leading end of the pad",
    signature="gain differs forward and backward, one wheel",
    manoeuvre="reverse_stop",
    confounded_with=("pad_mu_gain",),
    twins=("pad_mu_gain",),
    dissipates=True,
    dynamic=dynamic,
)
