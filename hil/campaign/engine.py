"""Independent work on workers: any `concurrent.futures` executor; what a worker ended in is done again, alone."""

import contextlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Generic, Protocol, TypeVar

from hil.errors import BrakebenchError, Verdict
from hil.rt.process import abandon, worker_pool

Item = TypeVar("Item")
Result = TypeVar("Result")
MOST_KILLS = 4
"""How often an item may end its worker before it is given up; as Dask, which allows three failures by default."""
_AHEAD = 3  # batches a worker that are handed out: enough that none waits, few enough that memory stays flat
_POLL_S = 0.5
Stopped = Callable[[], bool]


class LostError(BrakebenchError):
    """Workers that are gone as a whole; what was yielded before stands."""

    exit_code = Verdict.INCOMPLETE.exit_code


class Workers(Protocol):
    """Processes that take batches.

    Attributes
    ----------
    name : for people.
    count : how many.  kills : workers that have ended when a batch comes back with `is_kill`.
    """

    name: str
    count: int
    kills: int

    def open(self, count: int) -> Executor:
        """An executor of so many workers."""
        ...

    def close(self, executor: Executor, at_once: bool) -> None:
        """End an executor; ``at_once`` gives up what is under way."""
        ...

    def is_kill(self, error: BaseException) -> bool:
        """Whether a batch was given up because its worker ended."""
        ...

    def is_loss(self, error: BaseException) -> bool:
        """Whether all workers are out of reach, for good."""
        ...


class LocalWorkers:
    """Processes of this machine; a pool is broken as a whole when one of them ends."""

    name = "workers"
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

    def is_loss(self, _error: BaseException) -> bool:
        """Never: a new pool can be opened."""
        return False


@dataclass(frozen=True)
class Killed:
    """What stands for an item that ended its worker so many times."""

    times: int


@dataclass(frozen=True)
class _Work(Generic[Item, Result]):
    function: Callable[[Item], Result]
    workers: Workers
    stopped: Stopped

    def submit(self, executor: Executor, batch: Sequence[Item]) -> "Future[list[Result]]":
        with self.loss_told():
            return executor.submit(_each, self.function, batch)

    def error(self, future: "Future[list[Result]]") -> BaseException | None:
        """What a batch that has ended was raised."""
        with self.loss_told():
            error = future.exception()
            if error is not None and self.workers.is_loss(error):
                raise error
        return error

    @contextlib.contextmanager
    def loss_told(self) -> Iterator[None]:
        """Say in words that the workers are gone."""
        try:
            yield
        except Exception as error:
            if not self.workers.is_loss(error):
                raise
            raise LostError(
                f"{self.workers.name}: has ended, or cannot be reached any more; what was written before stands; start "
                "it again, and the same command goes on"
            ) from error


def work(
    batches: Iterable[Sequence[Item]],
    function: Callable[[Item], Result],
    workers: Workers,
    stopped: Stopped = lambda: False,
) -> Iterator[tuple[Sequence[Item], list[Result | Killed]]]:
    """Yield each batch with the results of its items, batches in any order; a few are under way at a time.

    Batches during which a worker ended are done again one by one; one that ends its worker again is done by its single
    items, and an item that ends its worker `MOST_KILLS` times is `Killed`. What ``function`` raises is raised. Once
    ``stopped``, nothing new begins, and what is under way is given up.

    Raises
    ------
    LostError : the workers are out of reach as a whole.
    """
    queue, job = iter(batches), _Work(function, workers, stopped)
    suspects: deque[Sequence[Item]] = deque()
    while True:
        with _executor(job, workers.count) as executor:
            yield from _together(queue, executor, job, suspects)
        if stopped() or not suspects:
            return
        yield from _alone(suspects, job)


def _each(function: Callable[[Item], Result], batch: Sequence[Item]) -> list[Result]:
    """In a worker."""
    return [function(item) for item in batch]


@contextlib.contextmanager
def _executor(job: _Work[Item, Result], count: int) -> Iterator[Executor]:
    executor = job.workers.open(count)
    at_once = True
    try:
        yield executor
        at_once = job.stopped()
    finally:
        job.workers.close(executor, at_once)


def _together(
    queue: Iterator[Sequence[Item]],
    executor: Executor,
    job: _Work[Item, Result],
    suspects: deque[Sequence[Item]],
) -> Iterator[tuple[Sequence[Item], list[Result | Killed]]]:
    """Until the queue is empty, or a worker has ended: then ``suspects`` are all batches that it may have had."""
    under_way: dict[Future[list[Result]], Sequence[Item]] = {}
    ended: SimpleQueue[Future[list[Result]]] = SimpleQueue()  # asking thousands of futures each time would cost more
    while not job.stopped():
        while not suspects and len(under_way) < _AHEAD * job.workers.count:
            batch = next(queue, None)
            if batch is None:
                break
            try:
                future = job.submit(executor, batch)
            except BrokenExecutor:
                suspects.append(batch)
                continue
            under_way[future] = batch
            future.add_done_callback(ended.put)
        if not under_way:
            return
        try:
            future = ended.get(timeout=_POLL_S)
        except Empty:
            continue
        batch = under_way.pop(future)
        if job.stopped() and future.cancelled():
            continue
        error = job.error(future)
        if error is None:
            yield batch, [*future.result()]
        elif job.workers.is_kill(error):
            suspects.append(batch)
        elif not job.stopped():
            raise error


def _alone(
    suspects: deque[Sequence[Item]], job: _Work[Item, Result]
) -> Iterator[tuple[Sequence[Item], list[Result | Killed]]]:
    """One batch at a time, so that a worker that ends tells which: a cluster, too, gives up what only waited there."""
    while suspects and not job.stopped():
        batch = suspects.popleft()
        done = _attempt(batch, job)
        kills = job.workers.kills if len(batch) == 1 else 0
        found: list[Result | Killed] = [] if done is None else [*done]
        for item in batch if done is None else ():
            result = _insist(item, job, kills)
            found.append(result)
        if not job.stopped():
            yield batch, found


def _insist(item: Item, job: _Work[Item, Result], kills: int) -> Result | Killed:
    """One item, until it has ended its worker too often; ``kills`` times it has."""
    while kills < MOST_KILLS and not job.stopped():
        done = _attempt([item], job)
        if done is not None:
            return done[0]
        kills += job.workers.kills
    return Killed(kills)


def _attempt(batch: Sequence[Item], job: _Work[Item, Result]) -> list[Result] | None:
    """Results of a batch on a worker of its own; None where that ended, or we shall."""
    with _executor(job, 1) as executor:
        future = job.submit(executor, batch)
        while not job.stopped():
            if wait([future], timeout=_POLL_S).done:
                error = job.error(future)
                if error is None:
                    return future.result()
                if job.workers.is_kill(error):
                    return None
                raise error
        return None
