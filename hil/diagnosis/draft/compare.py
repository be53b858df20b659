"""Two signals compared: correlation, ratio with its interval, and lag."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.trial.agreement import LONGEST_S
from hil.diagnosis.data.trial.motion import STEP_S

_BLOCKS = 10
_LEAST_SAMPLES = 100  # 2 s
_STUDENT_95 = 2.262
"""Student's t of nine degrees of freedom, two-sided 95 %."""


@dataclass(frozen=True)
class Evidence:
    """How a signal goes with what it ought to be.

    ``ratio`` is signal per reference with its 95 % interval (a jackknife over ten stretches), ``lag_s`` how
    late the signal is (NaN where the best lag is the longest that was looked for: not determined), ``against`` the
    reference in words, ``seconds`` how long both were there.
    """

    correlation: float
    ratio: float
    low: float
    high: float
    lag_s: float
    against: str
    seconds: float

    @property
    def text(self) -> str:
        """In words."""
        return (
            f"{self.ratio:.4g} ({self.low:.4g} to {self.high:.4g}) times {self.against}, correlation "
            f"{self.correlation:.3f}, {self._lag}, over {self.seconds:.0f} s"
        )

    @property
    def _lag(self) -> str:
        if math.isnan(self.lag_s):
            return "lag not determined"
        return f"{abs(1e3 * self.lag_s):.0f} ms {'late' if self.lag_s >= 0.0 else 'early'}"

    def as_json(self) -> dict[str, Any]:
        """Numbers by name."""
        return {
            "correlation": self.correlation, "ratio": self.ratio, "ci95": [self.low, self.high],
            "lag_s": None if math.isnan(self.lag_s) else self.lag_s, "against": self.against, "seconds": self.seconds,
        }  # fmt: skip


def compared(
    reference: Floats, values: Floats, against: str, within: Floats | None = None, longest_s: float = LONGEST_S
) -> Evidence | None:
    """Compare values (rows,) with a reference; None where too little of both is there, or one does not move.

    ``within`` (rows,) is above 0 in the rows of the reference that count.
    """
    known = np.isfinite(reference) if within is None else np.isfinite(reference) & (within > 0.0)
    lag = _best_lag(reference, values, known, longest_s)
    if lag is None:
        return None
    late = _earlier(values, round(lag))
    both = known & np.isfinite(late)
    x, y = reference[both], late[both]
    if min(float(np.std(x)), float(np.std(y))) <= 0.0:
        return None
    correlation, ratio = float(np.corrcoef(x, y)[0, 1]), _ratio(x, y)
    half = half_width([_ratio(x[keep], y[keep]) for keep in left_out(x)])
    at_edge = abs(lag) >= round(longest_s / STEP_S)
    lag_s = math.nan if at_edge else lag * STEP_S
    return Evidence(correlation, ratio, ratio - half, ratio + half, lag_s, against, len(x) * STEP_S)


def _best_lag(x: Floats, y: Floats, known: Floats, longest_s: float) -> float | None:
    """Rows by which y is later than x, where the size of their correlation is largest; None without 2 s of both.

    The correlation at each lag is that of the rows that both have there (Padfield 2012, masked normalised
    cross-correlation): a product without that is largest where the masks overlap best.
    """
    known_y = np.isfinite(y)
    if min(known.sum(), known_y.sum()) < _LEAST_SAMPLES:
        return None
    a = np.where(known, x - np.mean(x[known]), 0.0)
    b = np.where(known_y, y - np.mean(y[known_y]), 0.0)
    count = 1 << int(np.ceil(np.log2(2 * len(x))))
    most = round(longest_s / STEP_S)
    lags = np.arange(-most, most + 1)
    of_x = [np.conj(np.fft.rfft(part, count)) for part in (known.astype(float), a, a * a)]
    of_y = [np.fft.rfft(part, count) for part in (known_y.astype(float), b, b * b)]

    def at_lags(first: Floats, second: Floats) -> Floats:
        return np.asarray(np.fft.irfft(first * second, count)[lags % count])

    n, sum_x, sum_xx = (at_lags(part, of_y[0]) for part in of_x)
    sum_y, sum_yy, sum_xy = at_lags(of_x[0], of_y[1]), at_lags(of_x[0], of_y[2]), at_lags(of_x[1], of_y[1])
    spread = (n * sum_xx - sum_x**2) * (n * sum_yy - sum_y**2)
    good = (n > _LEAST_SAMPLES - 0.5) & (spread > 1e-12 * float(np.max(spread, initial=0.0)))
    size = np.zeros(len(lags))
    size[good] = np.abs(n[good] * sum_xy[good] - sum_x[good] * sum_y[good]) / np.sqrt(spread[good])
    best = int(np.argmax(size))
    if not good[best]:
        return None
    if not 0 < best < len(size) - 1:
        return float(lags[best])
    before, here, after = size[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    return float(lags[best] + (0.5 * (before - after) / bend if bend < 0.0 else 0.0))


def without(values: Floats, others: Sequence[Floats]) -> Floats:
    """What is left of values (rows,) after a regression on others, (rows,) each, and a constant; NaN where one is."""
    known = np.all(np.isfinite([values, *others]), axis=0)
    if not others or known.sum() < _LEAST_SAMPLES:
        return values
    x = np.column_stack([np.ones(int(known.sum())), *(other[known] for other in others)])
    out = np.full(len(values), np.nan)
    out[known] = values[known] - x @ np.linalg.lstsq(x, values[known], rcond=None)[0]
    return out


def _earlier(values: Floats, rows: int) -> Floats:
    """Values ``rows`` earlier, NaN beyond the ends."""
    out = np.full(len(values), np.nan)
    if rows >= 0:
        out[: len(values) - rows] = values[rows:]
    else:
        out[-rows:] = values[:rows]
    return out


def left_out(x: Floats) -> list[Floats]:
    """Rows that stay when each of ten stretches is left out, in which ``x`` (rows,) moves alike much."""
    energy = np.cumsum((x - x.mean()) ** 2) if len(x) else np.empty(0)
    at = np.minimum((energy * _BLOCKS / max(float(energy[-1]), 1e-300)).astype(int), _BLOCKS - 1)
    return [at != block for block in range(_BLOCKS)]


def half_width(parts: Sequence[float]) -> float:
    """Half of the 95 % interval of an estimate, from those with each of ten stretches left out (jackknife)."""
    return _STUDENT_95 * float(np.std(parts)) * float(np.sqrt(_BLOCKS - 1.0))


def _ratio(x: Floats, y: Floats) -> float:
    """Ratio of the standard deviations, with the sign of the correlation."""
    zero_x, zero_y = x - x.mean(), y - y.mean()
    size = float(np.std(x))
    return float(np.copysign(np.std(y) / size, zero_x @ zero_y)) if size > 0.0 else 0.0
