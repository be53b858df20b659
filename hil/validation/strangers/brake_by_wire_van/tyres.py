"""Magic Formula tyre with a marked fall beyond its peak; slips along and across by similarity.

Source: Pacejka, Tire and Vehicle Dynamics, sections 4.2 and 4.3.1: an equivalent slip, and forces in its direction.
"""

from math import atan, sin, sqrt

from hil.validation.strangers.compiled import compiled

SHAPE_ALONG, CURVE_ALONG = 1.72, 0.25
SHAPE_ACROSS, CURVE_ACROSS = 1.42, -0.6
USUAL_LOAD_N = 7800.0
LOAD_LOSS = 0.11
"""Share of grip and of stiffness per load that one usual load more costs."""


@compiled
def magic_formula(slip: float, stiffness: float, peak: float, shape: float, curve: float) -> float:
    """Force over slip; ``stiffness`` is the slope at zero, both in units of the force."""
    scaled = stiffness / (shape * peak) * slip
    return peak * sin(shape * atan(scaled - curve * (scaled - atan(scaled))))


@compiled
def forces_n(
    slip: float, side: float, load_n: float, stiffness: float, cornering: float, friction: float
) -> tuple[float, float]:
    """Steady forces along and across, N, with the signs of the slips.

    Parameters
    ----------
    slip : of the wheel, negative when braking.  side : minus tangent of the slip angle.
    load_n : on the tyre.  stiffness, cornering : force per slip and load.  friction : peak, both at the usual load.
    """
    size = sqrt(slip * slip + side * side)
    less = 1.0 - LOAD_LOSS * (load_n / USUAL_LOAD_N - 1.0)
    if size < 1e-9:
        return stiffness * load_n * less * slip, cornering * load_n * less * side
    peak = friction * load_n * less
    along = magic_formula(size, stiffness * load_n * less, peak, SHAPE_ALONG, CURVE_ALONG)
    across = magic_formula(size, cornering * load_n * less, 0.94 * peak, SHAPE_ACROSS, CURVE_ACROSS)
    return along * slip / size, across * side / size
