"""Rows of the campaign: the runs of one fault on one target as percentiles, misses and bounds."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hil.validation.fault_campaign.budgets import Miss
from hil.validation.fault_campaign.cases import Case
from hil.validation.fault_campaign.measure import Measured

NUMBERS = {
    "detect_ms": "detect_ms",
    "motor_zero_ms": "motor_zero_ms",
    "friction_back_ms": "friction_back_ms",
    "dip_mps2": "dip_mps2",
    "dip_ms": "dip_ms",
    "release_ms": "release_ms",
    "stop_distance_ratio": "stop_ratio",
    "recovery_ms": "recovery_ms",
}
"""Columns of numbers, and where each stands in `Measured`."""


@dataclass(frozen=True, slots=True)
class Found:
    """Misses of one budget in one row, with one bound or none; ``worst`` and ``where`` of the worst run."""

    budget: str
    times: int
    worst: float
    limit: float
    bound: str
    text: str
    where: str

    def as_json(self) -> dict[str, Any]:
        """As JSON values; a time that never came is null."""
        worst = _finite(self.worst)
        return {"budget": self.budget, "times": self.times, "worst": worst, "limit": self.limit, "bound": self.bound,
                "text": self.text, "run": self.where}  # fmt: skip


@dataclass(slots=True)
class Row:
    """What is looked at together.

    Attributes
    ----------
    fault, target : names; of a pair its families.
    heading : row of the table of faults to be withstood.
    numbers : each run's, by column; NaN where there is nothing to measure, infinite where it never came.
    longest : the run that stopped last, m beyond its twin, and which it was.
    found : misses, those with a bound included.
    """

    fault: str
    target: str
    heading: str
    runs: int = 0
    numbers: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in NUMBERS})
    longest: tuple[float, str] = (0.0, "")
    stale_used: int = 0
    altered: int = 0
    exceptions: int = 0
    wrong_code: int = 0
    found: list[Found] = field(default_factory=list)

    def statistics(self, column: str) -> dict[str, float | None]:
        """Median, 99th percentile and maximum; None where nothing was measured, or it never came."""
        values = np.array([value for value in self.numbers[column] if not math.isnan(value)])
        if not len(values):
            return {"p50": None, "p99": None, "max": None}
        p50, p99 = np.quantile(values, (0.5, 0.99), method="higher").tolist()
        return {"p50": _finite(p50), "p99": _finite(p99), "max": _finite(float(values.max()))}

    def never(self, column: str) -> int:
        """Runs in which it never came."""
        return sum(math.isinf(value) for value in self.numbers[column])

    @property
    def misses(self) -> list[Found]:
        """Those that a better controller would not have."""
        return [one for one in self.found if not one.bound]

    @property
    def bounded(self) -> list[Found]:
        """Those that physics forces."""
        return [one for one in self.found if one.bound]

    def as_json(self) -> dict[str, Any]:
        """As JSON values."""
        return {
            "fault": self.fault,
            "target": self.target,
            "row": self.heading,
            "runs": self.runs,
            **{column: self.statistics(column) for column in NUMBERS},
            "never": {column: n for column in NUMBERS if (n := self.never(column))},
            "budgets_missed": sum(one.times for one in self.misses),
            "stale_used": self.stale_used,
            "frames_altered": self.altered,
            "exceptions": self.exceptions,
            "wrong_code": self.wrong_code,
            "misses": [one.as_json() for one in self.misses],
            "bounded": [one.as_json() for one in self.bounded],
        }


def row_of(runs: Sequence[tuple[Case, Measured, Sequence[Miss]]], heading: str) -> Row:
    """Gather the runs of one row."""
    row = Row(*runs[0][0].row, heading)
    found: dict[tuple[str, str], list[tuple[Miss, Case]]] = {}
    for case, m, misses in runs:
        row.runs += 1
        for column, name in NUMBERS.items():
            row.numbers[column].append(float(getattr(m, name)))
        row.stale_used += m.stale_used
        row.altered += m.altered
        row.exceptions += bool(m.error)
        row.wrong_code += bool(m.wrong_faults or m.wrong_modes)
        if m.longer_m > row.longest[0] and not math.isnan(m.stop_ratio):
            row.longest = (m.longer_m, described(case))
        for miss in misses:
            found.setdefault((miss.budget, miss.bound), []).append((miss, case))
    for (budget, bound), those in found.items():
        worst, case = max(those, key=lambda one: one[0].value / max(one[0].limit, 1e-9))
        row.found.append(Found(budget, len(those), worst.value, worst.limit, bound, worst.text, described(case)))
    return row


def merged(rows: Iterable[Row]) -> list[Row]:
    """One row for each fault: all its targets together; misses keep their targets in what they say of their run."""
    found: dict[str, Row] = {}
    for row in rows:
        whole = found.setdefault(row.fault, Row(row.fault, "", row.heading))
        whole.runs += row.runs
        for column, values in row.numbers.items():
            whole.numbers[column] += values
        whole.longest = max(whole.longest, row.longest)
        whole.stale_used += row.stale_used
        whole.altered += row.altered
        whole.exceptions += row.exceptions
        whole.wrong_code += row.wrong_code
        whole.found += row.found
    return list(found.values())


def described(case: Case) -> str:
    """What to type to see a run again: faults, instants, seeds, and the seed of the noise."""
    return " and ".join(map(str, case.faults)) + f"; noise {case.seed}"


def _finite(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
