"""The confusion matrix as a figure: what was hidden by row, what was named first by column."""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from hil.report.palette import INK, NEUTRAL, SEVERITY_COLOURS
from hil.validation.blind_trials.metrics import Record
from hil.validation.doc_pages.effects_page import SUBSYSTEMS
from plant.injection.theta import THETA

NONE = "none"
_PLACES = {effect.name: ([*SUBSYSTEMS].index(effect.subsystem), effect.row) for effect in THETA.effects}
_TITLES = {effect.name: SUBSYSTEMS[effect.subsystem] for effect in THETA.effects}
_OTHER = "In no list"
_RULE = "#9AA3AC"
_RIGHT, _WRONG = (
    LinearSegmentedColormap.from_list(name, ("#FFFFFF", SEVERITY_COLOURS[name])) for name in ("ok", "error")
)
_CELL = 0.185  # in
_LEFT, _TOP, _EDGE = 1.85, 1.95, 0.3  # in: names and parts of rows, title and names of columns, page edge


def draw(records: Sequence[Record], path: Path, least: float = 8.0) -> bool:
    """Write the figure as PNG; False, and no figure, where no record tells.

    Parameters
    ----------
    records : of the family of single causes; those below ``least`` signal-to-noise are left out.
    """
    shown = [r for r in records if len(r["hidden"]) == 1 and r["reached"] and (r["size"] or 0.0) >= least]
    if not shown:
        return False
    counts = Counter((r["hidden"][0]["effect"], r["named"][0] if r["named"] else NONE) for r in shown)
    rows = _ordered(hidden for hidden, _ in counts)
    columns = [*_ordered(named for _, named in counts if named != NONE), NONE]
    wide, tall = _CELL * len(columns), _CELL * len(rows)
    width, height = max(_LEFT + wide + 1.0, 7.5), _TOP + tall + _EDGE
    figure = Figure(figsize=(width, height), dpi=120, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((_LEFT / width, _EDGE / height, wide / width, tall / height))
    _cells(axes, counts, rows, columns)
    _labels(axes, rows, columns)
    _titles(figure, shown, width, height, least)
    figure.savefig(path)
    return True


def _ordered(names: Iterable[str]) -> list[str]:
    """Once each, by subsystem and row of the catalogue; what is in no list comes last."""
    return sorted(set(names), key=lambda name: (_PLACES.get(name, (len(SUBSYSTEMS), 0)), name))


def _cells(axes: Axes, counts: Counter[tuple[str, str]], rows: list[str], columns: list[str]) -> None:
    """Number of cases in each cell, its shade by their share of the row: right ones blue, wrong ones red."""
    for i, hidden in enumerate(rows):
        total = sum(counts[hidden, named] for named in columns)
        for j, named in enumerate(columns):
            number, corner = counts[hidden, named], (j - 0.5, i - 0.5)
            if hidden == named:
                axes.add_patch(Rectangle(corner, 1.0, 1.0, fill=False, edgecolor=INK, linewidth=0.7, zorder=3))
            if not number:
                continue
            part = number / total
            colours = _RIGHT if hidden == named else _WRONG
            colour = (*(3 * (1.0 - 0.55 * part,)), 1.0) if named == NONE else colours(0.25 + 0.75 * part)
            axes.add_patch(Rectangle(corner, 1.0, 1.0, facecolor=colour, linewidth=0))
            ink = "white" if part > 0.6 else INK
            axes.text(j, i + 0.03, str(number), fontsize=6.5, color=ink, ha="center", va="center", zorder=4)


def _labels(axes: Axes, rows: list[str], columns: list[str]) -> None:
    axes.set_xlim(-0.5, len(columns) - 0.5)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_yticks(range(len(rows)), rows, fontsize=7, color=INK)
    axes.set_xticks(range(len(columns)), columns, rotation=60, ha="left", rotation_mode="anchor", fontsize=7, color=INK)
    axes.xaxis.tick_top()
    axes.set_xticks(np.arange(-0.5, len(columns)), minor=True)
    axes.set_yticks(np.arange(-0.5, len(rows)), minor=True)
    axes.grid(which="minor", color="#ECEFF2", linewidth=0.5)
    axes.tick_params(which="both", length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    for start, end, part in _blocks(rows):
        axes.axhline(end - 0.5, color=_RULE, linewidth=0.7)
        axes.text(
            -0.5 - 1.55 / _CELL, (start + end - 1) / 2, "\n".join(_lines(part, (end - start) * _CELL)), rotation=90,
            ha="center", va="center", fontsize=7, color=NEUTRAL, linespacing=1.05,
        )  # fmt: skip
    for _, end, _ in _blocks(columns):
        axes.axvline(end - 0.5, color=_RULE, linewidth=0.7)


def _blocks(names: list[str]) -> list[tuple[int, int, str]]:
    """First, one after the last, and title of each part of the catalogue that occurs."""
    parts = ["" if name == NONE else _TITLES.get(name, _OTHER) for name in names]
    starts = [k for k in range(len(parts)) if k == 0 or parts[k] != parts[k - 1]]
    return [(a, b, parts[a]) for a, b in zip(starts, [*starts[1:], len(parts)], strict=True)]


def _lines(part: str, room_in: float) -> list[str]:
    """The title on as many lines as its block is short."""
    words, lines = part.split(), [""]
    for word in words:
        if lines[-1] and 0.062 * (len(lines[-1]) + 1 + len(word)) > max(room_in, 0.5):
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def _titles(figure: Figure, shown: Sequence[Record], width: float, height: float, least: float) -> None:
    right = sum(bool(r["named"]) and r["named"][0] == r["hidden"][0]["effect"] for r in shown)
    none = sum(not r["named"] for r in shown)
    wrong = len(shown) - right - none
    figure.text(0.25 / width, 1.0 - 0.3 / height, "Hidden and named", fontsize=11, color=INK, weight="bold")
    lines = (
        f"Row: the effect that was hidden, at signal-to-noise {least:g} and more. Column: the first one named.",
        f"{len(shown)} cases: {right} right, {none} with none named, {wrong} with a wrong one first.",
    )
    for k, line in enumerate(lines):
        figure.text(0.25 / width, 1.0 - (0.52 + 0.17 * k) / height, line, fontsize=8, color=NEUTRAL)
