"""Brush tyre, slips along and across together.

Source: Pacejka, Tire and Vehicle Dynamics, section 3.2: parabolic pressure, stiffnesses unlike along and across.
"""

from math import sqrt

from hil.validation.strangers.compiled import compiled


@compiled
def brush_forces_n(
    slip: float, side: float, load_n: float, stiffness: float, cornering: float, friction: float
) -> tuple[float, float]:
    """Forces along and across, N, with the signs of the slips.

    Parameters
    ----------
    slip : of the wheel, negative when braking.  side : minus tangent of the slip angle.
    load_n : on the tyre.  stiffness, cornering : force per slip and load.  friction : largest force per load.
    """
    theoretical = max(1.0 + slip, 0.05)
    along = stiffness * load_n * slip / theoretical
    across = cornering * load_n * side / theoretical
    linear = sqrt(along * along + across * across)
    largest = friction * load_n
    if linear <= 1e-9 or largest <= 0.0:
        return along, across
    sliding = min(linear / (3.0 * largest), 1.0)
    share = largest * (1.0 - (1.0 - sliding) ** 3) / linear
    return along * share, across * share
