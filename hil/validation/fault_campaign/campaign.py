"""The whole campaign: all rows, pairs, and the time-dependent rows at longer time-outs, on several processes."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from hil.faults.catalogue import fault_named
from hil.rt.process import worker_pool
from hil.validation.fault_campaign.budgets import ORIGINS, judge
from hil.validation.fault_campaign.cases import PAIR, SCENARIO, Case, cases, cases_of_time, pairs, virtual_faults
from hil.validation.fault_campaign.drive import scenario_of
from hil.validation.fault_campaign.job import run
from hil.validation.fault_campaign.table import Row, row_of

TIMEOUTS_MS = (50, 100, 200)
_SHARE_OF_INSTANTS = 5  # of the table at other time-outs: a fifth
_CHUNK = 4  # cases that a process takes at a time


@dataclass(frozen=True, slots=True)
class Campaign:
    """What was found.

    Attributes
    ----------
    instants, seed : of the campaign.
    rows : single faults; pairs : two at once, a row for each two families.
    timeouts : time-dependent rows by the controller's time-out, ms; its own one first.
    """

    instants: int
    seed: int
    rows: list[Row]
    pairs: list[Row]
    timeouts: dict[int, list[Row]]

    @property
    def judged(self) -> list[Row]:
        """Rows that decide; those at other time-outs are shown."""
        return [*self.rows, *self.pairs]

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
            "rows": [row.as_json() for row in self.rows],
            "pairs": [row.as_json() for row in self.pairs],
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
    hil.faults.fault.FaultError
        No such fault.
    """
    named = [fault_named(name) for name in only if name != PAIR]
    kinds = [kind for kind in virtual_faults() if not only or kind in named]
    single = cases(kinds, instants, seed)
    double = pairs(instants, seed) if not only or PAIR in only else []
    fewer = max(1, instants // _SHARE_OF_INSTANTS)
    own_ms = round(1e3 * scenario_of().ecu.supervision.timeout_s)
    shown = (own_ms, *TIMEOUTS_MS) if not only else ()
    later = {t: cases_of_time(fewer, seed, None if t == own_ms else t * 1e-3) for t in shown}
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
    with worker_pool(workers) as pool:
        try:
            for number, (case, m) in enumerate(
                zip(everything, pool.map(run, everything, chunksize=_CHUNK), strict=True)
            ):
                faults = [armed.injection() for armed in case.faults]
                found[id(case)] = (case, m, judge(m, faults, scenario.plant, scenario.ecu))
                progress((number + 1) / len(everything))
        except BaseException:  # a Ctrl-C must not wait for what nobody will see
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return found


def _rows(done: Judged, those: Iterable[Case]) -> list[Row]:
    by_row: dict[tuple[str, str], list[Any]] = {}
    for case in those:
        by_row.setdefault(case.row, []).append(done[id(case)])
    heading = "two faults at once"
    return [row_of(runs, heading if name == PAIR else fault_named(name).row) for (name, _), runs in by_row.items()]
