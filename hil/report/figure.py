"""A report as one picture (PNG, SVG or PDF by the file's suffix): verdict, numbers, timeline, panels and charts.

Tables and what was run are left to the page. The picture is drawn with matplotlib's objects alone: no global state.
"""

import math
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.report.figure_head import EDGE_IN, SOFT, WIDTH_IN, head_height, write, write_head
from hil.report.palette import INK, SEVERITY_COLOURS, Stroke, strokes
from hil.report.pictures import can_draw
from hil.report.report import Chart, Curve, Event, Floats, Lane, Panel, Report, Section, Span
from hil.report.units import Unit, shown, symbol
from hil.report.words import clean

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEFT, _GAP = 0.55, 0.35  # in: room for tick labels, between columns
_PLOT, _CHART, _LANE, _LINE = 1.25, 2.3, 0.34, 0.19  # in: heights of a plot, a chart, a lane, a line of text
_RULE, _GRID = "#C9D1D9", "#E8ECF0"
_ROW, _LETTER, _MOST_LETTERS = 0.16, 0.062, 36  # in: height of a named row, width of a letter of its name
_DOT = 5.0  # points: marker of a named row
_LETTERS = 74  # of 7 points that the narrowest timeline holds


def write_figure(report: Report, path: Path, dpi: int = 130) -> bool:
    """Draw the report and write it in the format of ``path``'s suffix; False without matplotlib, and no file."""
    if not can_draw():
        return False
    with warnings.catch_warnings():
        # a sign that the font lacks is drawn as a box, which is what a reader should see of it
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        draw(report).savefig(path, dpi=dpi, facecolor="white", metadata={"Title": clean(report.title)})
    return True


class _Cell:
    """One field of the grid: its height without legend, its strokes' names, how to fill it; room on the left, in."""

    def __init__(
        self, title: str, names: Sequence[str], height: float, fill: Callable[["Axes"], None], beside: float = 0.0
    ) -> None:
        self.title, self.names, self.height, self.fill, self.beside = title, names, height, fill, beside

    def legend_columns(self, width: float) -> int:
        """Return the most legend columns that fit a field of ``width`` in."""
        width -= self.beside
        widths = [0.056 * len(name) + 0.4 for name in self.names]
        for columns in range(len(widths), 1, -1):
            if sum(max(widths[i::columns]) for i in range(columns)) <= width:
                return columns
        return 1

    def head(self, width: float) -> float:
        """Return the height of title and legend, in."""
        rows = math.ceil(len(self.names) / self.legend_columns(width)) if len(self.names) > 1 else 0
        return 0.24 + 0.155 * rows


def draw(report: Report) -> "Figure":
    """Return the report as a matplotlib figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    blocks = [(section, _cells(section)) for section in report.sections]
    columns = 2 if max((len(cells) for _, cells in blocks), default=0) > 3 else 1
    inner = WIDTH_IN - 2 * EDGE_IN
    width = (inner - (columns - 1) * _GAP) / columns - _LEFT
    grids = [[cells[i : i + columns] for i in range(0, len(cells), columns)] for _, cells in blocks]
    height = 2 * EDGE_IN + head_height(report)
    height += sum(0.5 + sum(_row_height(row, width) for row in grid) for grid in grids if grid)

    figure = Figure(figsize=(WIDTH_IN, height))
    FigureCanvasAgg(figure)
    top = write_head(figure, report, height)
    for (section, _), grid in zip(blocks, grids, strict=True):
        if not grid:
            continue
        top -= 0.28
        write(figure, EDGE_IN, top, clean(section.title), size=12, weight="bold")
        top -= 0.22
        for row in grid:
            head, tall = max(cell.head(width) for cell in row), max(cell.height for cell in row)
            for column, cell in enumerate(row):
                left = EDGE_IN + _LEFT + column * (width + _LEFT + _GAP) + cell.beside
                bottom, wide = top - head - tall, width - cell.beside
                axes = figure.add_axes((left / WIDTH_IN, bottom / height, wide / WIDTH_IN, tall / height))
                _prepare(axes)
                cell.fill(axes)
                _legend(axes, cell, width, tall)
            top -= _row_height(row, width)
    return figure


def _row_height(row: Sequence[_Cell], width: float) -> float:
    return max(cell.head(width) for cell in row) + max(cell.height for cell in row) + 0.42


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 1] + "…"


def _cells(section: Section) -> list[_Cell]:
    span = section.time_range_s()
    cells = []
    if span is not None:
        span = span if span[1] > span[0] else (span[0] - 0.5, span[1] + 0.5)
        if section.timeline:
            rows = section.rows()
            height = max(_PLOT, _LANE * len(rows))
            cells.append(_Cell("Timeline", (), height, lambda axes: _fill_timeline(axes, rows, span)))
        for panel in section.panels:
            names = [clean(trace.name) for trace in panel.traces]
            cells.append(
                _Cell(_titled(panel.title, panel.unit), names, _PLOT, _panel_filler(panel, section.timeline, span))
            )
    for chart in section.charts:
        names = [clean(curve.name) for curve in chart.curves]
        height = max(_CHART, _ROW * len(chart.rows))
        beside = max((_LETTER * min(len(row), _MOST_LETTERS) for row in chart.rows), default=_LEFT) - _LEFT
        fill = _row_filler(chart) if chart.rows else _chart_filler(chart)
        cells.append(_Cell(clean(chart.title), names, height, fill, max(beside, 0.0)))
    return cells


def _titled(title: str, unit: Unit) -> str:
    return f"{clean(title)}  [{clean(symbol(unit))}]" if symbol(unit) else clean(title)


def _prepare(axes: "Axes") -> None:
    axes.grid(True, color=_GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.locator_params(axis="y", nbins=5)
    axes.tick_params(labelsize=7.5, colors=SOFT, length=3, width=0.8)
    for name, spine in axes.spines.items():
        spine.set_visible(name in {"left", "bottom"})
        spine.set_color(_RULE)


def _legend(axes: "Axes", cell: _Cell, width: float, tall: float) -> None:
    """Write the cell's title and, where it has more than one trace, its legend between title and plot."""
    top = 1.0 + (cell.head(width) - 0.13) / tall
    axes.text(
        0.0,
        top,
        cell.title,
        transform=axes.transAxes,
        fontsize=9,
        weight="bold",
        color=INK,
        va="center",
        parse_math=False,
    )
    if len(cell.names) < 2:
        return
    columns = cell.legend_columns(width)
    rows = math.ceil(len(cell.names) / columns)
    order = [row * columns + column for column in range(columns) for row in range(rows)]  # matplotlib fills downwards
    handles = axes.lines[: len(cell.names)]
    order = [i for i in order if i < len(handles)]
    legend = axes.legend(
        [handles[i] for i in order],
        ["-"] * len(order),
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        frameon=False,
        fontsize=7.5,
        handlelength=1.8,
        columnspacing=1.2,
        borderpad=0.15,
        borderaxespad=0.1,
        handletextpad=0.5,
        labelspacing=0.25,
    )
    for text, i in zip(legend.get_texts(), order, strict=True):  # set late: a leading "_" would hide the entry
        text.set_parse_math(False)
        text.set_text(cell.names[i])
        text.set_color(INK)


def _panel_filler(panel: Panel, timeline: Sequence[Lane], span: tuple[float, float]) -> Callable[["Axes"], None]:
    def fill(axes: "Axes") -> None:
        for trace, stroke in zip(panel.traces, strokes(panel.traces), strict=True):
            _stroke(axes, trace.t_s, shown(trace.y, panel.unit), stroke)
        axes.set_xlim(*span)
        if panel.names:
            axes.set_yticks(range(len(panel.names)), [_cut(clean(name), _MOST_LETTERS) for name in panel.names])
            for label in axes.get_yticklabels():
                label.set_parse_math(False)
        for t_s, colour in _marks(timeline):
            axes.axvline(t_s, color=colour, linewidth=0.8, alpha=0.55, zorder=0.5)
        axes.set_xlabel("Time in s", fontsize=7.5, color=SOFT, labelpad=1)

    return fill


def _marks(timeline: Sequence[Lane]) -> list[tuple[float, str]]:
    """Return when a bad state began, and its colour: worth a line through every panel."""
    spans = [span for lane in timeline for span in lane.spans if span.severity in {"warning", "error"}]
    return [(span.start_s, SEVERITY_COLOURS[span.severity]) for span in spans]


def _stroke(axes: "Axes", x: Floats, y: Floats, stroke: Stroke, size: float = 3.0) -> None:
    width = stroke.width * 0.8
    dash = (0.0, tuple(length / 1.6 for length in stroke.dash)) if stroke.dash else "solid"
    if stroke.points:
        axes.plot(
            x, y, linestyle="none", marker="o", markersize=size, color=stroke.colour, alpha=0.75, markeredgewidth=0
        )
    else:
        drawstyle = "steps-post" if stroke.steps else "default"
        axes.plot(x, y, color=stroke.colour, linewidth=width, linestyle=dash, drawstyle=drawstyle)


def _fill_timeline(axes: "Axes", rows: Sequence[Lane], span: tuple[float, float]) -> None:
    for place, row in enumerate(rows):
        axes.text(span[0], place - 0.43, clean(row.name), fontsize=7, color=SOFT, va="center", parse_math=False)
        for part in row.spans:
            _draw_span(axes, part, place, span)
        _draw_events(axes, row.events, place, span)
    axes.grid(False)
    axes.set_xlim(*span)
    axes.set_ylim(len(rows) - 0.5, -0.62)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.set_xlabel("Time in s", fontsize=7.5, color=SOFT, labelpad=1)


def _draw_events(axes: "Axes", events: Sequence[Event], row: int, span: tuple[float, float]) -> None:
    events = sorted(events, key=lambda event: event.t_s)
    ends = [*(event.t_s for event in events[1:]), span[1]]
    for event, end in zip(events, ends, strict=False):
        axes.plot([event.t_s], [row + 0.05], marker="D", markersize=4, color=SEVERITY_COLOURS[event.severity])
        fits = int((end - event.t_s) / (span[1] - span[0]) * _LETTERS) - 3
        if fits >= min(len(event.label), 8):
            _write_in(axes, event.t_s + 0.012 * (span[1] - span[0]), row + 0.06, _cut(clean(event.label), fits))


def _draw_span(axes: "Axes", part: Span, row: int, span: tuple[float, float]) -> None:
    colour = SEVERITY_COLOURS[part.severity]
    length = part.end_s - part.start_s
    axes.broken_barh([(part.start_s, length)], (row - 0.2, 0.5), facecolor=colour, alpha=0.22, linewidth=0)
    axes.plot([part.start_s] * 2, [row - 0.2, row + 0.3], color=colour, linewidth=1.8, solid_capstyle="butt")
    fits = int(length / (span[1] - span[0]) * _LETTERS) - 1
    if fits >= min(len(part.label), 4):
        _write_in(axes, part.start_s + 0.01 * (span[1] - span[0]), row + 0.06, _cut(clean(part.label), fits))


def _write_in(axes: "Axes", t_s: float, y: float, text: str) -> None:
    axes.text(t_s, y, text, fontsize=7, color=INK, va="center", clip_on=True, parse_math=False)


def _chart_filler(chart: Chart) -> Callable[["Axes"], None]:
    def fill(axes: "Axes") -> None:
        drawn = strokes(chart.curves)
        for curve, stroke in zip(chart.curves, drawn, strict=True):
            _stroke(axes, shown(curve.x, chart.x_unit), shown(curve.y, chart.y_unit), stroke)
        for curve, stroke in zip(chart.curves, drawn, strict=True):  # after the lines, which the legend counts
            _interval(axes, chart, curve, stroke)
        axes.set_xlabel(_titled(chart.x_label, chart.x_unit), fontsize=7.5, color=SOFT, labelpad=1, parse_math=False)
        axes.set_ylabel(_titled(chart.y_label, chart.y_unit), fontsize=7.5, color=SOFT, labelpad=2, parse_math=False)

    return fill


def _row_filler(chart: Chart) -> Callable[["Axes"], None]:
    def fill(axes: "Axes") -> None:
        for curve, stroke in zip(chart.curves, strokes(chart.curves), strict=True):
            _stroke(axes, shown(curve.y, chart.y_unit), curve.x, stroke, _DOT)
            if curve.low is not None and curve.high is not None:
                low, high = shown(curve.low, chart.y_unit), shown(curve.high, chart.y_unit)
                axes.hlines(curve.x, low, high, color=stroke.colour, linewidth=1.0)
        places = np.arange(1, len(chart.rows) + 1)
        axes.set_yticks(places, [_cut(clean(row), _MOST_LETTERS) for row in chart.rows])
        for label in axes.get_yticklabels():
            label.set_parse_math(False)
        axes.set_ylim(len(chart.rows) + 0.6, 0.4)
        axes.set_xlabel(_titled(chart.y_label, chart.y_unit), fontsize=7.5, color=SOFT, labelpad=1, parse_math=False)

    return fill


def _interval(axes: "Axes", chart: Chart, curve: Curve, stroke: Stroke) -> None:
    if curve.low is None or curve.high is None:
        return
    x, low, high = shown(curve.x, chart.x_unit), shown(curve.low, chart.y_unit), shown(curve.high, chart.y_unit)
    if stroke.points:
        axes.vlines(x, low, high, color=stroke.colour, linewidth=1.0)
    else:
        axes.fill_between(x, low, high, color=stroke.colour, alpha=0.18, linewidth=0)
