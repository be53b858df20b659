"""Signals over one time axis as an HTML page without network."""

import json
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from hil.report.courses import Course, Courses, less, lonely, rows_of_legend, span, ticks, value_range
from hil.report.page import FOOT, HEAD
from hil.report.palette import INK, SERIES
from hil.report.plots import inert, numbers
from hil.report.words import clean

PAGE_SAMPLES = 240_000  # of all courses together
MOST_PAGE_SAMPLES = 40_000  # of one
_SOFT, _RULE, _GRID = "#57636F", "#C9D1D9", "#E8ECF0"
_STYLE = """
body { margin: 0; background: #ffffff; color: #1b2733;
  font: 14px/1.45 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, "DejaVu Sans", sans-serif; }
main { max-width: 1500px; margin: 0 auto; padding: 22px 20px 30px; }
h1 { font-size: 21px; line-height: 1.2; margin: 0 0 4px; overflow-wrap: anywhere; }
p { margin: 0 0 8px; color: #57636f; overflow-wrap: anywhere; }
"""
_SCRIPT = """
const figure = JSON.parse(document.getElementById("data").textContent);
Plotly.newPlot("plot", figure.data, figure.layout, {responsive: true, displaylogo: false, scrollZoom: false});
"""
_PANEL_PX, _LINE_PX, _GAP_PX, _TOP_PX, _BOTTOM_PX = 170, 18, 16, 30, 46  # the buttons stand in the top margin


def courses_page(plots: Sequence[Courses], title: str, subtitle: str) -> str:
    """Return the plots as one HTML document; plotly's script is in it, and nothing is loaded from elsewhere."""
    from plotly.offline import get_plotlyjs

    data = json.dumps(courses_figure(plots), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    hint = "drag to zoom, shift-drag to pan, double-click for all"
    return "\n".join(
        [
            HEAD.format(title=escape(clean(title)), style=_STYLE).replace('content="light dark"', 'content="light"'),
            f"<h1>{escape(clean(title))}</h1><p>{escape(clean(subtitle))} · {hint}</p>",
            '<div id="plot"></div>',
            f'<script type="application/json" id="data">{data}</script>',
            f"<script>{get_plotlyjs()}</script>",
            f"<script>{_SCRIPT}</script>",
            FOOT,
        ]
    )


def courses_figure(plots: Sequence[Courses]) -> dict[str, Any]:
    """Return the plots as a plotly figure: one time axis, a value axis each, every name made inert."""
    count = max(1, sum(len(plot.courses) for plot in plots))
    limit = min(MOST_PAGE_SAMPLES, max(1000, PAGE_SAMPLES // count))
    legends = [rows_of_legend(*plot.title(), 150) for plot in plots]
    heights = [_PANEL_PX if not plot.names else max(44, min(400, 24 * len(plot.names))) for plot in plots]
    total = sum(heights) + sum(_LINE_PX * len(rows) + 8 + _GAP_PX for rows in legends)
    axis = {"zeroline": False, "ticks": "outside", "ticklen": 4, "gridcolor": _GRID, "linecolor": _RULE}
    axis |= {"tickcolor": _RULE, "automargin": True}
    layout: dict[str, Any] = {
        "height": total + _BOTTOM_PX + _TOP_PX,
        "margin": {"l": 70, "r": 16, "t": _TOP_PX, "b": _BOTTOM_PX},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "font": {"size": 12, "color": _SOFT},
        "showlegend": False,
        "hovermode": "x unified",
        "hoversubplots": "axis",
        "dragmode": "zoom",
        "annotations": [],
        "xaxis": axis | {"range": list(span(plots)), "title": {"text": "time in s"}, "hoverformat": ".4f"},
    }
    data: list[dict[str, Any]] = []
    top = float(total)
    for number, (plot, rows, height) in enumerate(zip(plots, legends, heights, strict=True), 1):
        top -= _LINE_PX * len(rows) + 8
        key = "" if number == 1 else str(number)
        own: dict[str, Any] = {"domain": [max(0.0, (top - height) / total), top / total], "anchor": "x", "nticks": 6}
        if plot.names:
            texts = [inert(text) for text in ticks(plot.names)]
            own |= {"tickvals": list(range(len(texts))), "ticktext": texts}
        elif plot.unit:
            own["title"] = {"text": inert(plot.unit)}
        limits = value_range(plot)
        if limits is not None:
            own["range"] = list(limits)
        layout[f"yaxis{key}"] = axis | own
        data += [_trace(plot, k, course, f"y{key}", limit) for k, course in enumerate(plot.courses)]
        layout["annotations"].append(
            {
                "text": _legend_text(plot, rows),
                "x": 0,
                "y": top / total,
                "xref": "paper",
                "yref": "paper",
                "xanchor": "left",
                "yanchor": "bottom",
                "align": "left",
                "showarrow": False,
                "font": {"size": 12.5, "color": INK},
            }
        )
        top -= height + _GAP_PX
    layout["xaxis"]["anchor"] = f"y{'' if len(plots) < 2 else len(plots)}"
    return {"data": data, "layout": layout}


def _trace(plot: Courses, k: int, course: Course, axis: str, limit: int) -> dict[str, Any]:
    t_s, y = less(course, limit)
    unit = f" {inert(plot.unit)}" if plot.unit else ""
    trace: dict[str, Any] = {
        "type": "scattergl" if len(t_s) > 5000 else "scatter",
        "mode": "lines+markers" if lonely(y).any() else "lines",
        "marker": {"size": 3},
        "name": inert(course.name),
        "x": np.round(t_s, 6).tolist(),
        "y": numbers(y),
        "yaxis": axis,
        "line": {"color": SERIES[k % len(SERIES)], "width": 1.5, "shape": "hv" if course.steps else "linear"},
        "hovertemplate": f"{inert(course.name)}  %{{y:.6~g}}{unit}<extra></extra>",
    }
    if plot.names:
        texts = [inert(name) for name in plot.names]
        trace["customdata"] = [texts[int(value)] if value == value else "" for value in y.tolist()]
        trace["hovertemplate"] = f"{inert(course.name)}  %{{customdata}}<extra></extra>"
    return trace


def _legend_text(plot: Courses, rows: list[list[int]]) -> str:
    head, names = plot.title()
    lines = []
    for line, row in enumerate(rows):
        parts = [f"<b>{inert(head)}</b>"] if head and not line else []
        for k in row:
            colour = SERIES[k % len(SERIES)] if len(names) > 1 else INK
            parts.append(f'<span style="color:{colour}">{inert(names[k])}</span>')
        lines.append("   ".join(parts))
    return "<br>".join(lines)
