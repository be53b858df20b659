"""The page's plots as plain data, which `client/plot.js` draws."""

import base64
import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.report.palette import Stroke, strokes
from hil.report.report import Chart, Panel
from hil.report.thin import thinned
from hil.report.units import Unit, shown, symbol
from hil.report.words import clean

Figure = dict[str, Any]
_Y_DIGITS, _T_DECIMALS = 6, 6
_LEVEL = 6  # of deflate: 9 takes four times as long for two percent
_NAME_PX, _TIGHT_PX, _MANY = 24, 16, 20  # CSS px for each name at an axis, and for each of more than twenty


class Pool:
    """The page's number store: traces sampled at the same times share one list.

    Attributes
    ----------
    limit : most samples of a trace.
    figures : plots in the order of the page.
    thinned : one line for each trace of which samples were left out.
    """

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.figures: list[Figure] = []
        self.thinned: list[str] = []
        self._times: list[list[float]] = []
        self._index: dict[bytes, int] = {}

    def time(self, t_s: NDArray[np.float64]) -> int:
        """Store ``t_s`` (s, to the microsecond) once and return its place."""
        key = t_s.tobytes()
        if key not in self._index:
            self._index[key] = len(self._times)
            self._times.append(np.round(t_s, _T_DECIMALS).tolist())
        return self._index[key]

    def keep(self, name: str, y: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the indices of ``y`` that go on the page, and remember where some were left out."""
        kept = thinned(y, self.limit)
        if kept.size < y.size:
            self.thinned.append(f"{clean(name)}: {kept.size} of {y.size}")
        return kept

    def packed(self) -> str:
        """Return times and figures as deflated JSON in base64, which no name can leave."""
        text = json.dumps({"times": self._times, "figures": self.figures}, separators=(",", ":"), allow_nan=False)
        return base64.b64encode(zlib.compress(text.encode("utf-8"), _LEVEL)).decode("ascii")


def numbers(values: NDArray[np.float64]) -> list[float | None]:
    """Return values rounded to 6 significant digits; None (a gap) for what is not finite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 10.0 ** np.clip(_Y_DIGITS - 1 - np.floor(np.log10(np.abs(values))), -300, 300)
        rounded = np.where(values == 0.0, 0.0, np.round(values * scale) / scale)
    return [v if ok else None for v, ok in zip(rounded.tolist(), np.isfinite(values).tolist(), strict=True)]


def panel_figure(panel: Panel, span_s: tuple[float, float], pool: Pool) -> Figure:
    """Return a time-series plot over ``span_s``; its ``x`` are places in ``pool``."""
    traces = []
    for trace, stroke in zip(panel.traces, strokes(panel.traces), strict=True):
        kept = pool.keep(f"{panel.title} / {trace.name}", trace.y)
        y = numbers(shown(trace.y[kept], panel.unit))
        traces.append({**_drawn(stroke), "name": clean(trace.name), "x": pool.time(trace.t_s[kept]), "y": y})
    y_axis: Figure = {"decimals": _decimals([shown(trace.y, panel.unit) for trace in panel.traces])}
    if panel.names:
        y_axis |= {"names": [clean(name) for name in panel.names], "range": [-0.5, len(panel.names) - 0.5]}
    return {"kind": "panel", "x": {"range": list(span_s)}, "y": y_axis, "traces": traces}


def height_px(names: int) -> int:
    """Return the height of a plot with ``names`` at its value axis, CSS px."""
    return max(60, (_NAME_PX if names <= _MANY else _TIGHT_PX) * names) + 30


def _decimals(courses: list[NDArray[np.float64]]) -> int | None:
    """Return the decimals that give a panel's largest value four digits; None where that needs an exponent."""
    largest = max((float(np.abs(y[np.isfinite(y)]).max()) for y in courses if np.isfinite(y).any()), default=0.0)
    if largest == 0.0:
        return 0
    return max(0, 3 - int(np.floor(np.log10(largest)))) if 1e-3 <= largest < 1e6 else None


def chart_figure(chart: Chart, pool: Pool) -> Figure:
    """Return a plot of curves, points and intervals; named rows lie along its y axis, the values along x."""
    along, across = ("y", "x") if chart.rows else ("x", "y")
    traces = []
    for curve, stroke in zip(chart.curves, strokes(chart.curves), strict=True):
        kept = pool.keep(f"{chart.title} / {curve.name}", curve.y)
        trace = {**_drawn(stroke), "name": clean(curve.name)}
        trace |= {
            along: numbers(shown(curve.x[kept], chart.x_unit)),
            across: numbers(shown(curve.y[kept], chart.y_unit)),
        }
        if curve.low is not None and curve.high is not None:
            bounds = (("low", curve.low), ("high", curve.high))
            trace |= {key: numbers(shown(values[kept], chart.y_unit)) for key, values in bounds}
        traces.append(trace)
    value_axis = _axis(chart.y_label, chart.y_unit)
    if not chart.rows:
        return {"kind": "chart", "x": _axis(chart.x_label, chart.x_unit), "y": value_axis, "traces": traces}
    rows = [clean(name) for name in chart.rows]
    y_axis = {"range": [0.4, len(rows) + 0.6]}
    return {"kind": "chart", "rows": rows, "x": value_axis, "y": y_axis, "traces": traces}


def _axis(label: str, unit: Unit) -> Figure:
    name, text = clean(symbol(unit)), clean(label)
    return {"label": f"{text} in {name}" if name else text, "unit": name}


def _drawn(stroke: Stroke) -> Figure:
    if stroke.points:
        return {"colour": stroke.colour, "points": True}
    steps = {"steps": True} if stroke.steps else {}
    dash = {"dash": list(stroke.dash)} if stroke.dash else {}
    return {"colour": stroke.colour, "width": stroke.width, **dash, **steps}
