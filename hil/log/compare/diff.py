"""Compares the signals of two logs: which differ, from when, by how much."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field

from dbc.database import Signal
from hil.log.choice import Choice
from hil.log.compare.diff_signals import Pairs, SignalDifference, difference, pairs
from hil.log.compare.series import MessageSeries, collect
from hil.log.read import Progress
from hil.log.several import Logs
from hil.log.signals.databases import Databases
from hil.log.summary.contents import Contents
from hil.log.summary.values import Summary

VALUES_AT_ONCE = 8_000_000  # of both logs together: 64 MB

Tolerance = Callable[[str, Signal], float | None]
"""Tolerance of a signal ("MESSAGE.SIGNAL") in its own unit; None for the one it has by itself."""


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
    else from the first frame of each log on. Signals are compared group by group, so that memory grows with one
    signal at most. Both logs are read once, and once again for each group.
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
    begin_ns = first.first_ns - starts[0]
    names_of: dict[str, list[str]] = {}
    for name, signal in sides[0].signals.items():
        names_of.setdefault(signal.message, []).append(name)
    shared = {name: n + counts[1][name] for name, n in counts[0].items() if name in counts[1]}
    groups = list(_groups(shared, names_of))
    readings.total = 2 + 2 * len(groups)
    paired: dict[str, Pairs] = {}
    for group in groups:
        names = [name for some in group.values() for name in some]
        one, two = (
            collect(choice.frames(logs.tables(readings.next())), databases.decoder(names), count)
            for logs, count in zip((first, second), counts, strict=True)
        )
        for message in sorted(group.keys() & one.keys() & two.keys()):
            one[message].time_ns -= starts[0]
            two[message].time_ns -= starts[1]
            if message not in paired:
                paired[message] = _pair(found, message, one[message], two[message], begin_ns)
            _compare(found, message, one[message], two[message], paired[message], tolerance, begin_ns)
        last = next(reversed(group))  # only its signals may go on in the next group
        paired = {name: some for name, some in paired.items() if name == last}
        del one, two
    return found


def _frames(contents: Contents, wanted: Collection[str] | None) -> dict[str, int]:
    """Frames of each message that has a chosen signal."""
    chosen = None if wanted is None else {name.rpartition(".")[0] for name in wanted}
    return {
        name: n
        for name, n in contents.frames_of.items()
        if chosen is None or name.partition("@")[0] in chosen or name in chosen
    }


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


def _groups(frames: Mapping[str, int], names_of: Mapping[str, list[str]]) -> Iterator[dict[str, list[str]]]:
    """Signals by message, as many as fit into memory; the stamps of a message take as much as one signal."""
    group: dict[str, list[str]] = {}
    total = 0
    for message, n in frames.items():
        for name in names_of.get(message, ()):
            size = n if message in group else 2 * n
            if group and total + size > VALUES_AT_ONCE:
                yield group
                group, total, size = {}, 0, 2 * n
            group.setdefault(message, []).append(name)
            total += size
    if group:
        yield group


def _pair(found: LogDifference, name: str, one: MessageSeries, two: MessageSeries, begin_ns: int) -> Pairs:
    paired = pairs(one.time_ns, two.time_ns)
    n, m = len(one.time_ns), len(two.time_ns)
    alone = one.time_ns[paired.alone(n)], two.time_ns[paired.alone(m, second=True)]
    starts = [int(times.min() - begin_ns) / 1e9 for times in alone if len(times)]
    found.messages.append(MessageDifference(name, n, m, len(alone[0]), len(alone[1]), min(starts, default=None)))
    return paired


def _compare(
    found: LogDifference,
    name: str,
    one: MessageSeries,
    two: MessageSeries,
    paired: Pairs,
    tolerance: Tolerance,
    begin_ns: int,
) -> None:
    for signal in one.signals:
        if signal in two.signals:
            full, samples = f"{name}.{signal}", (one.signals[signal], two.signals[signal])
            limit = tolerance(full, samples[0].signal)
            if limit is None:
                limit = own_tolerance(samples[0].signal)
            times = one.time_ns, two.time_ns
            found.signals.append(difference(full, limit, times, samples, paired, begin_ns))
