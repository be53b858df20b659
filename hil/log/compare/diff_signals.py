"""Frames and values of one message in two logs: which belong together, and how they differ."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hil.log.compare.series import Samples
from hil.log.signals.decoded import Values

FLOAT_TOLERANCE = 1e-6  # of the larger value, for floating-point signals

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


def pairs(one: Ints, two: Ints) -> tuple[Ints, Ints]:
    """Frames of two logs that belong together, by their stamps; see `hil.log.compare.diff.diff_logs`."""
    none = np.zeros(0, np.int64)
    if not len(one) or not len(two):
        return none, none
    steps = np.abs(np.diff(one))
    half = float(np.median(steps)) / 2 if len(steps) else np.inf
    if len(one) == len(two) and bool((np.abs(one - two) <= half).all()):
        every = np.arange(len(one))
        return every, every
    order_one, order_two = np.argsort(one, kind="stable"), np.argsort(two, kind="stable")
    a, b = one[order_one], two[order_two]
    after = np.clip(np.searchsorted(b, a), 0, len(b) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(b[before] - a) <= np.abs(b[after] - a), before, after)
    distance = np.abs(b[nearest] - a)
    near = np.flatnonzero(distance <= half)
    # one partner each: of several frames with one nearest, the nearest of them has it
    order = near[np.lexsort((distance[near], nearest[near]))]
    single = np.concatenate(([True], np.diff(nearest[order]) != 0)) if len(order) else np.zeros(0, np.bool_)
    chosen = np.sort(order[single])
    return order_one[chosen], order_two[nearest[chosen]]


def dense(samples: Samples, n: int, frames: Ints) -> tuple[Values, npt.NDArray[np.bool_]]:
    """Values at the chosen ones of ``n`` frames, and which of those have one."""
    values: Any = np.zeros(n, samples.values.dtype)
    values[samples.rows] = samples.values
    there = np.zeros(n, np.bool_)
    there[samples.rows] = True
    return values[frames], there[frames]


def difference(
    name: str,
    unit: str,
    tolerance: float | None,
    times_s: npt.NDArray[np.float64],
    one: tuple[Values, npt.NDArray[np.bool_]],
    two: tuple[Values, npt.NDArray[np.bool_]],
) -> SignalDifference:
    """Compare the values of pairs of frames, each with which of them have one; times are those of the first log."""
    both = one[1] & two[1]
    a, b = one[0][both].astype(np.float64), two[0][both].astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        distance = np.abs(a - b)
    same = (one[0][both] == two[0][both]) | (np.isnan(a) & np.isnan(b))
    distance[same] = 0.0
    distance[np.isnan(distance)] = np.inf
    limit = FLOAT_TOLERANCE * np.fmax(np.abs(a), np.abs(b)) if tolerance is None else tolerance * (1 + 1e-9)
    beyond = distance > np.where(np.isfinite(limit), limit, 0.0)
    odd = one[1] != two[1]
    all_beyond = odd.copy()
    all_beyond[both] |= beyond
    first = np.flatnonzero(all_beyond)
    greatest = int(distance.argmax()) if len(distance) else 0
    return SignalDifference(
        name,
        unit,
        tolerance,
        int(both.sum()),
        int(beyond.sum()),
        int((odd & one[1]).sum()),
        int((odd & two[1]).sum()),
        float(times_s[first[0]]) if len(first) else None,
        float(times_s[both][greatest]) if len(distance) and distance[greatest] > 0 else None,
        float(distance[greatest]) if len(distance) else 0.0,
        float(np.sqrt(np.mean(np.square(distance)))) if len(distance) else 0.0,
    )
