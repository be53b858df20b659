"""How good the numbers of rightly named causes are."""

from collections.abc import Sequence

from hil.validation.blind_trials.metrics import Metric, Metrics, Record, median, metric, share, wilson
from hil.validation.blind_trials.names import numbers
from hil.validation.blind_trials.reading import is_top


def parameters(records: Sequence[Record]) -> Metrics:
    """Relative error of the numbers of rightly named causes, how often the interval holds them, and the place."""
    right = [record for record in records if is_top(record)]
    errors, covered = [], []
    for record in right:
        named = record["causes"][0]["parameters"]
        for name, true in numbers(record["hidden"][0]).items():
            if name in named:
                errors.append(abs(named[name]["value"] - true) / abs(true))
                covered.append(named[name]["ci95"][0] <= true <= named[name]["ci95"][1])
    return {
        "median_error": median(errors, 0.1, at_most=True), "coverage95": coverage(covered, 0.92, 0.98),
        "right_place": share(right, lambda r: r["causes"][0]["location"] == r["hidden"][0]["location"]),
    }  # fmt: skip


def coverage(covered: Sequence[bool], low: float, high: float) -> Metric:
    """Share of 95 % intervals that hold the truth; met between ``low`` and ``high``."""
    value = sum(covered) / len(covered) if covered else None
    entry = metric(value, *wilson(sum(covered), len(covered)), 0.95, at_most=False)
    return entry | {"met": None if value is None else low <= value <= high}
