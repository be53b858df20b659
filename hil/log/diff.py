"""Compares the signals of two logs: which differ, from when, by how much."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from dbc.database import Signal
from hil.log.choice import Choice
from hil.log.contents import Contents
from hil.log.databases import Databases
from hil.log.decoded import Values
from hil.log.read import Progress
from hil.log.series import MessageSeries, Samples, collect
from hil.log.several import Logs
from hil.log.summary import Summary

VALUES_AT_ONCE = 8_000_000  # of both logs together: about 300 MB
FLOAT_TOLERANCE = 1e-6  # of the larger value, for floating-point signals

Ints = npt.NDArray[np.int64]
Tolerance = Callable[[str, Signal], float | None]
"""Tolerance of a signal ("MESSAGE.SIGNAL") in its own unit; None for the one it has by itself."""


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


@dataclass(frozen=True, slots=True)
class MessageDifference:
    """Frames of one message: how many each log has, how many have no partner in the other, and from when (s)."""

    name: str
    first: int
    second: int
    unpaired_first: int
    unpaired_second: int
    unpaired_s: float | None

    @property
    def equal(self) -> bool:
        """Every frame has a partner."""
        return not (self.unpaired_first or self.unpaired_second)


@dataclass(slots=True)
class LogDifference:
    """Two logs compared.

    Attributes
    ----------
    same_clock : stamps are compared as they are; else from the first frame of each log on.
    messages, signals : those of both logs.
    only_first, only_second : messages that only one log has, with their number of frames.
    unknown : identifiers of no message whose number of frames differs, with both numbers.
    """

    same_clock: bool
    messages: list[MessageDifference] = field(default_factory=list)
    signals: list[SignalDifference] = field(default_factory=list)
    only_first: dict[str, int] = field(default_factory=dict)
    only_second: dict[str, int] = field(default_factory=dict)
    unknown: dict[str, tuple[int, int]] = field(default_factory=dict)

    @property
    def equal(self) -> bool:
        """The logs are equal within the tolerances."""
        parts = all(one.equal for one in self.messages) and all(one.equal for one in self.signals)
        return parts and not (self.only_first or self.only_second or self.unknown)


def own_tolerance(signal: Signal) -> float | None:
    """One raw step; 0 for single bits and named values, which have no "nearly"; None for floating-point signals."""
    if signal.is_float:
        return None
    return 0.0 if signal.choices or signal.length == 1 else abs(float(signal.factor))


def diff_logs(
    first: Logs,
    second: Logs,
    databases: Databases,
    choice: Choice,
    tolerance: Tolerance = lambda *_: None,
    progress: Progress | None = None,
) -> LogDifference:
    """Compare the chosen signals of two logs.

    The k-th frame of a message is compared with its k-th frame in the other log where both have equally many and the
    stamps agree within half a cycle; else every frame of the first log with the nearest one of the other, not farther
    than half a cycle (the median of the first log). Stamps are taken as they are where the two logs overlap in time,
    else from the first frame of each log on. Messages are compared group by group, so that memory does not grow with
    the logs; a group is at least one message. Both logs are read once, and once again for each group.
    """
    wanted = choice.wanted(databases)
    readings = _Readings(progress)
    sides = [_contents(logs, databases, choice, wanted, readings.next()) for logs in (first, second)]
    ours, other = (contents.summary() for contents in sides)
    same_clock = ours.first_ns <= other.last_ns and other.first_ns <= ours.last_ns
    starts = [0, 0] if same_clock else [ours.first_ns, other.first_ns]
    counts = [_frames(side, wanted) for side in sides]
    found = LogDifference(same_clock)
    found.only_first = {name: n for name, n in counts[0].items() if name not in counts[1]}
    found.only_second = {name: n for name, n in counts[1].items() if name not in counts[0]}
    if wanted is None:
        found.unknown = _unknown(sides, (ours, other))
    begin_ns = ours.first_ns - starts[0]
    names_of: dict[str, list[str]] = {}
    for name, signal in sides[0].signals.items():
        names_of.setdefault(signal.message, []).append(name)
    sizes = {
        name: (n + counts[1][name]) * (1 + len(names_of.get(name, ())))
        for name, n in counts[0].items()
        if name in counts[1]
    }
    groups = list(_groups(sizes))
    readings.total = 2 + 2 * len(groups)
    for messages in groups:
        names = [name for message in messages for name in names_of.get(message, ())]
        one, two = (
            collect(choice.frames(logs.tables(readings.next())), databases.decoder(names)) for logs in (first, second)
        )
        for message in sorted(messages & one.keys() & two.keys()):
            one[message].time_ns -= starts[0]
            two[message].time_ns -= starts[1]
            _compare(found, message, one[message], two[message], tolerance, begin_ns)
    return found


def _frames(contents: Contents, wanted: Collection[str] | None) -> dict[str, int]:
    """Frames of each message that has a chosen signal."""
    chosen = None if wanted is None else {name.rpartition(".")[0] for name in wanted}
    messages = contents.counts.messages
    return {name: one.count for name, one in messages.items() if chosen is None or name in chosen}


class _Readings:
    """Progress over several readings of logs; how many there are is known after the first two."""

    def __init__(self, progress: Progress | None) -> None:
        self.total = 4
        self._progress = progress
        self._begun = 0

    def next(self) -> Progress | None:
        """Progress of the next reading."""
        number = self._begun
        self._begun += 1
        progress = self._progress
        return None if progress is None else lambda done: progress((number + done) / self.total)


def _contents(
    logs: Logs, databases: Databases, choice: Choice, wanted: Collection[str] | None, progress: Progress | None
) -> Contents:
    contents = Contents(databases, wanted)
    for table in choice.frames(logs.tables(progress)):
        contents.add(table)
    return contents


def _unknown(sides: list[Contents], summaries: tuple[Summary, Summary]) -> dict[str, tuple[int, int]]:
    counts: list[dict[str, int]] = [{}, {}]
    for side, summary, count in zip(sides, summaries, counts, strict=True):
        for one in summary.ids:
            if side.name(one.channel, one.can_id, one.extended) is None:
                count[one.name] = count.get(one.name, 0) + one.count
    names = sorted({*counts[0], *counts[1]})
    pairs = {name: (counts[0].get(name, 0), counts[1].get(name, 0)) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def _groups(sizes: Mapping[str, int]) -> Iterator[set[str]]:
    names: set[str] = set()
    total = 0
    for name, size in sizes.items():
        if names and total + size > VALUES_AT_ONCE:
            yield names
            names, total = set(), 0
        names.add(name)
        total += size
    if names:
        yield names


def _compare(
    found: LogDifference,
    name: str,
    one: MessageSeries,
    two: MessageSeries,
    tolerance: Tolerance,
    begin_ns: int,
) -> None:
    mine, theirs = pairs(one.time_ns, two.time_ns)
    n, m = len(one.time_ns), len(two.time_ns)
    alone = [_alone(one.time_ns, mine), _alone(two.time_ns, theirs)]
    starts = [float((times[0] - begin_ns) / 1e9) for times in alone if len(times)]
    found.messages.append(MessageDifference(name, n, m, len(alone[0]), len(alone[1]), min(starts, default=None)))
    for signal in one.signals:
        if signal in two.signals:
            limit = tolerance(f"{name}.{signal}", one.signals[signal].signal)
            if limit is None:
                limit = own_tolerance(one.signals[signal].signal)
            a, there_a = _dense(one.signals[signal], n, mine)
            b, there_b = _dense(two.signals[signal], m, theirs)
            times_s = (one.time_ns[mine] - begin_ns) / 1e9
            unit = one.signals[signal].signal.unit
            found.signals.append(_difference(f"{name}.{signal}", unit, limit, times_s, (a, there_a), (b, there_b)))


def pairs(one: Ints, two: Ints) -> tuple[Ints, Ints]:
    """Frames of two logs that belong together, by their stamps; see `diff_logs`."""
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


def _alone(times: Ints, paired: Ints) -> Ints:
    """Stamps of the frames without a partner, ascending."""
    alone = np.ones(len(times), np.bool_)
    alone[paired] = False
    return np.sort(times[alone])


def _dense(samples: Samples, n: int, frames: Ints) -> tuple[Values, npt.NDArray[np.bool_]]:
    values: Any = np.zeros(n, samples.values.dtype)
    values[samples.rows] = samples.values
    there = np.zeros(n, np.bool_)
    there[samples.rows] = True
    return values[frames], there[frames]


def _difference(
    name: str,
    unit: str,
    tolerance: float | None,
    times_s: npt.NDArray[np.float64],
    one: tuple[Values, npt.NDArray[np.bool_]],
    two: tuple[Values, npt.NDArray[np.bool_]],
) -> SignalDifference:
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
