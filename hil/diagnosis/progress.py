"""Progress: what a diagnosis does, how much of it is done, and how long the rest takes."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar

from hil.rt.clock import monotonic_ns

Progress = Callable[[str], None]
"""Takes a line of text."""
Item = TypeVar("Item")
_EVERY_S = 2.0
"""Time between two lines of a stage, s: short stages say nothing but their name."""
REPLAYS = (500, 5000)
"""Replays of a diagnosis: 536 of logs in which nothing is wrong, 1,460 with a cause, 4,400 of a car of another
structure whose numbers go far (docs/decisions/simulation-speed.md)."""


def counted(report: Progress, stage: str, results: Iterable[Item], count: int) -> Iterator[Item]:
    """The results of a stage as they come, with lines that say how many of ``count`` are done."""
    start_ns = last_ns = monotonic_ns()
    for done, result in enumerate(results, 1):
        now_ns = monotonic_ns()
        if done < count and now_ns - last_ns > _EVERY_S * 1e9:
            left_s = (now_ns - start_ns) * 1e-9 * (count - done) / done
            report(f"{stage}: {done} of {count}, about {left_s:.0f} s left")
            last_ns = now_ns
        yield result


def expectation(replays: int, took_ns: int, range_of: Sequence[int] = REPLAYS) -> str:
    """What the whole takes, in words, by the time that the first replays took."""
    least, most = (count * took_ns * 1e-9 / max(replays, 1) for count in range_of)
    return f"{took_ns * 1e-6 / max(replays, 1):.0f} ms a replay: expect {least:.0f} to {most:.0f} s in all"
