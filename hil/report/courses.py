"""Signals over one time axis, as `hil.report.courses_picture` and `hil.report.courses_page` draw them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.report.thin import thinned
from hil.report.words import clean

_MOST_NAME = 22  # letters of a name at an axis


@dataclass(frozen=True, eq=False)
class Course:
    """One signal: times that do not decrease (s) and values; NaN leaves a gap. ``steps`` holds each value."""

    name: str
    t_s: NDArray[np.float64]
    y: NDArray[np.float64]
    steps: bool = False


@dataclass(frozen=True, eq=False)
class Courses:
    """Signals that share a plot.

    Attributes
    ----------
    unit : of all of them.
    names : texts at the axis in place of numbers; the values are then 0, 1, ...: indices of these. None for numbers.
    """

    courses: tuple[Course, ...]
    unit: str = ""
    names: tuple[str, ...] | None = None

    def title(self) -> tuple[str, list[str]]:
        """Part that all names begin with (up to the dot), and what is left of each."""
        heads = {course.name.rpartition(".")[0] for course in self.courses}
        if len(heads) == 1 and (head := heads.pop()):
            return head, [course.name[len(head) + 1 :] for course in self.courses]
        return "", [course.name for course in self.courses]


def less(course: Course, limit: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and values, at most ``limit`` of them; peaks and gaps stay."""
    kept = thinned(course.y, limit)
    return course.t_s[kept], course.y[kept]


def span(plots: Sequence[Courses]) -> tuple[float, float]:
    """Times that all plots together cover, s."""
    ends = [(course.t_s[0], course.t_s[-1]) for plot in plots for course in plot.courses if len(course.t_s)]
    low, high = min((a for a, _ in ends), default=0.0), max((b for _, b in ends), default=1.0)
    return (float(low), float(high)) if high > low else (float(low) - 0.5, float(low) + 0.5)


def ticks(names: tuple[str, ...]) -> list[str]:
    """Texts at an axis, not too long."""
    return [_cut(clean(name)) for name in names]


def value_range(plot: Courses) -> tuple[float, float] | None:
    """Range of an axis where the values do not give one: names, and values that never change."""
    if plot.names is not None:
        return -0.4, len(plot.names) - 0.6
    finite = [course.y[np.isfinite(course.y)] for course in plot.courses]
    low = min((float(y.min()) for y in finite if y.size), default=0.0)
    high = max((float(y.max()) for y in finite if y.size), default=0.0)
    room = max(1.0, 0.1 * abs(low))
    return (low - room, low + room) if low == high else None


def _cut(text: str) -> str:
    return text if len(text) <= _MOST_NAME else text[: _MOST_NAME - 1] + "…"


def rows_of_legend(head: str, names: list[str], letters: int) -> list[list[int]]:
    """Which names stand in which line of a legend."""
    rows: list[list[int]] = [[]]
    used = len(head) + 2 if head else 0
    for k, name in enumerate(names):
        if rows[-1] and used + len(name) + 4 > letters:
            rows.append([])
            used = 0
        rows[-1].append(k)
        used += len(name) + 4
    return rows


def lonely(y: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Samples between two gaps, which no line shows."""
    gap = np.concatenate(([True], np.isnan(y), [True]))
    return ~gap[1:-1] & gap[:-2] & gap[2:]
