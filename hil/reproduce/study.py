"""All claims under all conditions over many seeds, on all cores, as rows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hil.process import worker_pool
from hil.reproduce.cases import CASES, Numbers
from hil.reproduce.claims import CLAIMS, Claim
from hil.reproduce.conditions import CONDITIONS, NOMINAL, Condition

SEEDS_SHARE = 5  # a condition other than the nominal one takes this share of the seeds
DEGRADED = 2.0


@dataclass(frozen=True)
class Row:
    """One line of the table.

    ``paper_method``: median of the paper's method here.  ``met``: the goal's own statistic holds.  ``degradation``:
    median over the nominal condition's (None in it, and where more is better).
    """

    figure: str
    claim: str
    unit: str
    paper: float | None
    paper_method: float | None
    median: float
    p95: float
    goal: float
    statistic: str
    met: bool
    conditions: str
    seeds: int
    degradation: float | None


def job(what: tuple[str, int, int]) -> Numbers:
    """Measure one case under one condition with one seed (by its number: workers take plain values)."""
    case, condition, seed = what
    return CASES[case](CONDITIONS[condition], seed)


def measure(seeds: int, workers: int, say: Callable[[str], None]) -> list[Row]:
    """Drive everything and return the rows, nominal condition first.

    Parameters
    ----------
    seeds : of the nominal condition; the others take a fifth of them, at least one.
    workers : processes.
    say : takes lines of progress.
    """
    counts = [seeds if c is NOMINAL else max(1, seeds // SEEDS_SHARE) for c in CONDITIONS]
    jobs = [(case, k, seed) for k, n in enumerate(counts) for case in CASES for seed in range(1, n + 1)]
    found: dict[tuple[str, int], list[Numbers]] = {}
    with worker_pool(workers) as pool:
        for done, ((case, k, _), numbers) in enumerate(zip(jobs, pool.map(job, jobs), strict=True), 1):
            found.setdefault((case, k), []).append(numbers)
            if done % 20 == 0 or done == len(jobs):
                say(f"{done} of {len(jobs)} cases driven ({CONDITIONS[k].name})")
    return rows(found, counts)


def rows(found: dict[tuple[str, int], list[Numbers]], counts: Sequence[int]) -> list[Row]:
    """Rows from what was measured: (case, number of the condition) -> numbers of each seed."""
    pick = partial(_row, found)
    nominal = [pick(claim, 0, CONDITIONS[0], counts[0], None) for claim in CLAIMS]
    others = [
        pick(claim, k, condition, counts[k], base.median)
        for k, condition in enumerate(CONDITIONS)
        if k > 0
        for claim, base in zip(CLAIMS, nominal, strict=True)
    ]
    return nominal + others


def _row(
    found: dict[tuple[str, int], list[Numbers]],
    claim: Claim,
    k: int,
    condition: Condition,
    seeds: int,
    nominal: float | None,
) -> Row:
    numbers = found[claim.case, k]
    values = np.array([n[claim.key] for n in numbers])
    median = float(np.median(values))
    adverse = float(np.percentile(values, 5.0 if claim.at_least else 95.0))
    judged = median if claim.statistic == "median" else adverse
    paper = None if claim.paper_key is None else float(np.median([n[claim.paper_key] for n in numbers]))
    ratio = None
    if nominal is not None and not claim.at_least and nominal > 0.0:
        ratio = median / nominal
    return Row(
        figure=claim.figure,
        claim=claim.claim,
        unit=claim.unit,
        paper=claim.paper,
        paper_method=paper,
        median=median,
        p95=adverse,
        goal=claim.goal,
        statistic=claim.statistic,
        met=judged >= claim.goal if claim.at_least else judged <= claim.goal,
        conditions=condition.name,
        seeds=seeds,
        degradation=ratio,
    )
