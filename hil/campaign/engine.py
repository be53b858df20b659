"""Tasks on workers: any `concurrent.futures` executor; a task during which a worker ended is run again, alone."""

import contextlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from typing import Protocol

from hil.campaign.tasks import Done, Task, killed, perform
from hil.rt.process import abandon, worker_pool

MOST_KILLS = 4
"""How often a run may end its worker before it is reported; as Dask, which allows three failures by default."""
_AHEAD = 3  # tasks a worker that are handed out: enough that none waits, few enough that memory stays flat
_POLL_S = 0.5
Stopped = Callable[[], bool]


class Workers(Protocol):
    """Processes that take tasks.

    Attributes
    ----------
    count : how many.  kills : workers that have ended when a task is given up.
    """

    count: int
    kills: int

    def open(self, count: int) -> Executor:
        """An executor of so many workers."""
        ...

    def close(self, executor: Executor, at_once: bool) -> None:
        """End an executor; ``at_once`` gives up what is under way."""
        ...

    def is_kill(self, error: BaseException) -> bool:
        """Whether a task was given up because its worker ended."""
        ...


class LocalWorkers:
    """Processes of this machine; a pool is broken as a whole when one of them ends."""

    kills = 1

    def __init__(self, count: int) -> None:
        self.count = count

    def open(self, count: int) -> ProcessPoolExecutor:
        """A pool of processes that end when we do."""
        return worker_pool(count)

    def close(self, executor: Executor, at_once: bool) -> None:
        """End the pool."""
        if at_once:
            abandon(executor)
        executor.shutdown()

    def is_kill(self, error: BaseException) -> bool:
        """Whether the pool is broken."""
        return isinstance(error, BrokenExecutor)


def work(tasks: Iterable[Task], workers: Workers, stopped: Stopped = lambda: False) -> Iterator[Done]:
    """Yield what came of each task, in any order; a few are under way at a time.

    Tasks during which a worker ended are run again one by one; the one that ends its worker again is run by its single
    runs, and a run that ends its worker `MOST_KILLS` times is `killed`. Once ``stopped``, nothing new begins, and what
    is under way is given up.
    """
    queue = iter(tasks)
    suspects: deque[Task] = deque()
    while True:
        with _executor(workers, workers.count, stopped) as executor:
            yield from _together(queue, executor, workers, suspects, stopped)
        if stopped() or not suspects:
            return
        yield from _alone(suspects, workers, stopped)


@contextlib.contextmanager
def _executor(workers: Workers, count: int, stopped: Stopped) -> Iterator[Executor]:
    executor = workers.open(count)
    at_once = True
    try:
        yield executor
        at_once = stopped()
    finally:
        workers.close(executor, at_once)


def _together(
    queue: Iterator[Task], executor: Executor, workers: Workers, suspects: deque[Task], stopped: Stopped
) -> Iterator[Done]:
    """Until the queue is empty, or a worker has ended: then ``suspects`` are all tasks that it may have had."""
    under_way: dict[Future[Done], Task] = {}
    while not stopped():
        while not suspects and len(under_way) < _AHEAD * workers.count:
            task = next(queue, None)
            if task is None:
                break
            try:
                under_way[executor.submit(perform, task)] = task
            except BrokenExecutor:
                suspects.append(task)
        if not under_way:
            return
        for future in wait(under_way, timeout=_POLL_S, return_when=FIRST_COMPLETED).done:
            task = under_way.pop(future)
            error = future.exception()
            if error is None:
                yield future.result()
            elif workers.is_kill(error):
                suspects.append(task)
            elif not stopped():
                raise error


def _alone(suspects: deque[Task], workers: Workers, stopped: Stopped) -> Iterator[Done]:
    """One task at a time, so that a worker that ends tells which."""
    while suspects and not stopped():
        task = suspects.popleft()
        is_guilty = workers.kills >= MOST_KILLS  # by the cluster's own account; of a pool it is one of several
        done = None if is_guilty else _attempt(task, workers, stopped)
        if done is None and len(task.runs) > 1:
            done = Done()
            for single in task.single():
                done.add(_insist(single, workers, stopped))
        elif done is None:
            done = _insist(task, workers, stopped, kills=workers.kills)
        if not stopped():
            yield done


def _insist(single: Task, workers: Workers, stopped: Stopped, kills: int = 0) -> Done:
    """One run, until it has ended its worker too often."""
    while kills < MOST_KILLS and not stopped():
        done = _attempt(single, workers, stopped)
        if done is not None:
            return done
        kills += workers.kills
    return Done([killed(single.runs[0], kills)])


def _attempt(task: Task, workers: Workers, stopped: Stopped) -> Done | None:
    """What came of a task on a worker of its own; None where that ended, or we shall."""
    with _executor(workers, 1, stopped) as executor:
        future = executor.submit(perform, task)
        while not stopped():
            if wait([future], timeout=_POLL_S).done:
                error = future.exception()
                if error is None:
                    return future.result()
                if workers.is_kill(error):
                    return None
                raise error
        return None
