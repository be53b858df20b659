"""Scores with their 95 % intervals against a pass mark: {value, low, high, pass_mark, met}."""

from collections.abc import Callable, Mapping, Sequence
from math import sqrt
from typing import Any

import numpy as np
from scipy.stats import binom

Record = Mapping[str, Any]
Metric = dict[str, Any]
Metrics = dict[str, Metric]
_Z = 1.959964
_DRAWS = 1000


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927)."""
    if count == 0:
        return 0.0, 1.0
    share, z2 = hits / count, _Z * _Z
    centre = (share + z2 / (2 * count)) / (1.0 + z2 / count)
    half = _Z / (1.0 + z2 / count) * sqrt(share * (1.0 - share) / count + z2 / (4.0 * count * count))
    return max(centre - half, 0.0), min(centre + half, 1.0)


def metric(value: float | None, low: float | None, high: float | None, mark: float | None, at_most: bool) -> Metric:
    """One score; without a value (no case tells) or without a mark it is neither met nor missed."""
    met = None if value is None or mark is None else (value <= mark if at_most else value >= mark)
    return {"value": value, "low": low, "high": high, "pass_mark": mark, "met": met}


def share(
    records: Sequence[Record], hit: Callable[[Record], bool], mark: float | None = None, at_most: bool = False
) -> Metric:
    """Share of records that hit, with its Wilson interval."""
    hits, count = sum(bool(hit(record)) for record in records), len(records)
    return metric(hits / count if count else None, *wilson(hits, count), mark, at_most)


def median(values: Sequence[float], mark: float | None = None, at_most: bool = False) -> Metric:
    """Median, with the interval between order statistics that holds it whatever the distribution."""
    if not len(values):
        return metric(None, None, None, mark, at_most)
    ordered, count = np.sort(np.asarray(values, np.float64)), len(values)
    rank = int(binom.ppf(0.025, count, 0.5))
    low, high = ordered[max(rank - 1, 0)], ordered[min(count - rank, count - 1)]
    return metric(float(np.median(ordered)), float(low), float(high), mark, at_most)


def mean(values: Sequence[float]) -> Metric:
    """Mean, with its interval over drawn cases."""
    return bootstrapped(lambda drawn, _: float(drawn.mean()), values, [True] * len(values), None)


def bootstrapped(
    score: Callable[[np.ndarray[Any, Any], np.ndarray[Any, Any]], float], chances: Sequence[float],
    hits: Sequence[bool], mark: float | None,
) -> Metric:  # fmt: skip
    """A score of chances against what came true, with its interval over drawn cases; a mark is the most it may be."""
    if not len(chances):
        return metric(None, None, None, mark, True)
    p, y = np.asarray(chances, np.float64), np.asarray(hits, np.float64)
    rng = np.random.default_rng(0)
    drawn = [score(p[k], y[k]) for k in rng.integers(0, len(p), (_DRAWS, len(p)))]
    low, high = np.quantile(drawn, (0.025, 0.975))
    return metric(score(p, y), float(low), float(high), mark, True)
