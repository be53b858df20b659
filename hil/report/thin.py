"""Fewer samples where a page would grow too large; no peak and no gap is lost."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hil.report.report import Report

PAGE_SAMPLES = 240_000  # of all traces together
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
    missing = np.isnan(y)
    keep = [0, n - 1]
    for start, stop in pairwise(edges.tolist()):
        gap = missing[start:stop]
        if gap.any():
            keep.append(int(start + np.argmax(gap)))
        if not gap.all():
            piece = y[start:stop]
            keep += [int(start + np.nanargmin(piece)), int(start + np.nanargmax(piece))]
    return np.unique(np.array(keep, dtype=np.intp))
