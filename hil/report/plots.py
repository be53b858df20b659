"""The page's plots as plotly figures: plain dictionaries, every name in them made inert."""

import html
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.report.palette import Stroke, strokes
from hil.report.report import Chart, Panel
from hil.report.thin import thinned
from hil.report.units import shown, symbol
from hil.report.words import clean

MARGIN_LEFT, MARGIN_RIGHT = 58, 14  # px; the page's timeline keeps to them too

Figure = dict[str, Any]
_Y_DIGITS, _T_DECIMALS = 7, 6


class Pool:
    """The page's number store: traces sampled at the same times share one list."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.lists: list[list[float]] = []
        self.thinned: list[str] = []
        self._index: dict[bytes, int] = {}

    def time(self, t_s: NDArray[np.float64]) -> int:
        """Store ``t_s`` (s, to the microsecond) once and return its place."""
        key = t_s.tobytes()
        if key not in self._index:
            self._index[key] = len(self.lists)
            self.lists.append(np.round(t_s, _T_DECIMALS).tolist())
        return self._index[key]

    def keep(self, name: str, y: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the indices of ``y`` that go on the page, and remember where some were left out."""
        kept = thinned(y, self.limit)
        if kept.size < y.size:
            self.thinned.append(f"{clean(name)}: {kept.size} of {y.size}")
        return kept


def inert(text: str) -> str:
    """Return ``text`` so that plotly shows it letter for letter: no markup, no entity, no template.

    Plotly reads a subset of HTML in every label and ``%{...}`` in hover templates, and resolves entities last.
    """
    return html.escape(clean(text), quote=False).replace("%", "&#37;").replace("$", "&#36;")


def numbers(values: NDArray[np.float64]) -> list[float | None]:
    """Return values rounded to 7 significant digits; None (a gap) for what is not finite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 10.0 ** np.clip(_Y_DIGITS - 1 - np.floor(np.log10(np.abs(values))), -300, 300)
        rounded = np.where(values == 0.0, 0.0, np.round(values * scale) / scale)
    return [v if ok else None for v, ok in zip(rounded.tolist(), np.isfinite(values).tolist(), strict=True)]


def panel_figure(panel: Panel, span_s: tuple[float, float], pool: Pool) -> Figure:
    """Return a time-series plot over ``span_s``; its ``x`` are places in ``pool``."""
    unit = inert(symbol(panel.unit))
    data = []
    decimals = _decimals([shown(trace.y, panel.unit) for trace in panel.traces])
    y_format = ".4g" if decimals is None else f".{decimals}f"
    for trace, stroke in zip(panel.traces, strokes(panel.traces), strict=True):
        kept = pool.keep(f"{panel.title} / {trace.name}", trace.y)
        data.append(
            {
                **_drawn(stroke),
                "name": inert(trace.name),
                "x": pool.time(trace.t_s[kept]),
                "y": numbers(shown(trace.y[kept], panel.unit)),
                "hovertemplate": f"{inert(trace.name)}  %{{y:{y_format}}} {unit}<extra></extra>",
            }
        )
    layout = _layout()
    layout |= {"hovermode": "x unified", "meta": {"decimals": decimals}}
    layout["xaxis"] |= {"range": list(span_s), "hoverformat": ".3f", "unifiedhovertitle": {"text": "%{x} s"}}
    return {"data": data, "layout": layout}


def _decimals(courses: list[NDArray[np.float64]]) -> int | None:
    """Return the decimals that give a panel's largest value four digits; None where that needs an exponent."""
    largest = max((float(np.abs(y[np.isfinite(y)]).max()) for y in courses if np.isfinite(y).any()), default=0.0)
    if largest == 0.0:
        return 0
    return max(0, 3 - int(np.floor(np.log10(largest)))) if 1e-3 <= largest < 1e6 else None


def chart_figure(chart: Chart, pool: Pool) -> Figure:
    """Return a plot of curves, points and intervals."""
    x_unit, y_unit = inert(symbol(chart.x_unit)), inert(symbol(chart.y_unit))
    data: list[Figure] = []
    for curve, stroke in zip(chart.curves, strokes(chart.curves), strict=True):
        kept = pool.keep(f"{chart.title} / {curve.name}", curve.y)

        def as_shown(values: NDArray[np.float64], kept: NDArray[np.intp] = kept) -> list[float | None]:
            return numbers(shown(values[kept], chart.y_unit))

        x = numbers(shown(curve.x[kept], chart.x_unit))
        curve_data = {
            **_drawn(stroke),
            "name": inert(curve.name),
            "x": x,
            "y": as_shown(curve.y),
            "hovertemplate": f"{inert(curve.name)}<br>%{{x:.5~r}} {x_unit}<br>%{{y:.5~r}} {y_unit}<extra></extra>",
        }
        if curve.low is not None and curve.high is not None:
            data += _interval(curve_data, stroke, curve.low, curve.high, as_shown)
        data.append(curve_data)
    layout = _layout()
    layout |= {"hovermode": "closest", "margin": {**layout["margin"], "b": 44}}
    layout["xaxis"]["title"] = {"text": _axis(chart.x_label, x_unit), "standoff": 6}
    layout["yaxis"]["title"] = {"text": _axis(chart.y_label, y_unit), "standoff": 4}
    return _turned(chart, data, layout) if chart.rows else {"data": data, "layout": layout}


def _turned(chart: Chart, data: list[Figure], layout: Figure) -> Figure:
    """Return a plot with named rows in place of the x axis."""
    other = {"x": "y", "y": "x", "error_y": "error_x"}
    names = [inert(name) for name in chart.rows]
    turned = [{other.get(key, key): value for key, value in curve.items()} for curve in data]
    unit = inert(symbol(chart.y_unit))
    for curve in turned:
        curve["hovertemplate"] = f"{curve['name']}<br>%{{x:.5~r}} {unit}<extra></extra>"
        if curve["mode"] == "markers":
            curve["customdata"] = [names[round(y) - 1] for y in curve["y"]]
            curve["hovertemplate"] = f"%{{customdata}}<br>{curve['hovertemplate']}"
    rows = {"tickvals": list(range(1, len(names) + 1)), "ticktext": names, "range": [len(names) + 0.6, 0.4]}
    values, places = layout["yaxis"], layout["xaxis"] | rows | {"automargin": True, "title": {"text": ""}}
    return {"data": turned, "layout": layout | {"xaxis": values, "yaxis": places}}


def _axis(label: str, unit: str) -> str:
    return f"{inert(label)} in {unit}" if unit else inert(label)


def _drawn(stroke: Stroke) -> Figure:
    if stroke.points:
        return {"type": "scatter", "mode": "markers", "marker": {"color": stroke.colour, "size": 5, "opacity": 0.7}}
    dash = ",".join(f"{length}px" for length in stroke.dash) or "solid"
    return {"type": "scatter", "mode": "lines", "line": {"color": stroke.colour, "width": stroke.width, "dash": dash}}


def _interval(
    curve: Figure,
    stroke: Stroke,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    as_shown: Callable[[NDArray[np.float64]], list[float | None]],
) -> list[Figure]:
    """Return the bounds: bars at points; a filled band along a line. Bars are put into ``curve`` itself."""
    lows, highs = as_shown(low), as_shown(high)
    if stroke.points:
        up = [None if h is None or y is None else h - y for h, y in zip(highs, curve["y"], strict=True)]
        down = [None if b is None or y is None else y - b for b, y in zip(lows, curve["y"], strict=True)]
        curve["error_y"] = {"type": "data", "array": up, "arrayminus": down, "width": 3, "thickness": 1.2}
        return []
    edge: Figure = {"type": "scatter", "mode": "lines", "line": {"width": 0}, "hoverinfo": "skip", "x": curve["x"]}
    red, green, blue = (int(stroke.colour[i : i + 2], 16) for i in (1, 3, 5))
    fill = f"rgba({red},{green},{blue},0.18)"
    return [{**edge, "y": lows}, {**edge, "y": highs, "fill": "tonexty", "fillcolor": fill}]


def _layout() -> Figure:
    """Return what all plots share; colours of paper and ink are the page's business."""
    axis = {
        "zeroline": False,
        "showspikes": False,
        "ticks": "outside",
        "ticklen": 4,
        "minexponent": 5,
        "exponentformat": "e",
    }
    return {
        "margin": {"l": MARGIN_LEFT, "r": MARGIN_RIGHT, "t": 6, "b": 26},
        "showlegend": False,
        "xaxis": {**axis},
        "yaxis": {**axis, "nticks": 6},
    }
