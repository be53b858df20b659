"""Statistics of residuals that both ways of `explain` report: held-out error with its interval, and patterns."""

from collections.abc import Mapping

import numpy as np
from scipy.stats import spearmanr

from hil.diagnosis.data.log import Floats

FOLDS = 4
"""Folds of a cross-validation."""
_DRAWS = 400
_MIN_CORRELATION, _MIN_SAMPLES = 0.25, 40
"""Rank correlation (Spearman), and number of samples more than which, from which on a variable is reported."""
_MIN_OFFSET = 0.7
"""Mean of a residual over its standard deviation, above which it counts as a constant offset."""


def squares_by_segment(residual: Floats, valid: Floats, segment_id: Floats) -> Floats:
    """(segments, 2) sums of squares and counts of the samples that are ``valid`` (true or false)."""
    segments = np.asarray(segment_id, np.int64)
    count = int(segments.max()) + 1
    squares = np.bincount(segments[valid], residual[valid].astype(np.float64) ** 2, count)
    return np.column_stack((squares, np.bincount(segments[valid], minlength=count)))


def root_mean_square(squares: Floats) -> float:
    """Over all segments of `squares_by_segment`; 0 where there is no sample."""
    return float(np.sqrt(squares[:, 0].sum() / max(squares[:, 1].sum(), 1.0)))


def bootstrap_interval(squares: Floats) -> tuple[float, float]:
    """95 % interval of `root_mean_square` by bootstrap over segments."""
    drawn = np.random.default_rng(0).integers(0, len(squares), (_DRAWS, len(squares)))
    total = squares[drawn].sum(axis=1)
    low, high = np.quantile(np.sqrt(total[:, 0] / np.maximum(total[:, 1], 1.0)), (0.025, 0.975))
    return float(low), float(high)


def pattern(
    residual: Floats, valid: Floats, variables: Mapping[str, Floats], stride: int, otherwise: str = "no simple pattern"
) -> str:
    """The one or two variables that a residual correlates with most, else a constant offset, else ``otherwise``.

    Parameters
    ----------
    residual, variables : (samples,), NaN where unknown; ``valid`` is true or false.
    stride : every so many samples count.
    """
    correlations = []
    for name, variable in variables.items():
        good = valid & np.isfinite(residual) & np.isfinite(variable)
        x, y = variable[good][::stride], residual[good][::stride]
        if len(x) > _MIN_SAMPLES and np.ptp(x) > 0.0 and np.ptp(y) > 0.0:
            correlations.append((float(spearmanr(x, y)[0]), name))
    strong = [one for one in correlations if abs(one[0]) > _MIN_CORRELATION]
    strong.sort(key=lambda one: -abs(one[0]))
    if strong:
        return "; ".join(f"{'grows' if r > 0 else 'falls'} with {name} ({r:+.2f})" for r, name in strong[:2])
    if not np.isfinite(residual[valid]).any():
        return otherwise
    offset = float(np.nanmean(residual[valid])) / max(float(np.nanstd(residual[valid])), 1e-12)
    return "constant offset" if abs(offset) > _MIN_OFFSET else otherwise
