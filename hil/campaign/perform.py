"""Run what is missing of a campaign, and keep it."""

from collections.abc import Callable, Iterator

from hil.campaign.engine import Killed, Stopped, Workers, work
from hil.campaign.plan import Plan
from hil.campaign.store import Store
from hil.campaign.tasks import killed


def perform(
    plan: Plan, store: Store, open_workers: Callable[[int], Workers], stopped: Stopped = lambda: False
) -> Iterator[int]:
    """Yield the number of runs in each part once it is written; parts that are there are not run.

    Parameters
    ----------
    open_workers : takes how many parts are missing; it is not called where none is.

    Raises
    ------
    hil.campaign.store.StoreError : the disk does not take them.
    """
    missing = list(store.missing())
    if not missing:
        return
    batches = (plan.part(number) for number in missing)
    for batch, results in work(batches, plan.runner, open_workers(len(missing)), stopped):
        done = [
            killed(run, result.times) if isinstance(result, Killed) else result
            for run, result in zip(batch, results, strict=True)
        ]
        store.add(batch[0].number // plan.part_size, done)
        yield len(done)
