"""Work on parts that do not depend on each other, over the threads that are free."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from threading import Semaphore
from typing import TypeVar

from hil.diagnosis.compiled import WORKERS

Item = TypeVar("Item")
Of = TypeVar("Of")
_FREE = Semaphore(max(WORKERS - 1, 0))
"""How many may have others help them at a time: one less than there are processors."""


@cache
def _idle() -> ThreadPoolExecutor:
    """Threads that help."""
    return ThreadPoolExecutor(WORKERS)


def parallel_map(of: Callable[[Item], Of], items: Sequence[Item]) -> list[Of]:
    """Of each item, in order; over threads, unless others have them. ``of`` must not come back here."""
    each = _idle().map if (helped := _FREE.acquire(blocking=False)) else map
    try:
        return list(each(of, items))
    finally:
        if helped:
            _FREE.release()


def thread_map(of: Callable[[Item], Of], items: Iterable[Item]) -> list[Of]:
    """``of`` each item, in order, on one thread per processor."""
    with ThreadPoolExecutor(WORKERS) as pool:
        return list(pool.map(of, items))
