"""Signals over one time axis as an HTML page without network."""

from collections.abc import Mapping, Sequence

from hil.report.courses import Course, Courses, ticks
from hil.report.html import render_html
from hil.report.report import Panel, Report, Section, Trace


def courses_page(plots: Sequence[Courses], title: str, subtitle: str, provenance: Mapping[str, object]) -> str:
    """Return the plots as one HTML document, drawn as the panels of a report are."""
    section = Section("Signals over time", tuple(_panel(plot) for plot in plots))
    return render_html(Report(title, reason=subtitle, sections=(section,), provenance=provenance))


def _panel(plot: Courses) -> Panel:
    head, names = plot.title()
    traces = tuple(_trace(course, name) for course, name in zip(plot.courses, names, strict=True))
    return Panel(head, plot.unit, traces, tuple(ticks(plot.names or ())))


def _trace(course: Course, name: str) -> Trace:
    return Trace(name, course.t_s, course.y, "steps" if course.steps else "line")
