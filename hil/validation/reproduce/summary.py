"""The reproduction as a report: the table of all numbers, misses included, and the figures."""

from collections.abc import Mapping
from dataclasses import replace

from hil.report.report import Number, Report, Section, Table, Verdict
from hil.validation.reproduce.study import DEGRADED, Row

_COLUMNS = (
    "figure",
    "claim",
    "unit",
    "paper",
    "paper's method",
    "median",
    "95th percentile",
    "goal",
    "judged by",
    "met",
)


def build_report(rows: list[Row], figures: Mapping[str, Report]) -> Report:
    """Put rows and figures into one report."""
    others = {row.conditions for row in rows if row.degradation is not None}
    base = [row for row in rows if row.conditions not in others]
    other = [row for row in rows if row.conditions in others]
    missed = [row for row in base if not row.met]
    worse = [row for row in other if row.degradation is not None and row.degradation > DEGRADED]
    note = "Where more is better the percentile is the 5th."
    names = dict.fromkeys(row.conditions for row in other)
    sections = [
        Section("Numbers", tables=(Table("Nominal condition", _COLUMNS, tuple(_cells(row) for row in base), note),)),
        Section("Degradation", tables=tuple(_degraded(name, other) for name in names)),
    ]
    for report in figures.values():
        for section in report.sections:
            text = " ".join(dict.fromkeys(filter(None, (report.reason, section.text))))
            sections.append(replace(section, title=report.title, text=text))
    return Report(
        title="The paper's numbers and figures, reproduced",
        verdict=Verdict.PASSED if not missed else Verdict.FAILED,
        reason=f"{len(base) - len(missed)} of {len(base)} goals met in the nominal condition"
        + (f"; missed: {', '.join(row.claim for row in missed)}" if missed else ""),
        numbers=(
            Number("goals met", f"{len(base) - len(missed)} of {len(base)}", "", note="nominal condition"),
            Number("rows more than twice their nominal error", len(worse), "", note=f"of {len(other)} degraded rows"),
        ),
        sections=tuple(sections),
        provenance={"seeds": {row.conditions: row.seeds for row in rows}},
    )


def _cells(row: Row) -> tuple[str | float | bool | None, ...]:
    return (
        row.figure, row.claim, row.unit, row.paper, _short(row.paper_method), _short(row.median), _short(row.p95),
        row.goal, row.statistic, row.met,
    )  # fmt: skip


def _degraded(name: str, rows: list[Row]) -> Table:
    columns = ("figure", "claim", "unit", "median", "95th percentile", "goal", "met", "times nominal")
    cells = tuple(
        (r.figure, r.claim, r.unit, _short(r.median), _short(r.p95), r.goal, r.met, _short(r.degradation))
        for r in rows
        if r.conditions == name
    )
    return Table(name, columns, cells)


def _short(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.3g}")


def table_lines(rows: list[Row]) -> list[str]:
    """The whole table as lines of text, one row a line, condition by condition."""
    lines = []
    head = ("paper", "method", "median", "p95", "goal", "met", "x")
    for name in dict.fromkeys(row.conditions for row in rows):
        mine = [row for row in rows if row.conditions == name]
        lines += ["", f"{name} ({mine[0].seeds} seed{'s' if mine[0].seeds > 1 else ''})"]
        lines.append(f"{'fig':>4} {'claim':<84} {'unit':<5}" + "".join(f"{word:>9}" for word in head))
        for r in mine:
            cells = [_text(v) for v in (r.paper, r.paper_method, r.median, r.p95, r.goal)]
            cells += ["yes" if r.met else "NO", "" if r.degradation is None else f"{r.degradation:.2f}"]
            line = f"{r.figure:>4} {r.claim:<84.84} {r.unit:<5}" + "".join(f"{cell:>9}" for cell in cells)
            lines.append(line.rstrip())
    note = (
        "method: the paper's method here; p95: the 5th percentile where more is better; x: median over the nominal one"
    )
    return [*lines, "", note]


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
