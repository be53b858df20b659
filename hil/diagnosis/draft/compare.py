"""Two signals compared: correlation, ratio with its interval, and lag."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.trial.agreement import LONGEST_S, agreement
from hil.diagnosis.data.trial.motion import STEP_S

_BLOCKS = 10
_STUDENT_95 = 2.262
"""Student's t of nine degrees of freedom, two-sided 95 %."""


@dataclass(frozen=True)
class Evidence:
    """How a signal goes with what it ought to be.

    ``ratio`` is signal per reference with its 95 % interval (a jackknife over ten stretches of the time), ``lag_s`` how
    late the signal is, ``against`` the reference in words, ``seconds`` how long both were there.
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
            f"{self.correlation:.3f}, {abs(1e3 * self.lag_s):.0f} ms {'late' if self.lag_s >= 0.0 else 'early'}, over "
            f"{self.seconds:.0f} s"
        )

    def as_json(self) -> dict[str, Any]:
        """Numbers by name."""
        return {
            "correlation": self.correlation, "ratio": self.ratio, "ci95": [self.low, self.high], "lag_s": self.lag_s,
            "against": self.against, "seconds": self.seconds,
        }  # fmt: skip


def compared(
    reference: Floats, values: Floats, against: str, within: Floats | None = None, longest_s: float = LONGEST_S
) -> Evidence | None:
    """Compare values (rows,) with a reference; None where too little of both is there, or one does not move.

    ``within`` (rows,) is above 0 in the rows of the reference that count.
    """
    seen = agreement(reference, values, longest_s, within)
    if not seen.samples or seen.factor == 0.0 or not np.isfinite(seen.factor):
        return None
    late = _earlier(values, round(seen.lag_s / STEP_S))
    both = np.isfinite(reference) & np.isfinite(late)
    if within is not None:
        both &= within > 0.0
    x, y = reference[both], late[both]
    ratios = [_ratio(x[keep], y[keep]) for keep in _left_out(len(x))]
    spread = float(np.std(ratios)) * np.sqrt(_BLOCKS - 1.0)  # of a jackknife
    half = _STUDENT_95 * spread
    return Evidence(
        seen.correlation,
        seen.factor,
        seen.factor - half,
        seen.factor + half,
        seen.lag_s,
        against,
        seen.samples * STEP_S,
    )


def _earlier(values: Floats, rows: int) -> Floats:
    """Values ``rows`` earlier, NaN beyond the ends."""
    out = np.full(len(values), np.nan)
    if rows >= 0:
        out[: len(values) - rows] = values[rows:]
    else:
        out[-rows:] = values[:rows]
    return out


def _left_out(count: int) -> list[Floats]:
    """Rows that stay when each of ten stretches is left out."""
    at = np.arange(count) * _BLOCKS // max(count, 1)
    return [at != block for block in range(_BLOCKS)]


def _ratio(x: Floats, y: Floats) -> float:
    """Ratio of the standard deviations, with the sign of the correlation."""
    zero_x, zero_y = x - x.mean(), y - y.mean()
    size = float(np.std(x))
    return float(np.copysign(np.std(y) / size, zero_x @ zero_y)) if size > 0.0 else 0.0
