"""Hydraulic brakes: booster, proportioning valve, discs in front, simplex drums at the rear.

Sources: Limpert, Brake Design and Safety (booster, valve, shoe factors); Breuer and Bill, Bremsenhandbuch.
"""

from hil.validation.strangers.compiled import compiled

BOOSTER_GAIN_PA_N = 2.4e4
BOOSTER_FORCE_N = 15.0
RUN_OUT_PA = 9.5e6
"""Above it the vacuum is used up: the foot alone adds pressure, at a fifth of the rate."""


@compiled
def master_pressure_pa(foot_n: float) -> float:
    """Pressure of the master cylinder at rest over the force of the foot on the pedal, N."""
    boosted = BOOSTER_GAIN_PA_N * max(foot_n - BOOSTER_FORCE_N, 0.0)
    return boosted if boosted < RUN_OUT_PA else RUN_OUT_PA + 0.2 * (boosted - RUN_OUT_PA)


@compiled
def behind_valve_pa(pressure_pa: float, knee_pa: float, slope: float) -> float:
    """Pressure behind a proportioning valve: above the knee it rises with the slope."""
    return pressure_pa if pressure_pa < knee_pa else knee_pa + slope * (pressure_pa - knee_pa)


@compiled
def disc_factor(mu: float) -> float:
    """Friction force over clamping force of a disc brake: two pads."""
    return 2.0 * mu


@compiled
def shoe_factor(mu: float, pivot: float, centre: float, arm: float) -> float:
    """Friction force over spreading force of one pivoted shoe; a trailing shoe has a negative arm.

    Parameters
    ----------
    pivot, centre, arm : in drum radii: from the pivot to the spreading force, to the normal force's line, and to the
        friction force's.
    """
    return mu * pivot / (centre - mu * arm)


@compiled
def drum_factor(mu: float) -> float:
    """Internal ratio C* of a simplex drum: a leading and a trailing shoe."""
    return shoe_factor(mu, 1.62, 0.82, 0.95) + shoe_factor(mu, 1.62, 0.82, -0.95)
