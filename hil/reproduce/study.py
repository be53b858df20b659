"""All claims under all conditions over many seeds, on all cores, as rows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hil.process import worker_pool
from hil.reproduce.cases import CASES, Numbers
from hil.reproduce.claims import CLAIMS, Claim
from hil.reproduce.conditions import CONDITIONS, Condition
from hil.reproduce.store import Job, Store

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


def job(what: Job) -> Numbers:
    """Measure one case under one condition with one seed (by its number: workers take plain values)."""
    case, condition, seed = what
    return CASES[case](CONDITIONS[condition], seed)


def measure(seeds: int, workers: int, say: Callable[[str], None], store: Store) -> list[Row]:
    """Drive everything and return the rows, nominal condition first.

    Parameters
    ----------
    seeds : of every condition.
    workers : processes.
    say : takes lines of progress.
    store : numbers that need not be measured again; takes each as it is found.
    """
    jobs = [(case, k, seed) for seed in range(1, seeds + 1) for k in range(len(CONDITIONS)) for case in CASES]
    missing = [what for what in jobs if what not in store.numbers]
    if len(missing) < len(jobs):
        say(f"{len(jobs) - len(missing)} of {len(jobs)} cases were driven before")
    with worker_pool(workers) as pool:
        try:
            for done, (what, numbers) in enumerate(zip(missing, pool.map(job, missing), strict=True), 1):
                store.add(what, numbers)
                if done % 20 == 0 or done == len(missing):
                    say(f"{done} of {len(missing)} cases driven (seed {what[2]}, {CONDITIONS[what[1]].name})")
        except BaseException:  # a Ctrl-C must not wait for hours of work that nobody will see
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    found: dict[tuple[str, int], list[Numbers]] = {}
    for what in jobs:
        found.setdefault(what[:2], []).append(store.numbers[what])
    return rows(found, seeds)


def rows(found: Mapping[tuple[str, int], Sequence[Numbers]], seeds: int) -> list[Row]:
    """Rows from what was measured: (case, number of the condition) -> numbers of each seed."""
    pick = partial(_row, found)
    nominal = [pick(claim, 0, CONDITIONS[0], seeds, None) for claim in CLAIMS]
    others = [
        pick(claim, k, condition, seeds, base.median)
        for k, condition in enumerate(CONDITIONS)
        if k > 0
        for claim, base in zip(CLAIMS, nominal, strict=True)
    ]
    return nominal + others


def _row(
    found: Mapping[tuple[str, int], Sequence[Numbers]],
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
