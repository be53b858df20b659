"""Threads of the diagnosis: work on items that do not depend on each other. No other module starts threads.

`parallel_map` shares one pool and never nests; `thread_map` and `thread_each` open a pool of their own for long work,
and may hold a `parallel_map` within.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from threading import Semaphore
from typing import TypeVar

from hil.diagnosis.compiled import WORKERS

Item = TypeVar("Item")
Of = TypeVar("Of")
_FREE = Semaphore(max(WORKERS - 1, 0))
"""How many callers may have help at a time: one less than there are processors."""


@cache
def _idle() -> ThreadPoolExecutor:
    """Threads that help."""
    return ThreadPoolExecutor(WORKERS)


def parallel_map(of: Callable[[Item], Of], items: Sequence[Item]) -> list[Of]:
    """``of`` each item, in order; over threads, unless others have them. ``of`` must not call this function."""
    each = _idle().map if (helped := _FREE.acquire(blocking=False)) else map
    try:
        return list(each(of, items))
    finally:
        if helped:
            _FREE.release()


def thread_map(of: Callable[[Item], Of], items: Sequence[Item]) -> list[Of]:
    """``of`` each item, in order, over a pool of `WORKERS` threads of its own."""
    return list(thread_each(of, items))


def thread_each(of: Callable[[Item], Of], items: Sequence[Item]) -> Iterator[Of]:
    """As `thread_map`, one result after the other: those already taken need no memory."""
    with ThreadPoolExecutor(WORKERS) as pool:
        yield from pool.map(of, items)
