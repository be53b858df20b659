"""Frames and values of one message in two logs: which belong together, and how they differ."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hil.log.compare.series import Samples
from hil.log.signals.decoded import Values

FLOAT_TOLERANCE = 1e-6  # of the larger value, for floating-point signals
AT_ONCE = 131_072  # pairs of frames

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class SignalDifference:
    """One signal in both logs.

    Attributes
    ----------
    name, unit : ``MESSAGE.SIGNAL`` and its unit.
    tolerance : in that unit; None where it is a share of the value (floating-point signals).
    compared : pairs of frames in which both logs have a value.
    differing : of them beyond the tolerance.
    only_first, only_second : pairs in which only one log has a value (multiplexed, or not available in the other).
    first_s, greatest_s : first difference and greatest one, s from the beginning; None without one.
    greatest, rms : difference over all compared pairs, in the unit.
    """

    name: str
    unit: str
    tolerance: float | None
    compared: int
    differing: int
    only_first: int
    only_second: int
    first_s: float | None
    greatest_s: float | None
    greatest: float
    rms: float

    @property
    def equal(self) -> bool:
        """Nothing is beyond the tolerance."""
        return not (self.differing or self.only_first or self.only_second)


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Frames of two logs that belong together: positions in each; None where every frame has that of its number."""

    count: int
    first: Ints | None = None
    second: Ints | None = None

    def alone(self, n: int, second: bool = False) -> Ints:
        """Frames of one of the logs, which has ``n``, that have no partner."""
        paired = self.second if second else self.first
        if paired is None:
            return np.arange(self.count, n)
        alone = np.ones(n, np.bool_)
        alone[paired] = False
        return np.flatnonzero(alone)


def pairs(one: Ints, two: Ints) -> Pairs:
    """Frames of two logs that belong together, by their stamps; see `hil.log.compare.diff.diff_logs`."""
    none = np.zeros(0, np.int64)
    if not len(one) or not len(two):
        return Pairs(0, none, none)
    half = np.inf
    if len(one) > 1:
        steps = np.diff(one)
        half = float(np.median(np.abs(steps, out=steps), overwrite_input=True)) / 2
        del steps
    if len(one) == len(two) and all(
        bool((np.abs(one[k : k + AT_ONCE] - two[k : k + AT_ONCE]) <= half).all()) for k in range(0, len(one), AT_ONCE)
    ):
        return Pairs(len(one))
    order_one, order_two = np.argsort(one, kind="stable"), np.argsort(two, kind="stable")
    a, b = one[order_one], two[order_two]
    after = np.clip(np.searchsorted(b, a), 0, len(b) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(b[before] - a) <= np.abs(b[after] - a), before, after)
    del before, after
    distance = np.abs(b[nearest] - a)
    near = np.flatnonzero(distance <= half)
    # one partner each: of several frames with one nearest, the nearest of them has it
    order = near[np.lexsort((distance[near], nearest[near]))]
    single = np.concatenate(([True], np.diff(nearest[order]) != 0)) if len(order) else np.zeros(0, np.bool_)
    chosen = np.sort(order[single])
    return Pairs(len(chosen), order_one[chosen], order_two[nearest[chosen]])


class _Dense:
    """Values of one log at some of its frames, and which of those have one."""

    def __init__(self, samples: Samples, n: int, frames: Ints | None) -> None:
        self._frames = frames
        self._values: Any = samples.values
        self._there: npt.NDArray[np.bool_] | None = None
        if samples.rows is not None:
            self._values = np.zeros(n, samples.values.dtype)
            self._values[samples.rows] = samples.values
            self._there = np.zeros(n, np.bool_)
            self._there[samples.rows] = True

    def of(self, begin: int, end: int) -> tuple[Values, npt.NDArray[np.bool_]]:
        """Pairs ``begin`` to ``end``."""
        at = slice(begin, end) if self._frames is None else self._frames[begin:end]
        return self._values[at], np.ones(end - begin, np.bool_) if self._there is None else self._there[at]


def difference(
    name: str, tolerance: float | None, times: tuple[Ints, Ints], samples: tuple[Samples, Samples], paired: Pairs,
    begin_ns: int,
) -> SignalDifference:  # fmt: skip
    """Compare the values of pairs of frames.

    Parameters
    ----------
    times : stamps of the frames of both logs, ns; those of the first say when something differs, from ``begin_ns`` on.
    """
    sides = [
        _Dense(one, len(stamps), at)
        for one, stamps, at in zip(samples, times, (paired.first, paired.second), strict=True)
    ]
    compared = differing = only_first = only_second = 0
    first_ns: int | None = None
    greatest_ns: int | None = None
    greatest = squares = 0.0
    for begin in range(0, paired.count, AT_ONCE):
        end = min(paired.count, begin + AT_ONCE)
        (a, there_a), (b, there_b) = (side.of(begin, end) for side in sides)
        stamps = times[0][begin:end] if paired.first is None else times[0][paired.first[begin:end]]
        both = np.flatnonzero(there_a & there_b)
        distance, beyond = _distance(a[both], b[both], tolerance)
        odd = there_a != there_b
        compared, differing = compared + len(both), differing + int(np.count_nonzero(beyond))
        only_first += int(np.count_nonzero(odd & there_a))
        only_second += int(np.count_nonzero(odd & there_b))
        odd[both] |= beyond
        if first_ns is None and odd.any():
            first_ns = int(stamps[np.argmax(odd)])
        if len(both):
            squares += float(np.sum(np.square(distance)))
            most = int(distance.argmax())
            if distance[most] > greatest:
                greatest, greatest_ns = float(distance[most]), int(stamps[both[most]])
    return SignalDifference(
        name,
        samples[0].signal.unit,
        tolerance,
        compared,
        differing,
        only_first,
        only_second,
        None if first_ns is None else (first_ns - begin_ns) / 1e9,
        None if greatest_ns is None else (greatest_ns - begin_ns) / 1e9,
        greatest,
        float(np.sqrt(squares / compared)) if compared else 0.0,
    )


def _distance(
    one: Values, other: Values, tolerance: float | None
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """How far values are apart, and whether that is beyond the tolerance."""
    a, b = one.astype(np.float64), other.astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        distance = np.abs(a - b)
    distance[(one == other) | (np.isnan(a) & np.isnan(b))] = 0.0
    distance[np.isnan(distance)] = np.inf
    limit = FLOAT_TOLERANCE * np.fmax(np.abs(a), np.abs(b)) if tolerance is None else tolerance * (1 + 1e-9)
    return distance, distance > np.where(np.isfinite(limit), limit, 0.0)
