"""A report in a terminal: verdict, numbers, timeline and traces on one time axis, tables, what was run."""

import os
import shutil
import textwrap
import unicodedata
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TextIO

import numpy as np

from hil.report.report import Cell, Chart, Floats, Lane, Number, Report, Section, Table, Verdict
from hil.report.units import shown, symbol
from hil.report.words import clean, float_text, number_text, outline, value_text

MOST_EVENTS = 40  # of a timeline; the page lists all
_BLOCKS = "▁▂▃▄▅▆▇█"
_ASCII = str.maketrans(dict(zip(_BLOCKS + "─├┤│·–−✓✗…▲", "..::-=##-[]|.--+x~^", strict=True)) | {"≤": "<=", "≥": ">="})
_VERDICT_SGR = {
    Verdict.PASSED: "1;32",
    Verdict.FAILED: "1;31",
    Verdict.INCONCLUSIVE: "1;33",
    Verdict.INCOMPLETE: "1;33",
    Verdict.BROKEN: "1;31",
}

Paint = Callable[[str, str], str]


def print_text(report: Report, stream: TextIO, brief: bool = False) -> None:
    """Print the report, as wide as the terminal, with colour only on one that takes it (NO_COLOR is honoured)."""
    tty = stream.isatty()
    colour = tty and "NO_COLOR" not in os.environ and os.environ.get("TERM") != "dumb"
    width = min(160, shutil.get_terminal_size((100, 24)).columns) if tty else 100
    text = render_text(report, width, colour, brief)
    encoding = stream.encoding or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        text = text.translate(_ASCII).encode(encoding, "replace").decode(encoding)
    stream.write(text)
    stream.flush()


def render_text(report: Report, width: int = 100, colour: bool = False, brief: bool = False) -> str:
    """Return the report as text of at most ``width`` columns (60 or more).

    ``brief`` leaves out the courses of the traces and what was run, so that verdict and numbers stay on the screen.
    """
    width = max(60, width)

    def paint(text: str, sgr: str) -> str:
        return f"\x1b[{sgr}m{text}\x1b[0m" if colour and text else text

    lines = _head(report, width, paint)
    for section in report.sections:
        lines += ["", *_section(section, width, paint, brief)]
    if report.provenance and not brief:
        lines += ["", _rule("What was run", width, paint)]
        for depth, key, value in outline(report.provenance):
            lines += _wrap(f"{'  ' * (depth + 1)}{key}{'  ' if value else ''}{value}", width, 2 * depth + 6)
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _head(report: Report, width: int, paint: Paint) -> list[str]:
    lines = _wrap(clean(report.title), width, 0)
    lines = [paint(line, "1") for line in lines]
    if report.verdict is not None:
        first, *rest = _wrap(f"{report.verdict.upper()}  {clean(report.reason)}", width, 2)
        word = report.verdict.upper()
        lines += [paint(word, _VERDICT_SGR[report.verdict]) + first[len(word) :], *rest]
    elif report.reason:
        lines += _wrap(clean(report.reason), width, 0)
    if report.numbers:
        lines += ["", *_numbers(report, width, paint)]
    return lines


def _numbers(report: Report, width: int, paint: Paint) -> Iterator[str]:
    """Yield one line per number: label, value, unit, limit, whether met, note; a text value runs over the columns."""
    rows = [_number(number) for number in report.numbers]
    values = [row for row, number in zip(rows, report.numbers, strict=True) if not isinstance(number.value, str)]
    label_width = min(max(_columns(row[0]) for row in rows), width // 2)
    widths = [max((_columns(row[i]) for row in values), default=0) for i in range(1, 5)]
    indent = 2 + label_width + sum(w + 2 for w in widths if w) + 2
    for row, number in zip(rows, report.numbers, strict=True):
        label, value, unit, limit, mark, note = row
        tint = "32" if number.met else "1;31"
        if isinstance(number.value, str):
            told = " ".join(filter(None, (value, unit))) + f"  {limit} {mark}".rstrip()
            first, *rest = _wrap(f"  {_fit(label, label_width)}  {told}", width, label_width + 4)
            yield from (first, *rest)
        else:
            cells = (
                _pad(value, widths[0], right=True),
                _pad(unit, widths[1]),
                _pad(limit, widths[2]),
                paint(mark, tint),
            )
            line = f"  {_fit(label, label_width)}" + "".join(f"  {c}" for c, w in zip(cells, widths, strict=True) if w)
            if note and indent + _columns(note) <= width:
                line += "" if mark or not widths[3] else " "
                line, note = f"{line}  {paint(note, '2')}", ""
            yield line
        yield from (paint(line, "2") for line in _wrap(f"      {note}", width, 6) if note)


def _number(number: Number) -> tuple[str, str, str, str, str, str]:
    value, unit = number_text(number)
    mark = "" if number.met is None else "✓" if number.met else "✗"
    return clean(number.label), value, unit, clean(number.limit), mark, clean(number.note)


def _section(section: Section, width: int, paint: Paint, brief: bool) -> Iterator[str]:
    yield _rule(clean(section.title), width, paint)
    if section.text:
        yield from _wrap(clean(section.text), width, 0)
    span = section.time_range_s()
    if span is not None:
        shortened = replace(section, panels=()) if brief else section
        yield from _over_time(shortened, span, width, paint)
    for chart in section.charts:
        yield from ["", *_chart(chart, width)]
    for table in section.tables:
        yield from ["", *_table(table, width, paint)]


def _over_time(section: Section, span: tuple[float, float], width: int, paint: Paint) -> Iterator[str]:
    """Yield lanes and traces, their strips aligned on one time axis at the right."""
    names = [clean(t.name) for p in section.panels for t in p.traces] + [clean(lane.name) for lane in section.timeline]
    name_width = min(max(map(_columns, names), default=8), max(14, width // 4))
    left = name_width + 33
    strip = width - left
    axis = f"{float_text(span[0])} s"
    end = f"{float_text(span[1])} s"
    heads = "".join(f"{word:>10}" for word in ("min", "max", "last")) if section.panels else f"{'':30}"
    yield paint(f"{'':{name_width + 2}}{heads} {axis}{end:>{max(0, strip - len(axis))}}", "2")
    for lane in section.rows():
        yield f"  {_fit(clean(lane.name), left - 3)} {_lane_strip(lane, span, strip)}"
    for panel in section.panels:
        unit = clean(symbol(panel.unit))
        yield from (paint(line, "1") for line in _wrap(clean(panel.title) + (f", {unit}" if unit else ""), width, 4))
        courses = [shown(trace.y, panel.unit) for trace in panel.traces]
        everything = np.concatenate([y[np.isfinite(y)] for y in courses]) if courses else np.empty(0)
        for trace, y in zip(panel.traces, courses, strict=True):
            good = y[np.isfinite(y)]
            stats = (good.min(), good.max(), good[-1]) if good.size else (np.nan,) * 3
            cells = "".join(f"{float_text(float(v)):>10}" for v in stats)
            course = _spark(trace.t_s, y, span, (everything.min(), everything.max()), strip) if good.size else ""
            yield f"  {_fit(clean(trace.name), name_width)}{cells} {course}"
    yield from _happenings(section, width, paint)


def _happenings(section: Section, width: int, paint: Paint) -> Iterator[str]:
    """Yield spans and events in order of time."""
    rows = section.happenings()
    if not rows:
        return
    lane_width = min(24, max(_columns(clean(lane)) for lane, _ in rows))
    yield paint("Timeline", "1")
    for lane, span in rows[:MOST_EVENTS]:
        when = f"{span.start_s:.3f} s" if span.start_s == span.end_s else f"{span.start_s:.3f} – {span.end_s:.3f} s"
        tint = {"warning": "33", "error": "31"}.get(span.severity)
        grade = f" ({span.severity})" if tint else ""
        text = f"  {when:<19}  {_fit(clean(lane), lane_width)}  {clean(span.label)}{grade}"
        yield from (paint(line, tint) if tint else line for line in _wrap(text, width, 6))
    if len(rows) > MOST_EVENTS:
        yield f"  … {len(rows) - MOST_EVENTS} more of {len(rows)}; the HTML report lists all"


def _lane_strip(lane: Lane, span: tuple[float, float], width: int) -> str:
    cells = ["·"] * width
    scale = (width - 1) / (span[1] - span[0]) if span[1] > span[0] else 0.0
    for part in lane.spans:
        a, b = (round((t - span[0]) * scale) for t in (part.start_s, part.end_s))
        inner = b - a - 1
        label = clean(part.label)
        body = label.center(inner, "─") if _columns(label) == len(label) <= inner else "─" * inner
        cells[a : b + 1] = ["├", *body, "┤"] if inner >= 0 else ["│"]
    for event in lane.events:
        cells[round((event.t_s - span[0]) * scale)] = "▲"
    return "".join(cells)


def _spark(t_s: Floats, y: Floats, span: tuple[float, float], scale: tuple[float, float], width: int) -> str:
    """Return the course of ``y`` on the panel's ``scale`` in ``width`` cells; a cell without a sample is blank."""
    good = np.isfinite(y)
    length = span[1] - span[0]
    place = ((t_s[good] - span[0]) / length * width if length else np.zeros(int(good.sum()))).astype(int)
    place = np.minimum(place, width - 1)
    count = np.bincount(place, minlength=width)
    low, high = scale
    level = (y[good] - low) / (high - low) if high > low else np.full(place.size, 0.5)
    mean = np.bincount(place, weights=level, minlength=width) / np.maximum(count, 1)
    return "".join(_BLOCKS[min(7, int(m * 8))] if n else " " for m, n in zip(mean, count, strict=True))


def _chart(chart: Chart, width: int) -> Iterator[str]:
    axes = [(chart.y_label, chart.y_unit), (chart.x_label, chart.x_unit)]
    y_name, x_name = (clean(label) + (f" [{clean(symbol(unit))}]" if symbol(unit) else "") for label, unit in axes)
    if chart.rows:
        yield from _table(_by_row(chart, y_name, x_name), width, lambda text, _: text)
        return
    rows = []
    for curve in chart.curves:
        x, y = shown(curve.x, chart.x_unit), shown(curve.y, chart.y_unit)
        ends = [float(f(v[np.isfinite(v)])) if np.isfinite(v).any() else None for v in (x, y) for f in (np.min, np.max)]
        rows.append((curve.name, int(x.size), *ends))
    heads = ("curve", "points", "x min", "x max", "y min", "y max")
    yield from _table(Table(chart.title, heads, tuple(rows), f"{y_name} over {x_name}"), width, lambda text, _: text)


def _by_row(chart: Chart, y_name: str, x_name: str) -> Table:
    """A chart with named rows: one column a curve."""
    points = [curve for curve in chart.curves if curve.style == "points"]
    at = [dict(zip(curve.x.tolist(), shown(curve.y, chart.y_unit).tolist(), strict=True)) for curve in points]
    rows = [
        (name, *(None if k not in values else float(f"{values[k]:.4g}") for values in at))
        for k, name in enumerate(chart.rows, 1)
    ]
    return Table(chart.title, (x_name, *(curve.name for curve in points)), tuple(rows), y_name)


def _table(table: Table, width: int, paint: Paint) -> Iterator[str]:
    if table.title:
        yield paint(clean(table.title), "1")
    heads = [clean(column) for column in table.columns]
    rows = [[value_text(cell) for cell in row] for row in table.rows]
    right = [all(_is_number(row[i]) for row in table.rows) for i in range(len(heads))]
    widths = [max(map(_columns, column)) for column in zip(heads, *rows, strict=True)]
    if 2 * len(widths) + sum(widths) > width:  # too wide: one cell a line
        for row in rows:
            for head, cell in zip(heads, row, strict=True):
                yield from _wrap(f"  {head}: {cell}", width, 6)
            yield ""
    else:
        yield paint("  " + "  ".join(_pad(h, w, r) for h, w, r in zip(heads, widths, right, strict=True)), "2")
        for row in rows:
            yield "  " + "  ".join(_pad(c, w, r) for c, w, r in zip(row, widths, right, strict=True))
    if table.note:
        yield from (paint(line, "2") for line in _wrap(f"  {clean(table.note)}", width, 2))


def _is_number(cell: Cell) -> bool:
    return cell is None or (isinstance(cell, (int, float, np.number)) and not isinstance(cell, bool))


def _rule(title: str, width: int, paint: Paint) -> str:
    return paint(f"── {title} " + "─" * max(0, width - 4 - _columns(title)), "1")


def _wrap(text: str, width: int, indent: int) -> list[str]:
    lead = text[: len(text) - len(text.lstrip())]
    return textwrap.wrap(text, width, initial_indent="", subsequent_indent=" " * indent, drop_whitespace=True) or [lead]


def _columns(text: str) -> int:
    """Return how many terminal columns ``text`` takes."""
    if text.isascii():
        return len(text)
    wide = sum(unicodedata.east_asian_width(c) in "WF" for c in text)
    return len(text) + wide - sum(unicodedata.combining(c) != 0 for c in text)


def _pad(text: str, width: int, right: bool = False) -> str:
    fill = " " * max(0, width - _columns(text))
    return fill + text if right else text + fill


def _fit(text: str, width: int) -> str:
    """Pad ``text`` to ``width`` columns, or cut it there with an ellipsis."""
    if _columns(text) <= width:
        return _pad(text, width)
    while _columns(text) >= width:
        text = text[:-1]
    return _pad(text + "…", width)
