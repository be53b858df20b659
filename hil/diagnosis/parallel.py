"""Threads of the diagnosis: independent work items. No other module of it starts threads.

`parallel_map` shares one pool and never nests; `thread_map` and `thread_each` open a pool of their own for long work,
and may hold a `parallel_map` within.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from threading import Semaphore
from typing import TypeVar

from hil.diagnosis.compiled import WORKERS
from hil.diagnosis.progress import Progress, counted

Item = TypeVar("Item")
Result = TypeVar("Result")
_CALLERS = Semaphore(max(WORKERS - 1, 0))
"""Number of callers that may use the pool at the same time: one less than there are processors."""


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(WORKERS)


def parallel_map(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """``function`` of each item, in order; in threads, unless others use them all.

    ``function`` must not call `parallel_map`.
    """
    has_pool = _CALLERS.acquire(blocking=False)
    try:
        return list((_pool().map if has_pool else map)(function, items))
    finally:
        if has_pool:
            _CALLERS.release()


def thread_map(
    function: Callable[[Item], Result], items: Sequence[Item], stage: str = "", progress: Progress | None = None
) -> list[Result]:
    """``function`` of each item, in order, on one thread a processor; ``progress`` hears how many of a ``stage`` are
    done."""
    results = thread_each(function, items)
    return list(results if progress is None else counted(progress, stage, results, len(items)))


def thread_each(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """As `thread_map`, one result after the other; few are made before they are taken, for the memory."""
    ahead: deque[Future[Result]] = deque()
    with ThreadPoolExecutor(WORKERS) as pool:
        for item in items:
            ahead.append(pool.submit(function, item))
            if len(ahead) > 2 * WORKERS:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()
