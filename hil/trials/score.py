"""Scores of blind trials: shares with their Wilson intervals, against the pass marks."""

from collections.abc import Callable, Mapping, Sequence
from math import isnan, sqrt
from typing import Any

Record = Mapping[str, Any]
_Z = 1.959964


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927)."""
    if count == 0:
        return 0.0, 1.0
    share, z2 = hits / count, _Z * _Z
    centre = (share + z2 / (2 * count)) / (1.0 + z2 / count)
    half = _Z / (1.0 + z2 / count) * sqrt(share * (1.0 - share) / count + z2 / (4.0 * count * count))
    return max(centre - half, 0.0), min(centre + half, 1.0)


def table_of(family: str, records: Sequence[Record]) -> dict[str, Any]:
    """``n`` and ``metrics`` {name: {value, low, high, pass_mark, met}} of a family."""
    metrics: dict[str, Any] = {}
    if family == "null":
        _share(metrics, "false_alarm", records, lambda r: bool(r["causes"]), 0.01, at_most=True)
    elif family == "single":
        for size in sorted({r["size"] for r in records}):
            of = [r for r in records if r["size"] == size and r["reached"]]
            mark = size >= 8.0
            _share(metrics, f"detected_snr{size:g}", of, lambda r: bool(r["causes"]), 0.95 if mark else None)
            top = {8.0: 0.9, 15.0: 0.97}.get(size)
            _share(metrics, f"top1_snr{size:g}", of, is_top, top)
            _share(metrics, f"in_set_snr{size:g}", of, in_set, 0.99 if mark else None)
    elif family == "parameters":
        _parameters(metrics, [r for r in records if is_top(r) and r["reached"]])
    else:
        _gain(metrics, [r for r in records if r["causes"]])
    return {"n": len(records), "metrics": metrics}


def is_top(record: Record) -> bool:
    """Whether the first named effect is the hidden one."""
    return bool(record["named"]) and record["named"][0] == record["hidden"][0]["effect"]


def in_set(record: Record) -> bool:
    """Whether the hidden effect is among the named ones and their rivals."""
    return record["hidden"][0]["effect"] in {*record["named"], *record["rivals"]}


def _share(
    metrics: dict[str, Any], name: str, records: Sequence[Record], hit: Callable[[Record], bool],
    mark: float | None, at_most: bool = False,
) -> None:  # fmt: skip
    hits = sum(hit(record) for record in records)
    low, high = wilson(hits, len(records))
    value = hits / len(records) if records else float("nan")
    met = None if mark is None or isnan(value) else (value <= mark if at_most else value >= mark)
    metrics[name] = {"value": value if records else 0.0, "low": low, "high": high, "pass_mark": mark, "met": met}


def _parameters(metrics: dict[str, Any], records: Sequence[Record]) -> None:
    """Relative error of the hidden number, and how often the interval holds it."""
    errors, covered = [], []
    for record in records:
        hidden = record["hidden"][0]["parameters"]
        named = record["causes"][0]["parameters"]
        for name in set(hidden) & set(named):
            true = hidden[name]["value"]
            errors.append(abs(named[name]["value"] - true) / abs(true))
            covered.append(named[name]["ci95"][0] <= true <= named[name]["ci95"][1])
    errors.sort()
    median = errors[len(errors) // 2] if errors else 0.0
    spread = (errors[len(errors) // 4], errors[3 * len(errors) // 4]) if errors else (0.0, 0.0)
    metrics["median_error"] = {
        "value": median, "low": spread[0], "high": spread[1], "pass_mark": 0.1,
        "met": median <= 0.1 if errors else None,
    }  # fmt: skip
    low, high = wilson(sum(covered), len(covered))
    share = sum(covered) / len(covered) if covered else 0.0
    met = 0.92 <= share <= 0.98 if covered else None
    metrics["coverage95"] = {"value": share, "low": low, "high": high, "pass_mark": 0.95, "met": met}


def _gain(metrics: dict[str, Any], records: Sequence[Record]) -> None:
    """How often the extended model is never more than 1 % worse than as handed in, on its worst channel."""
    _share(metrics, "never_1_percent_worse", records, _no_worse, 1.0)
    _share(metrics, "beats_best_wrong", records, _beats_wrong, None)


def _no_worse(record: Record) -> bool:
    return all(g["after"] <= 1.01 * g["before"] for g in record["gain"].values())


def _beats_wrong(record: Record) -> bool:
    """Over all channels together, each against its own error as handed in."""
    gains = [g for g in record["gain"].values() if g["best_wrong"] is not None and g["before"] > 0.0]
    own = sum((g["after"] / g["before"]) ** 2 for g in gains)
    other = sum((g["best_wrong"] / g["before"]) ** 2 for g in gains)
    return bool(gains) and own < other
