"""The head of a report's picture: title, verdict and numbers, none of them cut where there is room for it."""

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hil.report.palette import INK
from hil.report.report import Number, Report
from hil.report.words import clean, number_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.text import Text

WIDTH_IN, EDGE_IN = 11.0, 0.3
SOFT = "#57636F"
_VERDICT_COLOURS = {
    "passed": "#1D7A4F", "failed": "#B3261E", "inconclusive": "#9A6700", "incomplete": "#9A6700", "broken": "#B3261E",
}  # fmt: skip
_COLUMNS, _BETWEEN = 6, 0.15  # of the numbers, each of which takes one to three; in between them
_COLUMN_IN = (WIDTH_IN - 2 * EDGE_IN) / _COLUMNS
_LABEL_PT, _VALUE_PT, _TITLE_PT, _REASON_PT = 7.5, 10.5, 15.0, 10.0


def write_head(figure: "Figure", report: Report, height: float) -> float:
    """Write title, verdict and numbers; return the height left, in."""
    top = height - EDGE_IN
    for line in _lines(report.title, _TITLE_PT, 0.0):
        write(figure, EDGE_IN, top - 0.14, line, size=_TITLE_PT, weight="bold")
        top -= 0.31
    left = _badge_width(report)
    if report.verdict is not None:
        badge = write(figure, EDGE_IN + 0.06, top - 0.14, report.verdict.value, size=9.5, weight="bold", colour="white")
        badge.set_bbox({"boxstyle": "round,pad=0.35", "facecolor": _VERDICT_COLOURS[report.verdict], "linewidth": 0})
    for line in _lines(report.reason, _REASON_PT, left):
        write(figure, EDGE_IN + left, top - 0.14, line, size=_REASON_PT)
        top -= 0.2
    top -= 0.11
    for number, (row, column, columns) in zip(report.numbers, _places(report.numbers), strict=True):
        _number(figure, number, EDGE_IN + column * _COLUMN_IN, top - 0.5 * row, columns * _COLUMN_IN - _BETWEEN)
    return height - EDGE_IN - head_height(report)


def head_height(report: Report) -> float:
    """Return the height of title, verdict and numbers, in."""
    lines = _lines(report.reason, _REASON_PT, _badge_width(report))
    rows = 1 + max((row for row, _, _ in _places(report.numbers)), default=-1)
    return 0.31 * len(_lines(report.title, _TITLE_PT, 0.0)) + 0.2 * len(lines) + 0.11 + 0.5 * rows


def _badge_width(report: Report) -> float:
    return 0.0 if report.verdict is None else 0.085 * len(report.verdict.value) + 0.25


def _places(numbers: Sequence[Number]) -> list[tuple[int, int, int]]:
    """Return row, column and columns of each number: as many as its texts need."""
    places, row, column = [], 0, 0
    for number in numbers:
        needed = max(_wide(clean(number.label), _LABEL_PT), _wide(_value(number), _VALUE_PT)) + _BETWEEN
        columns = max(1, min(3, math.ceil(needed / _COLUMN_IN)))
        if column + columns > _COLUMNS:
            row, column = row + 1, 0
        places.append((row, column, columns))
        column += columns
    return places


def _value(number: Number) -> str:
    limit = f"  ({clean(number.limit)})" if number.limit else ""
    return " ".join(filter(None, number_text(number))) + limit


def _number(figure: "Figure", number: Number, left: float, top: float, room: float) -> None:
    colour = {None: INK, True: _VERDICT_COLOURS["passed"], False: _VERDICT_COLOURS["failed"]}[number.met]
    write(figure, left, top - 0.14, _cut_to(clean(number.label), _LABEL_PT, room), size=_LABEL_PT, colour=SOFT)
    value = _value(number)
    size = _VALUE_PT if _wide(value, _VALUE_PT) <= room else 8.0
    write(figure, left, top - 0.34, _cut_to(value, size, room), size=size, colour=colour)


def _wide(text: str, points: float) -> float:
    """Return about how wide ``text`` becomes in DejaVu Sans, in."""
    ems = sum(0.33 if c in " .,:;|il'" else 0.70 if c.isupper() else 0.62 if ord(c) < 0x2E80 else 1.0 for c in text)
    return ems * points / 72.0


def _cut_to(text: str, points: float, room: float) -> str:
    if _wide(text, points) <= room:
        return text
    while text and _wide(text + "…", points) > room:
        text = text[:-1]
    return text + "…"


def _lines(text: str, points: float, left: float) -> list[str]:
    """Return ``text`` in lines that fit the picture ``left`` of whose edge something stands; one at least."""
    letters = int((WIDTH_IN - 2 * EDGE_IN - left) / _wide("n", points))
    return textwrap.wrap(clean(text), letters, break_on_hyphens=False) or [""]


def write(
    figure: "Figure", x: float, y: float, text: str, size: float, colour: str = INK, weight: str = "normal"
) -> "Text":
    """Write ``text`` at (x, y) inches from the lower left, vertically centred."""
    width, height = figure.get_size_inches()
    place = x / width, y / height
    return figure.text(*place, text, fontsize=size, color=colour, weight=weight, va="center", parse_math=False)
