"""All claims under all conditions over many seeds, on all cores, as rows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np

from hil.campaign.engine import Killed, LocalWorkers, work
from hil.errors import BrakebenchError
from hil.validation.reproduce.cases import CASES, Numbers
from hil.validation.reproduce.claims import CLAIMS, Claim
from hil.validation.reproduce.conditions import CONDITIONS, NOMINAL, Condition, taught
from hil.validation.reproduce.store import Job, Store

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


@cache
def conditions_of(extension: Path | None) -> tuple[Condition, ...]:
    """What is driven: the paper's conditions, or the nominal one beside the car of an extension file."""
    return CONDITIONS if extension is None else (NOMINAL, taught(extension))


def job(what: Job, extension: Path | None = None) -> Numbers:
    """Measure one case under one condition with one seed (by its number: workers take plain values)."""
    case, condition, seed = what
    return CASES[case](conditions_of(extension)[condition], seed)


def measure(
    seeds: int,
    workers: int,
    say: Callable[[str], None],
    store: Store,
    extension: Path | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> list[Row]:
    """Drive everything and return the rows, nominal condition first.

    Parameters
    ----------
    seeds : of every condition.
    workers : processes.
    say : takes lines for people.
    store : numbers that need not be measured again; takes each as it is found.
    extension : of the car to drive beside the nominal one, instead of the paper's other conditions.
    progress : takes the share that is done.
    """
    conditions = conditions_of(extension)
    jobs = [(case, k, seed) for seed in range(1, seeds + 1) for k in range(len(conditions)) for case in CASES]
    missing = [what for what in jobs if what not in store.numbers]
    if len(missing) < len(jobs):
        say(f"{len(jobs) - len(missing)} of {len(jobs)} cases were driven before")
    done = work([[what] for what in missing], partial(job, extension=extension), LocalWorkers(workers))
    for n, ((what,), (numbers,)) in enumerate(done, 1):
        if isinstance(numbers, Killed):
            raise BrakebenchError(f"{what}: ended its worker process {numbers.times} times")
        store.add(what, numbers)
        progress(n / len(missing))
    found: dict[tuple[str, int], list[Numbers]] = {}
    for what in jobs:
        found.setdefault(what[:2], []).append(store.numbers[what])
    return rows(found, seeds, conditions)


def rows(
    found: Mapping[tuple[str, int], Sequence[Numbers]], seeds: int, conditions: Sequence[Condition] = CONDITIONS
) -> list[Row]:
    """Rows from what was measured: (case, number of the condition) -> numbers of each seed.

    A claim about the friction of pads has none where an effect of a taught car stands between friction and pads.
    """
    pick = partial(_row, found)
    nominal = [pick(claim, 0, conditions[0], seeds, None) for claim in CLAIMS]
    others = [
        pick(claim, k, condition, seeds, base.median)
        for k, condition in enumerate(conditions)
        if k > 0
        for claim, base in zip(CLAIMS, nominal, strict=True)
        if claim.key in found[claim.case, k][0]
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
