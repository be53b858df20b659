"""Where a wheel has locked, or spun: what a car that slides does from there on follows from next to nothing."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.data.dataset import ROW_S, Segment
from hil.diagnosis.data.log import Floats

_SLIP, _BEGINS, _ROLLS = 0.5, 0.2, 0.1
"""Slip of a wheel that slides; slip at which it began to: beyond the peak of any tyre's curve on a dry road (0.1 to
0.2; Pacejka 2012, ch. 1); slip of one that rolls."""
_LASTS_S = 0.1
_LEAST_MPS = 4.0  # below, sensors with teeth miss what a wheel does within a tenth of a second


def after_wheel_lock(
    wheels: Floats, ground_mps: Floats, acting: NDArray[np.bool_], segments: Sequence[Segment], radius_m: float
) -> NDArray[np.bool_]:
    """Rows, of 10 ms, from where a wheel that rolled slides, to the end of their segment.

    Such a car yaws and stops where it does by how late the wheel let go; two simulations of it, a thousandth apart,
    end half a turn apart, and no residual from there on speaks of a cause (docs/decisions/0097).

    Parameters
    ----------
    wheels : (rows, 4), rad/s, NaN where unknown.  ground_mps : (rows,), likewise.
    acting : (rows,), where brakes or motors act: without, a wheel that stands still is a sensor that does.
    """
    told = np.abs(np.where(np.isfinite(wheels), wheels, np.nan))
    known = np.isfinite(told).any(axis=1)
    least, most = np.full(len(told), np.nan), np.full(len(told), np.nan)
    least[known], most[known] = np.nanmin(told[known], axis=1), np.nanmax(told[known], axis=1)
    rolling = np.fmax(most, np.abs(ground_mps) / radius_m)
    slip = np.zeros(len(told))
    fast = known & (rolling * radius_m > _LEAST_MPS)
    slip[fast] = 1.0 - least[fast] / rolling[fast]
    lasting = int(_LASTS_S / ROW_S)
    slides = np.convolve((slip > _SLIP) & acting, np.ones(lasting), mode="full")[: len(slip)] > lasting - 0.5
    found = np.zeros(len(slip), bool)
    for segment in segments:
        at = np.flatnonzero(slides[segment.first : segment.last])
        if not len(at):
            continue
        end = segment.first + int(at[0])
        grips = np.flatnonzero(slip[:end] < _BEGINS)
        rolled = (slip[:end] < _ROLLS)[fast[:end]].any()
        if len(grips) and rolled:
            found[max(int(grips[-1]) + 1, segment.first) : segment.last] = True
    return found
