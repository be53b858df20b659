"""One line of a comparison, and how two sides are timed so that the ratio holds on a noisy machine."""

import statistics
from collections.abc import Callable
from dataclasses import dataclass

from hil.rt.clock import monotonic_ns

Progress = Callable[[float], None]
"""Takes the share of a measurement that is done; never called while anything is timed."""


def unseen(_: float) -> None:
    """Progress that nobody looks at."""


@dataclass(frozen=True, slots=True)
class Row:
    """One comparison.

    Attributes
    ----------
    name : what was done.
    ours, other : our figure and the other's, medians of the paired runs, in ``unit``.
    other_is : what the other is.
    ratio : above 1 when we are better; the median of the pairs' ratios.
    unit : unit of both figures.
    ours_95, other_95 : 95 % intervals of both figures, where they are shares or means of cases.
    """

    name: str
    ours: float
    other: float
    other_is: str
    ratio: float
    unit: str
    ours_95: tuple[float, float] | None = None
    other_95: tuple[float, float] | None = None


def paired(
    name: str,
    ours: Callable[[], float],
    other: Callable[[], float],
    other_is: str,
    unit: str,
    *,
    pairs: int = 5,
    larger_is_better: bool = False,
) -> Row:
    """Run both sides in turn, A B A B ..., and compare pair by pair.

    Parameters
    ----------
    ours, other : each measures its side once and returns its figure in ``unit``.
    larger_is_better : for rates; by default a smaller figure (a time) is better.
    """
    mine, theirs = [], []
    for _ in range(pairs):
        mine.append(ours())
        theirs.append(other())
    better = [(a / b if larger_is_better else b / a) for a, b in zip(mine, theirs, strict=True)]
    return Row(name, statistics.median(mine), statistics.median(theirs), other_is, statistics.median(better), unit)


def time_per_call_ns(function: Callable[[], object], calls: int) -> float:
    """Mean time of one call, ns."""
    start_ns = monotonic_ns()
    for _ in range(calls):
        function()
    return (monotonic_ns() - start_ns) / calls
