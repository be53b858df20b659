"""Traction battery: what it accepts."""

from plant.compiled import equation


@equation
def charge_limit(state_of_charge: float, power_w: float, taper_start: float, taper_end: float) -> float:
    """Charge power the battery accepts, W: full up to ``taper_start``, none from ``taper_end`` on, linear between."""
    return power_w * min(max((taper_end - state_of_charge) / (taper_end - taper_start), 0.0), 1.0)
