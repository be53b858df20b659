"""Parts that the reports of both ways of `explain` share."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.data.log import Floats
from hil.report.report import Cell, Curve, Lane, Panel, Section, Span, Table, Trace
from hil.report.units import Unit

NOMINAL, EXTENDED = "rl", "fl"
"""Groups, that is colours, of the nominal and of the extended model."""
_MIN_SAMPLES = 100


def rounded(value: float) -> float:
    """Three significant digits."""
    return float(f"{value:.3g}")


def comparison_panels(
    title: str, unit: Unit, t_s: Floats, measured: Floats, models: Mapping[str, Floats]
) -> list[Panel]:
    """A channel over time, measured and by each model (the nominal one first), and the residuals below."""
    groups = dict(zip(models, (NOMINAL, EXTENDED), strict=True))
    traces = [Trace(name, t_s, values, group=groups[name]) for name, values in models.items()]
    residuals = [Trace(name, t_s, measured - values, group=groups[name]) for name, values in models.items()]
    return [
        Panel(title, unit, (Trace("measured", t_s, measured, "measured"), *traces)),
        Panel(f"{title.split(',')[0]}: residual", unit, tuple(residuals)),
    ]


def joined_time(dataset: Dataset) -> tuple[Floats, Floats]:
    """Time over all logs, one after the other, (samples,), and where each log begins."""
    times, gaps, begin = [], [], 0.0
    for recording in dataset.recordings:
        times.append(begin + np.arange(recording.samples) * dataset.sample_s)
        gap = np.zeros(recording.samples, bool)
        gap[0] = True
        gaps.append(gap)
        begin = float(times[-1][-1]) + 1.0
    return np.concatenate(times), np.concatenate(gaps)


def log_lane(names: Sequence[str], begins_s: Sequence[float], end_s: float) -> Lane:
    """Which file lies where, of logs that stand one after the other."""
    ends_s = [*begins_s[1:], end_s]
    spans = (Span(begin, end, name) for name, begin, end in zip(names, begins_s, ends_s, strict=True))
    return Lane("log", tuple(spans))


def binned_curve(
    x: Floats, y: Floats, name: str, group: str, bins: int, min_samples: int, min_bins: int = 1
) -> list[Curve]:
    """Mean and standard deviation of y in bins of equal numbers of samples; empty where there are too few of them.

    Parameters
    ----------
    min_samples : a bin needs more than this.  min_bins : the curve needs this many.
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if len(x) < _MIN_SAMPLES or np.ptp(x) <= 0.0:
        return []
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, bins + 1)))
    at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    inside = [at == k for k in range(len(edges) - 1)]
    rows = [(x[one].mean(), y[one].mean(), y[one].std()) for one in inside if one.sum() > min_samples]
    if len(rows) < min_bins:
        return []
    centre, mean, spread = (np.array(v) for v in zip(*rows, strict=True))
    return [Curve(name, centre, mean, mean - spread, mean + spread, group=group)]


def limits(undetectable: Sequence[tuple[str, str]], content: Mapping[str, Any], manoeuvres: Iterable[str]) -> Section:
    """Undetectable effects (what, which), missing channels and remarks of the answer, discriminating manoeuvres."""
    rows: list[tuple[Cell, ...]] = [
        *undetectable,
        *(("missing channel", text) for text in content["missing"]),
        *(("remark", text) for text in content["remarks"]),
    ]
    if names := ", ".join(manoeuvres):
        rows.append(("drive this to decide", names))
    return Section("What these data cannot show", tables=(Table("Limits", ("what", "which"), tuple(rows)),))
