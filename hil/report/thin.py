"""Fewer samples where a page would grow too large; no peak and no gap is lost."""

import numpy as np
from numpy.typing import NDArray

from hil.report.report import Report

PAGE_SAMPLES = 160_000  # of all traces together: below 1 MB even where they are noise
TRACE_SAMPLES = 20_000  # what a browser draws fluently


def samples_per_trace(report: Report) -> int:
    """Return the number of samples that each trace may keep so that the page stays small."""
    sizes = [trace.y.size for section in report.sections for panel in section.panels for trace in panel.traces]
    sizes += [curve.y.size for section in report.sections for chart in section.charts for curve in chart.curves]
    if sum(sizes) <= PAGE_SAMPLES:
        return TRACE_SAMPLES
    return min(TRACE_SAMPLES, max(500, PAGE_SAMPLES // len(sizes)))


def thinned(y: NDArray[np.float64], limit: int) -> NDArray[np.intp]:
    """Return the indices to keep: first, last, and of every bucket the least, the greatest and a missing sample.

    Parameters
    ----------
    y : (n,) values; NaN is missing.
    limit : most samples to keep, 8 or more.

    Returns
    -------
    Increasing indices, all of them when ``n <= limit``.
    """
    n = y.size
    if n <= limit:
        return np.arange(n)
    edges = np.linspace(0, n, (limit - 2) // 3 + 1).astype(np.intp)
    bucket = np.repeat(np.arange(len(edges) - 1), np.diff(edges))
    kept = [np.array([0, n - 1]), _first_of_each(np.isnan(y), bucket)]
    for extreme in (np.fmin, np.fmax):
        kept.append(_first_of_each(y == extreme.reduceat(y, edges[:-1])[bucket], bucket))
    return np.unique(np.concatenate(kept))


def _first_of_each(marked: NDArray[np.bool_], bucket: NDArray[np.intp]) -> NDArray[np.intp]:
    """Index of the first marked sample of each bucket that has one."""
    at: NDArray[np.intp] = np.flatnonzero(marked)
    first: NDArray[np.bool_] = np.diff(bucket[at], prepend=-1) != 0
    return at[first]
