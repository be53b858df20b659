"""Two quantities that ought to be the same: how well they go together, by which factor, and how late one is."""

from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.trial.motion import STEP_S

LONGEST_S = 1.5
"""Largest lag that is looked for."""
_LEAST_SAMPLES = 100  # 2 s


@dataclass(frozen=True)
class Agreement:
    """How ``y`` goes with ``x``.

    ``correlation`` -1 to 1, at ``lag_s`` (y is late where it is positive); ``factor`` is y per x: the ratio of the
    standard deviations, with the sign of the correlation. ``samples`` that were compared.
    """

    correlation: float
    factor: float
    lag_s: float
    samples: int


NONE = Agreement(0.0, 0.0, 0.0, 0)


def agreement(x: Floats, y: Floats, longest_s: float = LONGEST_S, within: Floats | None = None) -> Agreement:
    """Compare at the lag of at most ``longest_s`` at which the correlation's size is largest; x and y (rows,).

    ``within`` (rows,) limits the rows of x; NaN are left out.
    """
    known_x, known_y = np.isfinite(x), np.isfinite(y)
    if within is not None:
        known_x = known_x & (within > 0.0)
    if min(known_x.sum(), known_y.sum()) < _LEAST_SAMPLES:
        return NONE
    zero_x = np.where(known_x, x - np.mean(x[known_x]), 0.0)
    zero_y = np.where(known_y, y - np.mean(y[known_y]), 0.0)
    count = 1 << int(np.ceil(np.log2(2 * len(x))))
    product = np.fft.irfft(np.conj(np.fft.rfft(zero_x, count)) * np.fft.rfft(zero_y, count), count)
    most = min(round(longest_s / STEP_S), len(x) - _LEAST_SAMPLES)
    if most < 0:
        return NONE
    lags = np.arange(-most, most + 1)
    sizes = product[lags % count]
    best = int(np.argmax(np.abs(sizes)))
    here = _at(x, y, known_x, known_y, int(lags[best]))
    fine = 0.0
    if 0 < best < len(sizes) - 1:
        a, b, c = np.abs(sizes[best - 1 : best + 2])
        fine = 0.5 * (a - c) / (a - 2.0 * b + c) if a - 2.0 * b + c < 0.0 else 0.0
    return Agreement(here.correlation, here.factor, float(lags[best] + fine) * STEP_S, here.samples)


def _at(
    x: Floats, y: Floats, known_x: "np.typing.NDArray[np.bool_]", known_y: "np.typing.NDArray[np.bool_]", lag: int
) -> Agreement:
    """Compare with y ``lag`` rows earlier."""
    to_x, to_y = slice(max(-lag, 0), len(x) - max(lag, 0)), slice(max(lag, 0), len(y) - max(-lag, 0))
    both = known_x[to_x] & known_y[to_y]
    if both.sum() < _LEAST_SAMPLES:
        return NONE
    a, b = x[to_x][both], y[to_y][both]
    sd_a, sd_b = float(np.std(a)), float(np.std(b))
    if min(sd_a, sd_b) <= 1e-12:
        return NONE
    correlation = float(np.mean((a - a.mean()) * (b - b.mean())) / (sd_a * sd_b))
    return Agreement(correlation, float(np.copysign(sd_b / sd_a, correlation)), lag * STEP_S, int(both.sum()))


def near(value: float, factor: float, share: float) -> bool:
    """Whether a positive value is ``factor`` within a share of it, either way."""
    return value > 0.0 and abs(np.log(value / factor)) < np.log1p(share)
