"""Signals over one time axis as a picture (PNG, SVG, PDF) or an HTML page without network."""

import json
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hil.report.page import FOOT, HEAD
from hil.report.palette import INK, SERIES
from hil.report.plots import inert, numbers
from hil.report.thin import thinned
from hil.report.words import clean

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

PICTURE_SAMPLES = 8_000  # of one course; a picture is about 1,500 points wide
PAGE_SAMPLES = 240_000  # of all courses together
MOST_PAGE_SAMPLES = 40_000  # of one
_SOFT, _RULE, _GRID = "#57636F", "#C9D1D9", "#E8ECF0"
_WIDTH_IN, _LEFT_IN, _RIGHT_IN, _TOP_IN, _BOTTOM_IN = 12.0, 0.85, 0.2, 0.75, 0.5
_PANEL_IN, _GAP_IN, _LINE_IN = 1.45, 0.12, 0.19
_MOST_NAME = 22  # letters of a name at an axis


@dataclass(frozen=True, eq=False)
class Course:
    """One signal: times that do not decrease (s) and values; NaN leaves a gap. ``steps`` holds each value."""

    name: str
    t_s: NDArray[np.float64]
    y: NDArray[np.float64]
    steps: bool = False


@dataclass(frozen=True, eq=False)
class Courses:
    """Signals that share a plot.

    Attributes
    ----------
    unit : of all of them.
    names : texts at the axis in place of numbers; the values are then 0, 1, ...: indices of these. None for numbers.
    """

    courses: tuple[Course, ...]
    unit: str = ""
    names: tuple[str, ...] | None = None

    def title(self) -> tuple[str, list[str]]:
        """Part that all names begin with (up to the dot), and what is left of each."""
        heads = {course.name.rpartition(".")[0] for course in self.courses}
        if len(heads) == 1 and (head := heads.pop()):
            return head, [course.name[len(head) + 1 :] for course in self.courses]
        return "", [course.name for course in self.courses]


def write_courses(plots: Sequence[Courses], title: str, subtitle: str, path: Path) -> None:
    """Write the plots one below the other; the suffix names the format, .html or one that matplotlib writes."""
    if path.suffix == ".html":
        path.write_text(courses_page(plots, title, subtitle), encoding="utf-8")
    else:
        _write_picture(plots, title, subtitle, path)


def _less(course: Course, limit: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    kept = thinned(course.y, limit)
    return course.t_s[kept], course.y[kept]


def _span(plots: Sequence[Courses]) -> tuple[float, float]:
    ends = [(course.t_s[0], course.t_s[-1]) for plot in plots for course in plot.courses if len(course.t_s)]
    low, high = min((a for a, _ in ends), default=0.0), max((b for _, b in ends), default=1.0)
    return (float(low), float(high)) if high > low else (float(low) - 0.5, float(low) + 0.5)


def _ticks(names: tuple[str, ...]) -> list[str]:
    return [_cut(clean(name)) for name in names]


def _value_range(plot: Courses) -> tuple[float, float] | None:
    """Range of an axis where the values do not give one: names, and values that never change."""
    if plot.names is not None:
        return -0.4, len(plot.names) - 0.6
    finite = [course.y[np.isfinite(course.y)] for course in plot.courses]
    low = min((float(y.min()) for y in finite if y.size), default=0.0)
    high = max((float(y.max()) for y in finite if y.size), default=0.0)
    room = max(1.0, 0.1 * abs(low))
    return (low - room, low + room) if low == high else None


def _cut(text: str) -> str:
    return text if len(text) <= _MOST_NAME else text[: _MOST_NAME - 1] + "…"


def _rows_of_legend(head: str, names: list[str], letters: int) -> list[list[int]]:
    """Which names stand in which line of a legend."""
    rows: list[list[int]] = [[]]
    used = len(head) + 2 if head else 0
    for k, name in enumerate(names):
        if rows[-1] and used + len(name) + 4 > letters:
            rows.append([])
            used = 0
        rows[-1].append(k)
        used += len(name) + 4
    return rows


def _write_picture(plots: Sequence[Courses], title: str, subtitle: str, path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width = _WIDTH_IN - _LEFT_IN - _RIGHT_IN
    left = _LEFT_IN
    if any(plot.names for plot in plots):  # room for the names at the axis
        longest = max(len(text) for plot in plots if plot.names for text in _ticks(plot.names))
        left = max(_LEFT_IN, 0.3 + 0.07 * longest)
        width = _WIDTH_IN - left - _RIGHT_IN
    legends = [_rows_of_legend(*plot.title(), int(width / 0.085)) for plot in plots]
    heights = [_panel_height(plot) for plot in plots]
    total = _TOP_IN + sum(heights) + sum(_LINE_IN * len(rows) + 0.09 + _GAP_IN for rows in legends) + _BOTTOM_IN
    figure = Figure(figsize=(_WIDTH_IN, total))
    FigureCanvasAgg(figure)
    text: dict[str, Any] = {"va": "center", "parse_math": False}
    figure.text(0.3 / _WIDTH_IN, 1 - 0.28 / total, clean(title), fontsize=13, weight="bold", color=INK, **text)
    figure.text(0.3 / _WIDTH_IN, 1 - 0.53 / total, clean(subtitle), fontsize=8.5, color=_SOFT, **text)
    top = total - _TOP_IN
    span = _span(plots)
    shared: Axes | None = None
    for k, (plot, rows, height) in enumerate(zip(plots, legends, heights, strict=True)):
        top -= _LINE_IN * len(rows) + 0.09
        box = (left / _WIDTH_IN, (top - height) / total, width / _WIDTH_IN, height / total)
        axes = figure.add_axes(box, sharex=shared)
        shared = axes if shared is None else shared
        _draw(axes, plot, rows, height)
        axes.set_xlim(*span)
        axes.tick_params(labelbottom=k == len(plots) - 1)
        top -= height + _GAP_IN
    if shared is not None:
        axes.set_xlabel("time in s", fontsize=8.5, color=_SOFT)
    with warnings.catch_warnings():
        # a sign that the font lacks is drawn as a box, which is what a reader should see of it
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        figure.savefig(path, dpi=130, facecolor="white")


def _panel_height(plot: Courses) -> float:
    return _PANEL_IN if not plot.names else max(0.35, min(3.0, 0.2 * len(plot.names)))


def _draw(axes: "Axes", plot: Courses, rows: list[list[int]], height: float) -> None:
    axes.grid(True, color=_GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, colors=_SOFT, length=3, width=0.8)
    for name, spine in axes.spines.items():
        spine.set_visible(name in {"left", "bottom"})
        spine.set_color(_RULE)
    for k, course in enumerate(plot.courses):
        t_s, y = _less(course, PICTURE_SAMPLES)
        style = "steps-post" if course.steps else "default"
        alone = _lonely(y)
        axes.plot(t_s, y, color=SERIES[k % len(SERIES)], linewidth=1.2, drawstyle=style, solid_joinstyle="round")
        if alone.any():
            axes.plot(t_s[alone], y[alone], color=SERIES[k % len(SERIES)], marker=".", linestyle="none", markersize=4)
    if plot.names:
        axes.set_yticks(range(len(plot.names)), _ticks(plot.names))
        for label in axes.get_yticklabels():
            label.set_parse_math(False)
    else:
        axes.locator_params(axis="y", nbins=5)
        axes.ticklabel_format(axis="y", useOffset=False)
        axes.margins(y=0.08)
        axes.set_ylabel(clean(plot.unit), fontsize=8.5, color=_SOFT, parse_math=False)
    limits = _value_range(plot)
    if limits is not None:
        axes.set_ylim(*limits)
    _legend(axes, plot, rows, height)


def _legend(axes: "Axes", plot: Courses, rows: list[list[int]], height: float) -> None:
    from matplotlib.offsetbox import AnchoredOffsetbox, HPacker, TextArea

    head, names = plot.title()
    for line, row in enumerate(rows):
        parts: list[Artist] = [
            TextArea(head, textprops={"size": 9, "weight": "bold", "color": INK, "parse_math": False})
        ]
        parts = parts if head and not line else []
        for k in row:
            colour = SERIES[k % len(SERIES)] if len(names) > 1 else INK
            style = {"size": 9, "color": colour, "parse_math": False}
            parts.append(TextArea(clean(names[k]), textprops=style))
        place = 1 + (0.03 + _LINE_IN * (len(rows) - 1 - line)) / height
        box = HPacker(children=parts, pad=0, sep=9)
        anchored = AnchoredOffsetbox(
            "lower left", child=box, frameon=False, pad=0, borderpad=0,
            bbox_to_anchor=(0, place), bbox_transform=axes.transAxes,
        )  # fmt: skip
        axes.add_artist(anchored)


def _lonely(y: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Samples between two gaps, which no line shows."""
    gap = np.concatenate(([True], np.isnan(y), [True]))
    return ~gap[1:-1] & gap[:-2] & gap[2:]


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
_PANEL_PX, _LINE_PX, _GAP_PX, _BOTTOM_PX = 170, 18, 16, 46


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
    legends = [_rows_of_legend(*plot.title(), 150) for plot in plots]
    heights = [_PANEL_PX if not plot.names else max(44, min(400, 24 * len(plot.names))) for plot in plots]
    total = sum(heights) + sum(_LINE_PX * len(rows) + 8 + _GAP_PX for rows in legends)
    axis = {"zeroline": False, "ticks": "outside", "ticklen": 4, "gridcolor": _GRID, "linecolor": _RULE}
    axis |= {"tickcolor": _RULE, "automargin": True}
    layout: dict[str, Any] = {
        "height": total + _BOTTOM_PX + 10,
        "margin": {"l": 70, "r": 16, "t": 10, "b": _BOTTOM_PX},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "font": {"size": 12, "color": _SOFT},
        "showlegend": False,
        "hovermode": "x unified",
        "hoversubplots": "axis",
        "dragmode": "zoom",
        "annotations": [],
        "xaxis": axis | {"range": list(_span(plots)), "title": {"text": "time in s"}, "hoverformat": ".4f"},
    }
    data: list[dict[str, Any]] = []
    top = float(total)
    for number, (plot, rows, height) in enumerate(zip(plots, legends, heights, strict=True), 1):
        top -= _LINE_PX * len(rows) + 8
        key = "" if number == 1 else str(number)
        own: dict[str, Any] = {"domain": [max(0.0, (top - height) / total), top / total], "anchor": "x", "nticks": 6}
        if plot.names:
            texts = [inert(text) for text in _ticks(plot.names)]
            own |= {"tickvals": list(range(len(texts))), "ticktext": texts}
        elif plot.unit:
            own["title"] = {"text": inert(plot.unit)}
        limits = _value_range(plot)
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
    t_s, y = _less(course, limit)
    unit = f" {inert(plot.unit)}" if plot.unit else ""
    trace: dict[str, Any] = {
        "type": "scattergl" if len(t_s) > 5000 else "scatter",
        "mode": "lines+markers" if _lonely(y).any() else "lines",
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
