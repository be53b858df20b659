"""Whether probabilities come true: of the first cause named, that it is the hidden one."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil.validation.blind_trials.metrics import Metrics, Record, bootstrapped
from hil.validation.blind_trials.reading import is_top

BINS = 10
Floats = NDArray[np.float64]


def calibration(records: Sequence[Record]) -> Metrics:
    """Expected calibration error and Brier score over all cases in which a cause is named."""
    named = [record for record in records if record["causes"]]
    chances, hits = [record["causes"][0]["probability"] for record in named], [is_top(record) for record in named]
    return {
        "calibration_error": bootstrapped(calibration_error, chances, hits, 0.05),
        "brier": bootstrapped(brier, chances, hits, None),
    }


def calibration_error(chances: Floats, hits: Floats) -> float:
    """Mean distance of probability and frequency over `BINS` equal bins, weighted by cases (Naeini 2015).

    Parameters
    ----------
    chances, hits : (cases,), probability and whether it came true (0 or 1).
    """
    bins = np.minimum((chances * BINS).astype(np.int64), BINS - 1)
    apart = np.bincount(bins, chances - hits, BINS)
    return float(np.abs(apart).sum() / len(chances))


def brier(chances: Floats, hits: Floats) -> float:
    """Mean squared distance of probability and outcome (Brier 1950)."""
    return float(np.mean((chances - hits) ** 2))
