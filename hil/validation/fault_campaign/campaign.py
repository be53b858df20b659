"""The whole campaign: all rows, pairs, and the time-dependent rows at longer time-outs, on several processes."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from hil.campaign.engine import Killed, LocalWorkers, work
from hil.errors import BrakebenchError
from hil.faults.catalogue import fault_named
from hil.faults.fault import FaultError
from hil.validation.fault_campaign.budgets import ORIGINS, judge
from hil.validation.fault_campaign.cases import PAIR, SCENARIO, Case, cases, cases_of_time, pairs, virtual_faults
from hil.validation.fault_campaign.drive import scenario_of
from hil.validation.fault_campaign.job import run
from hil.validation.fault_campaign.table import Row, merged, row_of

TIMEOUTS_MS = (50, 100, 200)
_OF_PAIRS = 4  # one of so many instants for each pair of families
_CHUNK = 4  # cases that a process takes at a time


@dataclass(frozen=True, slots=True)
class Campaign:
    """What was found.

    Attributes
    ----------
    instants, seed : of the campaign.
    rows : single faults, by target; pairs : two at once, a row for each two families.
    processes : faults of real processes, in real time.
    timeouts : time-dependent rows by the controller's time-out, ms; its own one first.
    """

    instants: int
    seed: int
    rows: list[Row]
    pairs: list[Row]
    timeouts: dict[int, list[Row]]
    processes: list[Row] = field(default_factory=list)

    @property
    def judged(self) -> list[Row]:
        """Rows that decide; those at other time-outs are shown."""
        return [*self.rows, *self.pairs, *self.processes]

    @property
    def passed(self) -> bool:
        """No miss but those that physics forces."""
        return not any(row.misses for row in self.judged)

    def as_json(self) -> dict[str, Any]:
        """As JSON values."""
        return {
            "scenario": SCENARIO,
            "instants": self.instants,
            "seed": self.seed,
            "rows": [row.as_json() for row in merged(self.rows)],
            "pairs": [row.as_json() for row in self.pairs],
            "processes": [row.as_json() for row in self.processes],
            "timeouts": [
                {"timeout_ms": timeout, "rows": [row.as_json() for row in rows]}
                for timeout, rows in self.timeouts.items()
            ],
            "budgets": ORIGINS,
        }


def drive_campaign(
    instants: int,
    seed: int,
    workers: int,
    progress: Callable[[float], None],
    only: Sequence[str] = (),
) -> Campaign:
    """Drive and judge everything in virtual time.

    Parameters
    ----------
    instants : of every row.
    workers : processes.
    progress : takes the share that is done.
    only : names of faults, and ``pair``; empty: all.

    Raises
    ------
    FaultError
        No such fault, or one of real processes.
    """
    named = [fault_named(name) for name in only if name != PAIR]
    for kind in named:
        if not kind.in_virtual_time:
            raise FaultError(f"{kind.name} exists with real processes only: leave out --only, which runs them all")
    kinds = [kind for kind in virtual_faults() if not only or kind in named]
    single = cases(kinds, instants, seed)
    double = pairs(-(-instants // _OF_PAIRS), seed) if not only or PAIR in only else []
    own_ms = round(1e3 * scenario_of().ecu.supervision.timeout_s)
    shown = (own_ms, *TIMEOUTS_MS) if not only else ()
    later = {t: cases_of_time(instants, seed, None if t == own_ms else t * 1e-3) for t in shown}
    everything = [*single, *double, *(case for those in later.values() for case in those)]
    done = _judged(everything, workers, progress)
    return Campaign(
        instants, seed, _rows(done, single), _rows(done, double), {t: _rows(done, those) for t, those in later.items()}
    )


Judged = dict[int, Any]


def _judged(everything: Sequence[Case], workers: int, progress: Callable[[float], None]) -> Judged:
    """Run all cases; what was measured and missed, by the identity of the case."""
    scenario = scenario_of()
    found: Judged = {}
    batches = [everything[k : k + _CHUNK] for k in range(0, len(everything), _CHUNK)]
    for batch, results in work(batches, run, LocalWorkers(workers)):
        for case, m in zip(batch, results, strict=True):
            if isinstance(m, Killed):
                raise BrakebenchError(f"{case}: ended its worker process {m.times} times")
            faults = [armed.injection() for armed in case.faults]
            found[id(case)] = (case, m, judge(m, faults, scenario.ecu))
        progress(len(found) / len(everything))
    return found


def _rows(done: Judged, those: Iterable[Case]) -> list[Row]:
    by_row: dict[tuple[str, str], list[Any]] = {}
    for case in those:
        by_row.setdefault(case.row, []).append(done[id(case)])
    heading = "two faults at once"
    return [row_of(runs, heading if name == PAIR else fault_named(name).row) for (name, _), runs in by_row.items()]
