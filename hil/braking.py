"""The figure of a brake test: mean fully developed deceleration."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
UPPER, LOWER = 0.8, 0.1
"""Shares of the speed v0 at which braking begins, between which the deceleration is fully developed (UN R13-H,
annex 3)."""


def crossings(t_s: Floats, speed_mps: Floats, begin_s: float, levels_mps: tuple[float, float]) -> list[float] | None:
    """Times, s, at which the speed first falls to each level after ``begin_s``; None where it does not.

    Parameters
    ----------
    t_s, speed_mps : (samples,), times increasing.
    """
    times = []
    for level in levels_mps:
        below = np.flatnonzero((t_s > begin_s) & (speed_mps <= level))
        if not len(below) or below[0] == 0:
            return None
        k = int(below[0])
        fall = float(speed_mps[k - 1] - speed_mps[k])
        share = float(speed_mps[k - 1] - level) / fall if fall > 0.0 else 1.0
        times.append(max(float(t_s[k - 1] + min(max(share, 0.0), 1.0) * (t_s[k] - t_s[k - 1])), begin_s))
    return times


def distance(t_s: Floats, speed_mps: Floats, from_s: float, to_s: float) -> float:
    """Way between two times, m: integral of the speed, straight between its samples (samples,)."""
    inside = (t_s > from_s) & (t_s < to_s)
    times = np.concatenate(([from_s], t_s[inside], [to_s]))
    return float(np.trapezoid(np.interp(times, t_s, speed_mps), times))


def mean_fully_developed_deceleration(v0_mps: float, upper_m: float, lower_m: float) -> float:
    """Mean fully developed deceleration, m/s2 (UN R13-H, annex 3): (vb^2 - ve^2) / (25.92 (se - sb)), speeds in km/h.

    Parameters
    ----------
    v0_mps : speed at the beginning of braking; vb and ve are 0.8 and 0.1 of it.
    upper_m, lower_m : way sb from there to vb, and se to ve.

    Raises
    ------
    ValueError
        ve is not reached after vb.
    """
    if not lower_m > upper_m:
        raise ValueError(f"expected se beyond sb, got sb {upper_m:g} m and se {lower_m:g} m")
    vb_km_h, ve_km_h = (3.6 * share * v0_mps for share in (UPPER, LOWER))
    return (vb_km_h**2 - ve_km_h**2) / (25.92 * (lower_m - upper_m))
