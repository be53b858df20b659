"""Signals over one time axis as a picture (PNG, SVG, PDF)."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.report.courses import Courses, less, lonely, rows_of_legend, span, ticks, value_range
from hil.report.palette import INK, SERIES
from hil.report.words import clean

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

PICTURE_SAMPLES = 8_000  # of one course; a picture is about 1,500 points wide
_SOFT, _RULE, _GRID = "#57636F", "#C9D1D9", "#E8ECF0"
_WIDTH_IN, _LEFT_IN, _RIGHT_IN, _TOP_IN, _BOTTOM_IN = 12.0, 0.85, 0.2, 0.75, 0.5
_PANEL_IN, _GAP_IN, _LINE_IN = 1.45, 0.12, 0.19


def write_picture(plots: Sequence[Courses], title: str, subtitle: str, path: Path) -> None:
    """Write the plots one below the other; the suffix names the format."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width = _WIDTH_IN - _LEFT_IN - _RIGHT_IN
    left = _LEFT_IN
    if any(plot.names for plot in plots):  # room for the names at the axis
        longest = max(len(text) for plot in plots if plot.names for text in ticks(plot.names))
        left = max(_LEFT_IN, 0.3 + 0.07 * longest)
        width = _WIDTH_IN - left - _RIGHT_IN
    legends = [rows_of_legend(*plot.title(), int(width / 0.085)) for plot in plots]
    heights = [_panel_height(plot) for plot in plots]
    total = _TOP_IN + sum(heights) + sum(_LINE_IN * len(rows) + 0.09 + _GAP_IN for rows in legends) + _BOTTOM_IN
    figure = Figure(figsize=(_WIDTH_IN, total))
    FigureCanvasAgg(figure)
    text: dict[str, Any] = {"va": "center", "parse_math": False}
    figure.text(0.3 / _WIDTH_IN, 1 - 0.28 / total, clean(title), fontsize=13, weight="bold", color=INK, **text)
    figure.text(0.3 / _WIDTH_IN, 1 - 0.53 / total, clean(subtitle), fontsize=8.5, color=_SOFT, **text)
    top = total - _TOP_IN
    limits = span(plots)
    shared: Axes | None = None
    for k, (plot, rows, height) in enumerate(zip(plots, legends, heights, strict=True)):
        top -= _LINE_IN * len(rows) + 0.09
        box = (left / _WIDTH_IN, (top - height) / total, width / _WIDTH_IN, height / total)
        axes = figure.add_axes(box, sharex=shared)
        shared = axes if shared is None else shared
        _draw(axes, plot, rows, height)
        axes.set_xlim(*limits)
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
        t_s, y = less(course, PICTURE_SAMPLES)
        style = "steps-post" if course.steps else "default"
        alone = lonely(y)
        axes.plot(t_s, y, color=SERIES[k % len(SERIES)], linewidth=1.2, drawstyle=style, solid_joinstyle="round")
        if alone.any():
            axes.plot(t_s[alone], y[alone], color=SERIES[k % len(SERIES)], marker=".", linestyle="none", markersize=4)
    if plot.names:
        axes.set_yticks(range(len(plot.names)), ticks(plot.names))
        for label in axes.get_yticklabels():
            label.set_parse_math(False)
    else:
        axes.locator_params(axis="y", nbins=5)
        axes.ticklabel_format(axis="y", useOffset=False)
        axes.margins(y=0.08)
        axes.set_ylabel(clean(plot.unit), fontsize=8.5, color=_SOFT, parse_math=False)
    limits = value_range(plot)
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
