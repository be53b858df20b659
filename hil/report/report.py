"""The report: one value that every command builds and every printer prints.

A report is plain frozen data. Build it where the results are, then hand it to a printer:
`hil.report.text` (terminal), `hil.report.html` (one page without network), `hil.report.figure` (PNG, SVG).

    t_s = np.arange(0.0, 4.0, 0.01)
    speed = Panel("Speed", KMH, (Trace("vehicle", t_s, v_mps), Trace("wheel", t_s, v_fl_mps, group="fl")))
    modes = Lane("ECU mode", spans=(Span(0.0, 0.1, "INIT"), Span(0.1, 4.0, "NORMAL", "ok")))
    report = Report(
        title="Brake stop from 72 km/h",
        verdict=Verdict.PASSED,
        numbers=(Number("Stopping distance", 31.4, "m", limit="≤ 35", met=True),),
        sections=(Section("Braking", panels=(speed,), timeline=(modes,)),),
        provenance={"scenario": "stop72.toml", "seed": 1},
    )
    write_html(report, Path("report.html"))

A unit is either text (the values are in that unit already) or a `Display` of `hil.report.units` (the values are SI and
converted when printed). Wheel colours follow `Trace.group`: ``fl``, ``fr``, ``rl``, ``rr``. Missing samples are NaN.
Names may hold anything a log can hold; the printers escape them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.errors import Verdict as Verdict
from hil.report.units import Unit

Floats = NDArray[np.float64]
Style = Literal["line", "demand", "estimate", "points", "steps", "measured"]
Severity = Literal["info", "ok", "warning", "error"]
Cell = str | float | int | bool | None


@dataclass(frozen=True)
class Number:
    """One result with its unit.

    Attributes
    ----------
    label : what it is.
    value : number or text; None or NaN is printed as a dash (not available).
    unit : text, or a `Display` when the value is SI.
    note : how it was obtained, one short line.
    limit : what was asked of it, as text in the shown unit ("≤ 35").
    met : whether the limit was met; None when nothing was asked.
    """

    label: str
    value: Cell
    unit: Unit = ""
    note: str = ""
    limit: str = ""
    met: bool | None = None


@dataclass(frozen=True, eq=False)
class Trace:
    """One signal over time.

    Attributes
    ----------
    name : as listed in the legend.
    t_s : (n,) times that do not decrease, s.
    y : (n,) values in the panel's unit; NaN leaves a gap.
    style : ``line``; ``demand`` (dashed, neutral: demands, references); ``estimate`` (dotted, in the group's colour);
        ``points``; ``steps`` (a value holds until the next); ``measured`` (broad and pale: give it first, so that
        what is to agree with it lies on it).
    group : traces of a group share a colour; the four wheel names have fixed ones.
    """

    name: str
    t_s: Floats
    y: Floats
    style: Style = "line"
    group: str = ""

    def __post_init__(self) -> None:
        _set_vectors(self, f"trace {self.name!r}", {"t_s": self.t_s, "y": self.y})
        if not np.all(np.isfinite(self.t_s)):
            raise ValueError(f"trace {self.name!r}: t_s must be finite; leave a gap as NaN in y, not in t_s")
        if np.any(np.diff(self.t_s) < 0.0):
            at = int(np.argmax(np.diff(self.t_s) < 0.0))
            raise ValueError(
                f"trace {self.name!r}: t_s must not decrease, but sample {at + 1} ({self.t_s[at + 1]:g} s) "
                f"is before sample {at} ({self.t_s[at]:g} s); sort it first"
            )


@dataclass(frozen=True)
class Panel:
    """Traces on one y axis; all panels of a section share the time axis.

    ``names`` stand at the axis in place of the numbers 0, 1, ..., which are then the values.
    """

    title: str
    unit: Unit
    traces: tuple[Trace, ...] = ()
    names: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Curve:
    """One curve, or set of points, of a chart.

    Attributes
    ----------
    name : as listed in the legend.
    x, y : (n,) values in the chart's units.
    low, high : (n,) bounds of an interval around y, or None.
    style, group : as for `Trace`; ``points`` draws markers.
    """

    name: str
    x: Floats
    y: Floats
    low: Floats | None = None
    high: Floats | None = None
    style: Style = "line"
    group: str = ""

    def __post_init__(self) -> None:
        if (self.low is None) != (self.high is None):
            raise ValueError(f"curve {self.name!r}: expected both low and high or neither; give the missing one")
        vectors: dict[str, ArrayLike] = {"x": self.x, "y": self.y}
        if self.low is not None and self.high is not None:
            vectors |= {"low": self.low, "high": self.high}
        _set_vectors(self, f"curve {self.name!r}", vectors)


@dataclass(frozen=True)
class Chart:
    """Curves and points over anything but time.

    ``rows`` are names for x = 1, 2, ...: then each has a line of its own, the first on top, with values to the right.

    Raises
    ------
    ValueError
        Points beside the rows, or a line with an interval over them.
    """

    title: str
    x_label: str
    x_unit: Unit
    y_label: str
    y_unit: Unit
    curves: tuple[Curve, ...] = ()
    rows: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for curve in self.curves if self.rows else ():
            if curve.style == "points" and not np.isin(curve.x, np.arange(1, len(self.rows) + 1)).all():
                raise ValueError(
                    f"chart {self.title!r}, points {curve.name!r}: expected x from 1 to {len(self.rows)}, one for each "
                    f"row, got {curve.x.tolist()}; number the rows from 1"
                )
            if curve.style != "points" and curve.low is not None:
                raise ValueError(
                    f"chart {self.title!r}, line {curve.name!r}: expected no interval over named rows, got one; "
                    "draw it as points"
                )


@dataclass(frozen=True)
class Table:
    """Rows under column heads; a head names its unit."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...] = ()
    note: str = ""

    def __post_init__(self) -> None:
        for index, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise ValueError(
                    f"table {self.title!r}, row {index}: expected {len(self.columns)} cells, one per column, "
                    f"got {len(row)}; fill missing ones with None"
                )


@dataclass(frozen=True)
class Span:
    """Something that lasted from ``start_s`` to ``end_s``."""

    start_s: float
    end_s: float
    label: str
    severity: Severity = "info"

    def __post_init__(self) -> None:
        if not (np.isfinite(self.start_s) and np.isfinite(self.end_s) and self.end_s >= self.start_s):
            raise ValueError(f"span {self.label!r}: expected finite start <= end, got {self.start_s} to {self.end_s} s")


@dataclass(frozen=True)
class Event:
    """Something that happened at ``t_s``."""

    t_s: float
    label: str
    severity: Severity = "info"

    def __post_init__(self) -> None:
        if not np.isfinite(self.t_s):
            raise ValueError(f"event {self.label!r}: expected a finite time, got {self.t_s} s")


@dataclass(frozen=True)
class Lane:
    """One row of the timeline: a mode, the faults, the link."""

    name: str
    spans: tuple[Span, ...] = ()
    events: tuple[Event, ...] = ()

    def rows(self) -> tuple["Lane", ...]:
        """Return the lane as rows in which no span covers another, nor an event; only the first has the name."""
        rows: list[list[Span]] = []
        for span in sorted(self.spans, key=lambda span: (span.start_s, span.end_s)):
            row = next((row for row in rows if row[-1].end_s <= span.start_s), None)
            if row is None:
                rows.append([span])
            else:
                row.append(span)
        lanes = [Lane("", spans=tuple(row)) for row in rows]
        if self.events or not lanes:
            lanes.append(Lane("", events=self.events))
        return replace(lanes[0], name=self.name), *lanes[1:]


@dataclass(frozen=True)
class Section:
    """A chapter of the report; its panels and its timeline share one time axis."""

    title: str
    panels: tuple[Panel, ...] = ()
    timeline: tuple[Lane, ...] = ()
    charts: tuple[Chart, ...] = ()
    tables: tuple[Table, ...] = ()
    text: str = ""

    def time_range_s(self) -> tuple[float, float] | None:
        """Return the first and last instant of all that has a time, s; None where nothing has one."""
        ends = [float(t) for p in self.panels for trace in p.traces if trace.t_s.size for t in trace.t_s[[0, -1]]]
        ends += [t for lane in self.timeline for span in lane.spans for t in (span.start_s, span.end_s)]
        ends += [event.t_s for lane in self.timeline for event in lane.events]
        return (min(ends), max(ends)) if ends else None

    def rows(self) -> tuple[Lane, ...]:
        """Return the timeline's rows, `Lane.rows` of every lane."""
        return tuple(row for lane in self.timeline for row in lane.rows())

    def happenings(self) -> list[tuple[str, Span]]:
        """Return spans and events with their lane's name, by start; an event is a span of no length."""
        rows = [(lane.name, span) for lane in self.timeline for span in lane.spans]
        rows += [(lane.name, Span(e.t_s, e.t_s, e.label, e.severity)) for lane in self.timeline for e in lane.events]
        return sorted(rows, key=lambda row: (row[1].start_s, row[1].end_s))


@dataclass(frozen=True)
class Report:
    """Everything a command has to say, ready for any printer.

    Attributes
    ----------
    title : one line.
    verdict : None where the command judges nothing.
    reason : one line that explains the verdict.
    numbers : the headline results, most important first.
    sections : chapters in reading order.
    provenance : exactly what was run (scenario, versions, seeds, parameter sets, bus, command line, host), nested.
    """

    title: str
    verdict: Verdict | None = None
    reason: str = ""
    numbers: tuple[Number, ...] = ()
    sections: tuple[Section, ...] = ()
    provenance: Mapping[str, object] = field(default_factory=dict)


def _set_vectors(target: object, where: str, vectors: Mapping[str, ArrayLike]) -> None:
    """Store ``vectors`` in the frozen ``target`` as float64 arrays of one common length."""
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in vectors.items()}
    shapes = {name: array.shape for name, array in arrays.items()}
    if any(array.ndim != 1 for array in arrays.values()) or len(set(shapes.values())) > 1:
        raise ValueError(f"{where}: expected one-dimensional arrays of equal length, got shapes {shapes}")
    for name, array in arrays.items():
        object.__setattr__(target, name, array)
