"""The campaign as text: a table, what was missed, and a verdict in terms of braking."""

import math
from collections.abc import Sequence

from hil.validation.fault_campaign.budgets import ORIGINS
from hil.validation.fault_campaign.campaign import Campaign
from hil.validation.fault_campaign.table import Found, Row

HEADS = (
    "",
    "runs",
    "found ms",
    "motor 0",
    "friction",
    "dip m/s2",
    "stop",
    "back ms",
    "stale",
    "wrong",
    "miss",
    "bound",
)
"""Heads of the table; times and sizes as median and maximum."""
_TIMES = {"detect_ms": 0, "motor_zero_ms": 0, "friction_back_ms": 0, "dip_mps2": 2, "stop_distance_ratio": 3,
          "recovery_ms": 0}  # fmt: skip


def legend() -> str:
    """What the columns are."""
    return (
        "Median/maximum of all runs. found: first frame befallen to the controller's report; motor 0: to no torque "
        "demand; friction: report to 90 % of the lost regeneration; dip: most deceleration lost; stop: distance over "
        "that without the fault; back: end of the fault to the normal mode; stale: old or altered frames used; wrong: "
        "runs with a trouble code or mode of something else; miss: budgets missed; bound: missed because physics "
        "forbids them."
    )


def cells(row: Row, name: str) -> tuple[str, ...]:
    """One line of the table."""
    numbers = tuple(_both(row, column, digits) for column, digits in _TIMES.items())
    counts = (row.stale_used, row.exceptions + row.wrong_code)
    missed = (sum(one.times for one in row.misses), sum(one.times for one in row.bounded))
    return (name, str(row.runs), *numbers, *(str(n) if n else "" for n in (*counts, *missed)))


def _both(row: Row, column: str, digits: int) -> str:
    values = row.statistics(column)
    if all(math.isnan(value) for value in row.numbers[column]):
        return ""
    median, most = ("never" if v is None else f"{v:.{digits}f}" for v in (values["p50"], values["max"]))
    return median if median == most else f"{median}/{most}"


def at_timeouts(timeouts: dict[int, list[Row]]) -> tuple[list[str], list[tuple[str, ...]]]:
    """Heads and lines of the table at several time-outs: found, longest dip and longest stop at each."""
    first = next(iter(timeouts.values()))
    heads = ["", "runs"]
    for column, name in (("detect_ms", "found"), ("dip_ms", "dip ms"), ("stop_distance_ratio", "stop")):
        heads += [f"{name} {t}" if k == 0 else str(t) for k, t in enumerate(timeouts)]
    lines = []
    for k, row in enumerate(first):
        those = [rows[k] for rows in timeouts.values()]
        found = [f"{_most(one, column):.{digits}f}" for column, digits in
                 (("detect_ms", 0), ("dip_ms", 0), ("stop_distance_ratio", 3)) for one in those]  # fmt: skip
        lines.append((f"{row.fault} {row.target}", str(row.runs), *found))
    return heads, lines


def missed(found: Found, row: Row) -> str:
    """A miss as one sentence."""
    unit = {"stale_used": "frames", "wrong_code": "", "exceptions": ""}.get(found.budget, "ms")
    what = found.text or (f"{_amount(found.worst)} {unit} where {_amount(found.limit)} are allowed")
    label = "bound by physics" if found.bound else "MISS"
    why = f": {found.bound}" if found.bound else ""
    return f"{label}: {row.fault} {row.target}: {found.budget} {found.times} of {row.runs}: {what}{why} ({found.where})"


def _amount(value: float) -> str:
    return "never" if math.isinf(value) else f"{value:.0f}"


def verdict(campaign: Campaign) -> list[str]:
    """In terms of braking, for people."""
    rows = campaign.judged
    runs = sum(row.runs for row in rows)
    misses = sum(one.times for row in rows for one in row.misses)
    bounded = sum(one.times for row in rows for one in row.bounded)
    lines = [f"{runs} stops with a fault, {len(rows)} rows: {misses} misses, {bounded} bound by physics."]
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
    lines.append(_released([row for row in rows if not any(one.bound for one in row.found if one.budget == "release")]))
    lines.append(_used(rows))
    exceptions = sum(row.exceptions for row in rows)
    lines.append("No run raised an exception." if not exceptions else f"{exceptions} runs raised an exception.")
    return lines


def _released(rows: Sequence[Row]) -> str:
    worst = max(rows, key=lambda row: _most(row, "release_ms"), default=None)
    if worst is None or not any(one.budget == "release" for row in rows for one in row.found):
        longest = 0.0 if worst is None else _most(worst, "release_ms")
        return (
            "No fault but those of the brake's own pressure released the brake against the pedal: less than half of "
            f"the braking due for {longest:.0f} ms at most."
        )
    return f"The brake let go against the pedal: {worst.fault} {worst.target}, {_most(worst, 'release_ms'):.0f} ms."


def _used(rows: Sequence[Row]) -> str:
    stale, altered = sum(row.stale_used for row in rows), sum(row.altered for row in rows)
    return f"Of {altered} frames altered, doubled or old, {stale} were used."


def _most(row: Row, column: str) -> float:
    return max((value for value in row.numbers[column] if math.isfinite(value)), default=0.0)


def budgets() -> list[str]:
    """The budgets and where they come from."""
    return [f"{name}: {text}" for name, text in ORIGINS.items()]
