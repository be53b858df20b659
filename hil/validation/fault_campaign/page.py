"""The campaign as a report: the longest stops, tables by fault and target, what was missed, what physics forbids."""

import numpy as np

from hil.report.report import Chart, Curve, Number, Report, Section, Table, Verdict
from hil.validation.fault_campaign.campaign import Campaign
from hil.validation.fault_campaign.table import Row, merged
from hil.validation.fault_campaign.text import HEADS, at_timeouts, bounded, cells, legend, missed, verdict


def build_report(campaign: Campaign) -> Report:
    """Put a campaign into a report."""
    rows = campaign.judged
    summary, *sentences = verdict(campaign)
    by_fault = merged(campaign.rows)
    tables = [_table("By fault", by_fault, False), _table("By fault and target", campaign.rows, True)]
    if campaign.pairs:
        tables.append(_table("Two faults at once", campaign.pairs, True))
    if campaign.processes:
        tables.append(_table("Real processes, in real time", campaign.processes, True))
    if campaign.timeouts:
        heads, lines = at_timeouts(campaign.timeouts)
        times = ", ".join(map(str, campaign.timeouts))
        tables.append(Table(f"At time-outs of the controller of {times} ms: maxima", tuple(heads), tuple(lines)))
    found = [Table(name, ("what",), tuple((line,) for line in lines)) for name, lines in
             (("Missed", missed(rows)), ("Bound by physics or design", bounded(rows))) if lines]  # fmt: skip
    return Report(
        title="Every fault at many instants of a stop",
        verdict=Verdict.PASSED if campaign.passed else Verdict.FAILED,
        reason=summary,
        numbers=(
            Number("Stops with a fault", sum(row.runs for row in rows)),
            Number(
                "Budgets missed", sum(m.times for r in rows for m in r.misses), "", limit="= 0", met=campaign.passed
            ),
            Number("Bound by physics or design", sum(one.times for row in rows for one in row.bounded)),
        ),
        sections=(
            Section("In terms of braking", charts=_longest(by_fault), text=" ".join(sentences)),
            Section("Faults", tables=tuple(tables), text=legend()),
            *([Section("Budgets", tables=tuple(found))] if found else []),
        ),
        provenance={"instants of every row": campaign.instants, "seed": campaign.seed},
    )


def _table(title: str, rows: list[Row], by_target: bool) -> Table:
    lines = (cells(row, f"{row.fault} {row.target}" if by_target else row.fault) for row in rows)
    return Table(title, ("fault", *HEADS[1:]), tuple(lines))


def _longest(rows: list[Row]) -> tuple[Chart, ...]:
    """By how much the longest stop with each fault passes the one without it."""
    longer = sorted((row for row in rows if row.longest[0] > 0.0), key=lambda row: -row.longest[0])
    if not longer:
        return ()
    points = Curve(
        "longest", np.arange(1.0, len(longer) + 1.0), np.array([r.longest[0] for r in longer]), style="points"
    )
    names = tuple(row.fault for row in longer)
    return (Chart("Longest stop beyond the one without the fault", "fault", "", "longer by", "m", (points,), names),)
