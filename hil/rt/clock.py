"""The one source of time. Everything else takes a `Clock`."""

import time
from collections.abc import Callable
from typing import Protocol

monotonic_ns = time.monotonic_ns
"""CLOCK_MONOTONIC, ns: stamps frames; common to all processes of one machine."""

wall_time_ns = time.time_ns
"""Time of day, ns since 1970: data for logs and reports, never used for a timeout."""

cpu_time_ns = time.thread_time_ns
"""Processor time of this thread, ns: for comparisons of speed on a machine that others use too."""

process_cpu_time_ns = time.process_time_ns
"""Processor time of this process, all its threads, ns: the same, for work that is shared out over threads."""


_READINGS = 3
_CLOSE_NS = 100_000  # between two readings of the clock around that of the other


def clocks_ns(monotonic: Callable[[], int] = monotonic_ns, wall: Callable[[], int] = wall_time_ns) -> tuple[int, int]:
    """Read both clocks together, again where the thread lost the processor in between.

    Returns
    -------
    Monotonic time, and how far the time of day is ahead of it, ns.
    """
    best_ns = (1 << 62, 0, 0)
    for _ in range(_READINGS):
        before_ns = monotonic()
        wall_ns = wall()
        after_ns = monotonic()
        best_ns = min(best_ns, (after_ns - before_ns, after_ns, wall_ns - (before_ns + after_ns) // 2))
        if best_ns[0] < _CLOSE_NS:
            break
    return best_ns[1:]


def step_wall_clock(seconds: float) -> None:
    """Step the machine's time of day (needs the right to, and ends every other program's notion of it)."""
    time.clock_settime(time.CLOCK_REALTIME, time.time() + seconds)


class Clock(Protocol):
    """What a loop needs to know of time."""

    def now_ns(self) -> int:
        """Return monotonic time, ns."""
        ...

    def sleep_until(self, deadline_ns: int) -> None:
        """Return at ``deadline_ns`` or later; at once if it has passed."""
        ...


class WallClock:
    """The machine's CLOCK_MONOTONIC.

    Parameters
    ----------
    spin_ns : the last stretch before a deadline is spent polling instead of sleeping: punctual to some
        microseconds, at the price of that share of a core.
    """

    def __init__(self, spin_ns: int = 0) -> None:
        self._spin_ns = spin_ns

    def now_ns(self) -> int:
        """Return monotonic time, ns."""
        return monotonic_ns()

    def sleep_until(self, deadline_ns: int) -> None:
        """Sleep (clock_nanosleep underneath), then poll for the last ``spin_ns``."""
        ahead_ns = deadline_ns - self._spin_ns - monotonic_ns()
        if ahead_ns > 0:
            time.sleep(ahead_ns * 1e-9)
        # also where the sleep came back early: its argument is a float
        while monotonic_ns() < deadline_ns:
            pass


class VirtualClock:
    """Time that passes only by being slept through: deterministic, faster than real time."""

    def __init__(self, now_ns: int = 0) -> None:
        self._now_ns = now_ns

    def now_ns(self) -> int:
        """Return virtual time, ns."""
        return self._now_ns

    def sleep_until(self, deadline_ns: int) -> None:
        """Be at ``deadline_ns``; time never runs backwards."""
        self._now_ns = max(self._now_ns, deadline_ns)
