"""Frames into message order: which message each frame is, and how many of each there are."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from hil.log.frames import FrameFlag, FrameTable
from hil.log.signals.decoded import Rows
from hil.log.signals.lookup import GROUP, IDENTIFIER, TP_CM, TP_DT, WITHOUT_PRIORITY, Lookup
from hil.log.signals.signal_plan import Words
from hil.log.signals.unknown_ids import SEED, UnknownIds

Ints = npt.NDArray[np.int64]


@dataclass(slots=True, eq=False)
class Assigned:
    """Frames of one table by slot; the slot behind the last message is that of transport frames.

    Attributes
    ----------
    starts : int64 (slots + 2,), where each slot's frames begin in ``rows``.
    rows, first : row numbers in slot order, and the first word of each of these frames.
    least, short, longer : int64 by slot: least length where one is shorter than the database says, and how many are
        shorter and longer.
    errors, remotes, strangers, further : frames that are no message: error frames, remote frames, unknown ones, and
        those of them whose identifier is not kept.
    ascending : the stamps do not run back.
    """

    starts: Ints
    rows: Rows
    first: Words
    least: Ints
    short: Ints
    longer: Ints
    errors: int
    remotes: int
    strangers: int
    further: int
    ascending: bool


@dataclass(slots=True, eq=False)
class Assigner:
    """Finds the message of each frame, table after table.

    Parameters
    ----------
    lookup : the messages.

    Attributes
    ----------
    channels : names of all channels so far.
    unknown : identifiers that no database knows.
    several_channels : a message came on more than one channel.
    """

    lookup: Lookup
    channels: list[str] = field(default_factory=list)
    unknown: UnknownIds = field(default_factory=UnknownIds)
    _per_slot: Ints = field(init=False)
    _numbers: dict[str, int] = field(default_factory=dict)
    _hash: tuple[Ints, Ints] | None = None

    def __post_init__(self) -> None:
        self._per_slot = np.zeros((len(self.lookup.messages), 7), np.int64)
        self._per_slot[:, 0], self._per_slot[:, 1] = self.lookup.lengths, self.lookup.longest
        self._per_slot[:, 6] = -1

    @property
    def several_channels(self) -> bool:
        """A message came on more than one channel."""
        return bool((self._per_slot[:, 6] == -2).any())

    def came_on(self, slot: int, channel: int) -> None:
        """Take note of the channel (by number) that a message came on by other ways."""
        first = self._per_slot[slot, 6]
        self._per_slot[slot, 6] = channel if first in (-1, channel) else -2

    def numbers(self, channels: tuple[str, ...]) -> Ints:
        """Numbers of a table's channels among all channels."""
        for name in channels:
            if name not in self._numbers:
                self._numbers[name] = len(self.channels)
                self.channels.append(name)
        return np.array([self._numbers[name] for name in channels], np.int64)

    def assign(self, table: FrameTable, words: Words, fast: bool) -> Assigned:
        """Sort the frames of a table by message.

        Parameters
        ----------
        words : the data, ``len(words) // len(table)`` words a frame.

        Raises
        ------
        ValueError
            When a frame's channel is none of the table's.
        """
        networks = np.array([self.lookup.network(name) for name in table.channels], np.int64)
        numbers = self.numbers(table.channels)
        way = self._compiled if fast else self._by_numpy
        return way(table, words, networks, numbers)

    def _compiled(self, table: FrameTable, words: Words, networks: Ints, numbers: Ints) -> Assigned:
        from hil.log.signals.decode_pass import assign_left, assign_standard, fill_hash, scatter

        lookup, n, state = self.lookup, len(table), self._per_slot
        if self._hash is None:
            size = 1 << max(4, (2 * len(lookup.keys)).bit_length())
            self._hash = np.full(size, -1, np.int64), np.zeros(size, np.int64)
            fill_hash(lookup.keys, lookup.slots.astype(np.int64), SEED, *self._hash)
        self.unknown.hashed()
        state[:, 2:6] = 0
        state[:, 3] = state[:, 0]
        slots, left, totals = np.empty(n, np.int32), np.empty(n, np.int32), np.zeros(6, np.int64)
        frames = table.time_ns, table.channel, table.can_id, table.extended, table.length, table.flags
        columns = tuple(np.ascontiguousarray(column) for column in frames)
        channels = networks, numbers
        bad = assign_standard(columns, channels, lookup.dense, state, slots, left, totals)
        if bad >= 0:
            raise ValueError(_no_channel(table, bad))
        back, others = totals[:2].tolist()
        totals[:] = [0, 0, 0, 0, 0, self.unknown.kept]
        if others:
            tables = *self._hash, SEED, lookup.j1939
            unknown = self.unknown.places, self.unknown.found, self.unknown.keys, self.unknown.counts
            assign_left(left[:others], columns, channels, tables, unknown, state, slots, totals)
        errors, remotes, strangers, transports, further, self.unknown.kept = totals.tolist()
        starts = np.zeros(len(state) + 2, np.int64)
        np.cumsum(state[:, 2], out=starts[1:-1])
        starts[-1] = starts[-2] + transports
        rows, first = np.empty(starts[-1], np.int64), np.empty(starts[-1], np.uint64)
        stride = len(words) // n if n else 1
        scatter(slots, words.view(np.int64), stride, starts[:-1].copy(), rows, first.view(np.int64))
        least, short, longer = state[:, 3].copy(), state[:, 4].copy(), state[:, 5].copy()
        return Assigned(starts, rows, first, least, short, longer, errors, remotes, strangers, further, back == 0)

    def _by_numpy(self, table: FrameTable, words: Words, networks: Ints, numbers: Ints) -> Assigned:
        lookup, n, count = self.lookup, len(table), len(self.lookup.messages)
        error = (table.flags & FrameFlag.ERROR) != 0
        remote = ~error & ((table.flags & FrameFlag.REMOTE) != 0)
        data = ~(error | remote)
        lost = (table.channel < 0) | (table.channel >= len(networks))
        if lost.any():
            raise ValueError(_no_channel(table, int(np.argmax(lost))))
        slots = np.full(n, -1, np.int64)
        channel = table.channel.astype(np.int64)
        network = networks[channel]
        can_id = table.can_id.astype(np.int64)
        known = data & (network >= 0)
        standard = np.flatnonzero(known & ~table.extended & (can_id < 2048))
        slots[standard] = lookup.dense[network[standard], can_id[standard]]
        wide = np.flatnonzero(known & table.extended)
        j1939 = lookup.j1939[network[wide]] if len(wide) else np.zeros(0, np.bool_)
        group = can_id >> 8 & 0x3FFFF
        group = np.where(group >> 8 & 0xFF < 240, group & 0x3FF00, group)
        for kind, value in ((IDENTIFIER, can_id), (WITHOUT_PRIORITY, can_id & 0x3FF_FFFF), (GROUP, group)):
            left = wide[(slots[wide] < 0) & (j1939 | (kind == IDENTIFIER))]
            if len(left) and len(lookup.keys):
                keys = network[left] << 34 | kind << 32 | value[left]
                at = np.minimum(np.searchsorted(lookup.keys, keys), len(lookup.keys) - 1)
                slots[left] = np.where(lookup.keys[at] == keys, lookup.slots[at], -1)
        left = wide[(slots[wide] < 0) & j1939]
        format_only = group[left] & 0x3FF00
        slots[left[(format_only == TP_CM) | (format_only == TP_DT)]] = count
        strangers = np.flatnonzero(data & (slots < 0))
        further = 0
        if len(strangers):
            keys = numbers[channel[strangers]] << 32 | table.extended[strangers].astype(np.int64) << 31
            further = self.unknown.add(keys | can_id[strangers])
        starts = np.concatenate(([0], np.cumsum(np.bincount(slots[slots >= 0], minlength=count + 1)))).astype(np.int64)
        rows = np.argsort(slots, kind="stable")[n - int(starts[-1]) :]
        least, short, longer = lookup.lengths.copy(), np.zeros(count, np.int64), np.zeros(count, np.int64)
        of_message = rows[: starts[-2]]
        slot, length = slots[of_message], table.length[of_message].astype(np.int64)
        np.minimum.at(least, slot, length)
        np.add.at(short, slot, length < lookup.lengths[slot])
        np.add.at(longer, slot, length > lookup.longest[slot])
        for one in np.flatnonzero(np.diff(starts[:-1])).tolist():
            came = np.unique(numbers[table.channel[rows[starts[one] : starts[one + 1]]]])
            if self._per_slot[one, 6] == -1:
                self._per_slot[one, 6] = came[0]
            if (came != self._per_slot[one, 6]).any():
                self._per_slot[one, 6] = -2
        stride = len(words) // n if n else 1
        return Assigned(
            starts,
            rows,
            words[rows * stride],
            least,
            short,
            longer,
            int(np.count_nonzero(error)),
            int(np.count_nonzero(remote)),
            len(strangers),
            further,
            bool((np.diff(table.time_ns) >= 0).all()),
        )


def _no_channel(table: FrameTable, row: int) -> str:
    return f"frame {row} has channel {table.channel[row]}; the table names {len(table.channels)} channels"
