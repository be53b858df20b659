"""The campaign as text: a table, what was missed, and a verdict in terms of braking."""

import math
from collections.abc import Sequence

from hil.validation.fault_campaign.budgets import GONE
from hil.validation.fault_campaign.campaign import Campaign
from hil.validation.fault_campaign.table import Found, Row

HEADS = (
    "", "runs", "found ms", "motor 0 ms", "friction ms", "back ms", "dip m/s²", "stop", "stale", "wrong", "miss",
    "bound",
)  # fmt: skip
"""Heads of the table."""
_TIMES = ("detect_ms", "motor_zero_ms", "friction_back_ms", "recovery_ms")
_WORST = {"dip_mps2": 2, "stop_distance_ratio": 3}


def legend() -> str:
    """What the columns are."""
    return (
        "Times in ms, median/maximum of all runs. found: first frame befallen to the controller's report; motor 0: to "
        "no torque demand; friction: report to 90 % of the lost regeneration; back: end of the fault to the normal "
        "mode; dip: most deceleration lost; stop: longest distance over that without the fault; stale: old or altered "
        "frames used; wrong: runs with a trouble code or mode of something else; miss: budgets missed; bound: missed "
        "where no controller could keep them."
    )


def cells(row: Row, name: str) -> tuple[str, ...]:
    """One line of the table."""
    times = tuple(_both(row, column) for column in _TIMES)
    worst = tuple(_largest(row, column, digits) for column, digits in _WORST.items())
    counts = (row.stale_used, row.exceptions + row.wrong_code)
    missed = (sum(one.times for one in row.misses), sum(one.times for one in row.bounded))
    return (name, str(row.runs), *times, *worst, *(str(n) if n else "" for n in (*counts, *missed)))


def _both(row: Row, column: str) -> str:
    values = row.statistics(column)
    if all(math.isnan(value) for value in row.numbers[column]):
        return ""
    median, most = ("never" if v is None else f"{v:.0f}" for v in (values["p50"], values["max"]))
    return median if median == most else f"{median}/{most}"


def _largest(row: Row, column: str, digits: int) -> str:
    values = [value for value in row.numbers[column] if math.isfinite(value)]
    return f"{max(values):.{digits}f}" if values else ""


def at_timeouts(timeouts: dict[int, list[Row]]) -> tuple[list[str], list[tuple[str, ...]]]:
    """Heads and lines of the table at several time-outs: found, longest dip and longest stop at each."""
    first = next(iter(timeouts.values()))
    heads = ["", "runs"]
    for name in ("found", "dip ms", "stop"):
        heads += [f"{name} {t}" if k == 0 else str(t) for k, t in enumerate(timeouts)]
    lines = []
    for k, row in enumerate(first):
        those = [rows[k] for rows in timeouts.values()]
        found = [f"{_most(one, column):.{digits}f}" for column, digits in
                 (("detect_ms", 0), ("dip_ms", 0), ("stop_distance_ratio", 3)) for one in those]  # fmt: skip
        lines.append((f"{row.fault} {row.target}", str(row.runs), *found))
    return heads, lines


def missed(rows: Sequence[Row]) -> list[str]:
    """Each miss as one sentence, row by row."""
    lines = []
    for row in rows:
        for found in row.misses:
            what = found.text or f"{_amount(found, found.worst)} where {_amount(found, found.limit)} are allowed"
            times = f"{found.times} of {row.runs}" if row.runs > 1 else ""
            lines.append(f"MISS {row.fault} {row.target}: {found.budget} {times}: {what} ({found.where})")
    return lines


def bounded(rows: Sequence[Row]) -> list[str]:
    """What no controller could keep: one sentence for each budget and bound, with the worst run."""
    found: dict[tuple[str, str], list[tuple[Found, Row]]] = {}
    for row in rows:
        for one in row.bounded:
            found.setdefault((one.budget, one.bound), []).append((one, row))
    lines = []
    for (budget, bound), those in sorted(found.items(), key=lambda item: item[0]):
        worst, _ = max(those, key=lambda one: one[0].worst)
        times, faults = sum(one.times for one, _ in those), sorted({row.fault for _, row in those})
        least = "" if math.isnan(worst.bound_ms) else f", {worst.bound_ms:.0f} ms there"
        lines.append(
            f"BOUND {budget}: {bound}{least}: {times} runs, at most {_amount(worst, worst.worst)} where "
            f"{_amount(worst, worst.limit)} are allowed ({worst.where}); of {', '.join(faults)}"
        )
    return lines


def _amount(found: Found, value: float) -> str:
    unit = "frames" if found.budget == "stale_used" else "ms"
    return "never" if math.isinf(value) else f"{value:.0f} {unit}"


def verdict(campaign: Campaign) -> list[str]:
    """In terms of braking, for people."""
    rows = campaign.judged
    runs = sum(row.runs for row in rows)
    misses = sum(one.times for row in rows for one in row.misses)
    bounded = sum(one.times for row in rows for one in row.bounded)
    lines = [f"{runs} stops with a fault, {len(rows)} rows: {misses} misses, {bounded} bound by physics or design."]
    broken = [row for row in rows if row.heading.startswith("motor")]
    others = [row for row in rows if row not in broken and row.heading != "two faults at once"]
    for what, those in (("Worst of the brake and motors themselves", broken), ("Worst of all others", others)):
        longest = max(those, key=lambda row: row.longest[0], default=None)
        if longest is None or longest.longest[0] <= 0.0:
            continue
        ratio = longest.statistics("stop_distance_ratio")["max"] or math.nan
        lines.append(
            f"{what}: {longest.longest[1]}: the stop is {longest.longest[0]:.1f} m longer ({100 * (ratio - 1):+.0f} %)."
        )
    lines.append(_released(rows))
    lines.append(_used(campaign.rows))
    exceptions = sum(row.exceptions for row in rows)
    lines.append("No run raised an exception." if not exceptions else f"{exceptions} runs raised an exception.")
    return lines


def _released(rows: Sequence[Row]) -> str:
    """How long the brake gave too little, those rows left out whose fault takes its pressure away."""
    rows = [row for row in rows if not any(one.budget == "release" and one.bound == GONE for one in row.found)]
    worst = max(rows, key=lambda row: _most(row, "release_ms"), default=None)
    longest = 0.0 if worst is None else _most(worst, "release_ms")
    if worst is None or longest == 0.0:
        return "No fault released the brake against the pedal."
    where = next((f" ({one.where})" for one in worst.found if one.budget == "release"), "")
    return (
        "Those of the brake's own pressure left out, the brakes gave less than half of what was due for "
        f"{longest:.0f} ms at most: {worst.fault} {worst.target}{where}."
    )


def _used(rows: Sequence[Row]) -> str:
    stale, altered = sum(row.stale_used for row in rows), sum(row.altered for row in rows)
    return f"Of {altered} frames altered, doubled or old, {stale} were used."


def _most(row: Row, column: str) -> float:
    return max((value for value in row.numbers[column] if math.isfinite(value)), default=0.0)
