"""A report as one HTML file that needs no network: plots that zoom together, numbers, and what was run."""

import re
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from pathlib import Path

from hil.report.page import FOOT, HEAD, scripts, style
from hil.report.palette import INK, Stroke, strokes
from hil.report.plots import Pool, chart_figure, height_px, panel_figure
from hil.report.report import Cell, Chart, Curve, Lane, Number, Panel, Report, Section, Table, Trace
from hil.report.thin import samples_per_trace
from hil.report.units import symbol
from hil.report.words import clean, number_text, outline, value_text

_ONE_LINE = 20  # letters of a cell that are never broken: numbers with unit or interval, names
_TABLES_OPEN = 4  # of a section; more are folded
_PAIR = re.compile(r"\d (?:(?:to|±|/|of) (?=[-+]?\d)|(?=%))")  # stays on one line: 0.2 to 0.3, 5 ± 1, 1 / 596, 18 %
_NUMBERS = re.compile(r"(?:[-+−]?[\d.]+(?:e[-+]?\d+)?(?:/[-+−]?[\d.]+|/never)?|never|–)?")
_JOINT = re.compile(r"(?<=\w)[._](?=\w)")
_VERDICT_MARKS = {"passed": "✓", "failed": "✗", "inconclusive": "?", "incomplete": "!", "broken": "✗"}


def write_html(report: Report, path: Path) -> None:
    """Write `render_html` to ``path``."""
    path.write_text(render_html(report), encoding="utf-8")


def render_html(report: Report) -> str:
    """Return the report as one HTML document with all that it needs in it; nothing is loaded from elsewhere."""
    pool = Pool(samples_per_trace(report))
    body = [_header(report), *(_section(section, pool) for section in report.sections)]
    if report.provenance:
        body.append(_provenance(report))
    if pool.thinned:
        body.append(_thinned(pool))
    uplot, own = scripts()
    data = f'<script type="text/plain" id="data">{pool.packed()}</script>'
    head = HEAD.format(title=_text(report.title), style=style())
    parts = [uplot, own] if pool.figures else [own]
    return "\n".join([head, *body, data, *(f"<script>{part}</script>" for part in parts), FOOT])


def _text(text: str) -> str:
    return escape(clean(text))


def _header(report: Report) -> str:
    verdict = ""
    if report.verdict is not None:
        verdict = f'<span class="badge {report.verdict}">{_VERDICT_MARKS[report.verdict]} {report.verdict}</span>'
    reason = f"<p>{verdict} {_prose(report.reason)}</p>" if verdict or report.reason else ""
    cards = "".join(_card(number) for number in report.numbers)
    return f'<header><h1>{_text(report.title)}</h1>{reason}</header>\n<dl class="cards">{cards}</dl>'


def _card(number: Number) -> str:
    value, unit = (escape(part) for part in number_text(number))
    state = "" if number.met is None else " met" if number.met else " missed"
    mark = "" if number.met is None else "✓ " if number.met else "✗ "
    limit = f'<dd class="limit">{mark}{_text(number.limit)} {unit}</dd>' if number.limit or mark else ""
    note = f'<dd class="note">{_prose(number.note)}</dd>' if number.note else ""
    state += " long" if len(value) > 12 else ""
    shown = f'<dd class="value">{value} <small>{unit}</small></dd>'
    return f'<div class="card{state}"><dt>{_text(number.label)}</dt>{shown}{limit}{note}</div>'


def _section(section: Section, pool: Pool) -> str:
    parts = [f"<section><h2>{_text(section.title)}</h2>"]
    if section.text:
        parts.append(f"<p>{_prose(section.text)}</p>")
    span = section.time_range_s()
    if span is not None:
        start, end = span if span[1] > span[0] else (span[0] - 0.5, span[1] + 0.5)
        parts.append(f'<div class="linked" data-start="{start!r}" data-end="{end!r}">{_TOOLS}')
        if section.timeline:
            lanes = "".join(_lane(lane, start, end) for lane in section.rows())
            parts.append(f'<div class="timeline">{lanes}<div class="cursor"></div></div>')
        parts += [_panel(panel, (start, end), pool) for panel in section.panels]
        parts.append(f'<p class="axis">Time in s</p>{_happenings(section)}</div>')
    if section.charts:
        charts = "".join(_chart(chart, pool) for chart in section.charts)
        parts.append(f'<div class="charts">{charts}</div>')
    folded = len(section.tables) > _TABLES_OPEN
    parts += [_folded(table) if folded else _table(table) for table in section.tables]
    return "\n".join([*parts, "</section>"])


_TOOLS = """<div class="tools"><output class="window"></output><output class="at"></output>\
<span class="hint">drag to zoom all, shift-drag to pan, double-click for all</span><span class="buttons">\
<button data-do="left" title="Earlier">◀</button><button data-do="in" title="Zoom in">+</button>\
<button data-do="out" title="Zoom out">−</button><button data-do="right" title="Later">▶</button>\
<button data-do="all" title="Whole time">All</button></span></div>"""


def _lane(lane: Lane, start: float, end: float) -> str:
    length = end - start
    marks = []
    for span in lane.spans:
        place = f"left:{(span.start_s - start) / length:.4%};width:{(span.end_s - span.start_s) / length:.4%}"
        tip = f"{_text(span.label)}: {span.start_s:.3f} to {span.end_s:.3f} s"
        marks.append(
            f'<span class="span {span.severity}" data-start="{span.start_s!r}" data-end="{span.end_s!r}" '
            f'style="{place}" title="{tip}"><b>{_text(span.label)}</b></span>'
        )
    for event in sorted(lane.events, key=lambda event: event.t_s):
        marks.append(
            f'<span class="event {event.severity}" data-start="{event.t_s!r}" '
            f'style="left:{(event.t_s - start) / length:.4%}" title="{_text(event.label)}: {event.t_s:.3f} s">'
            f"<i></i><b>{_text(event.label)}</b></span>"
        )
    head = f"<h4>{_text(lane.name)}</h4>" if lane.name else ""
    return f'<div class="lane">{head}<div class="bar">{"".join(marks)}</div></div>'


def _happenings(section: Section) -> str:
    rows = section.happenings()
    if not rows:
        return ""
    cells = "".join(
        f"<tr><td class=n>{span.start_s:.3f}</td>"
        f"<td class=n>{f'{span.end_s:.3f}' if span.end_s > span.start_s else ''}</td><td>{_text(lane)}</td>"
        f'<td><i class="dot {span.severity}"></i>{_text(span.label)}</td></tr>'
        for lane, span in rows
    )
    heads = "<th class=n>from, s</th><th class=n>to, s</th><th>lane</th><th>what</th>"
    return (
        f"<details><summary>Timeline as a table ({len(rows)})</summary>"
        f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>{cells}</tbody></table></div></details>'
    )


def _panel(panel: Panel, span: tuple[float, float], pool: Pool) -> str:
    pool.figures.append(panel_figure(panel, span, pool))
    unit = f" <small>{_text(symbol(panel.unit))}</small>" if symbol(panel.unit) else ""
    return _plot(f"{_text(panel.title)}{unit}", panel.traces, pool, "panel", len(panel.names))


def _chart(chart: Chart, pool: Pool) -> str:
    pool.figures.append(chart_figure(chart, pool))
    return _plot(_text(chart.title), chart.curves, pool, "chart", len(chart.rows))


def _plot(head: str, traces: Sequence[Trace | Curve], pool: Pool, kind: str, names: int) -> str:
    chips = "".join(_chip(trace, stroke) for trace, stroke in zip(traces, strokes(traces), strict=True))
    height = f' style="height:{height_px(names)}px"' if names else ""
    return (
        f'<figure class="{kind}"><figcaption><h3>{head}</h3>{chips}</figcaption><div class="holder">'
        f'<div class="plot" data-figure="{len(pool.figures) - 1}"{height}></div><div class="cursor"></div></div>'
        "</figure>"
    )


def _chip(trace: Trace | Curve, stroke: Stroke) -> str:
    dash = f' stroke-dasharray="{" ".join(f"{d:g}" for d in stroke.dash)}"' if stroke.dash else ""
    colour = "currentColor" if stroke.colour == INK else stroke.colour
    line = f'<line x1="0" y1="5" x2="20" y2="5" stroke="{colour}" stroke-width="{stroke.width + 0.8:g}"{dash}/>'
    sample = f'<circle cx="10" cy="5" r="3.5" fill="{colour}"/>' if stroke.points else line
    return (
        f'<button class="chip" aria-pressed="true" title="Show or hide">'
        f'<svg width="20" height="10" aria-hidden="true">{sample}</svg>{_text(trace.name)}<output></output></button>'
    )


def _folded(table: Table) -> str:
    head = f"<summary>{_text(table.title)} ({len(table.rows)} rows)</summary>"
    return f"<details>{head}{_table(replace(table, title=''))}</details>"


def _table(table: Table) -> str:
    title = f"<h3>{_text(table.title)}</h3>" if table.title else ""
    right = [all(_is_number(row[i]) for row in table.rows) and bool(table.rows) for i in range(len(table.columns))]
    heads = "".join(f"<th{' class=n' if r else ''}>{_text(h)}</th>" for r, h in zip(right, table.columns, strict=True))
    rows = "".join(
        "<tr>" + "".join(_cell(*cell) for cell in zip(row, right, range(len(row)), strict=True)) + "</tr>"
        for row in table.rows
    )
    note = f'<p class="note">{_text(table.note)}</p>' if table.note else ""
    body = f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>"
    return f'<div class="table">{title}<div class="scroll" tabindex="0">{body}</div>{note}</div>'


def _is_number(cell: Cell) -> bool:
    """Whether a cell holds a number, several beside each other (35/90), or nothing in a column of such."""
    return _NUMBERS.fullmatch(cell) is not None if isinstance(cell, str) else not isinstance(cell, bool)


def _cell(cell: Cell, right: bool, column: int) -> str:
    text = value_text(cell)
    text = symbol(text) if text.startswith("m/s") else text
    kind = "n" if right else "s" if len(text) <= _ONE_LINE else "t"
    shown = _PAIR.sub(_together, escape(text))
    if column == 0 and kind == "t":  # a long name breaks at its joints where the page is narrow
        shown = _JOINT.sub(r"\g<0><wbr>", shown)
    return f"<td class={kind}>{shown}</td>"


def _prose(text: str) -> str:
    return _PAIR.sub(_together, _text(text))


def _together(pair: re.Match[str]) -> str:
    return pair[0].replace(" ", "\u00a0")


def _provenance(report: Report) -> str:
    rows = "".join(
        f'<tr><th style="padding-left:{depth * 1.2:.1f}em">{escape(key)}</th><td>{escape(value)}</td></tr>'
        for depth, key, value in outline(report.provenance)
    )
    table = f'<div class="scroll"><table class="run"><tbody>{rows}</tbody></table></div>'
    return f"<section><details><summary>What was run</summary>{table}</details></section>"


def _thinned(pool: Pool) -> str:
    items = "".join(f"<li>{escape(line)}</li>" for line in pool.thinned)
    text = f"{len(pool.thinned)} traces are drawn with fewer samples; peaks and gaps are kept, the log has all."
    return f"<section><details><summary>{text}</summary><ul>{items}</ul></details></section>"
