"""Frames into message order: which message each frame is, and how many of each there are."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from hil.log.decoded import Rows
from hil.log.frames import FrameFlag, FrameTable
from hil.log.lookup import GROUP, IDENTIFIER, TP_CM, TP_DT, WITHOUT_PRIORITY, Lookup
from hil.log.signal_plan import Words
from hil.log.unknown_ids import SEED, UnknownIds

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
    mixed : bool by slot, came on more than one channel.
    """

    lookup: Lookup
    channels: list[str] = field(default_factory=list)
    unknown: UnknownIds = field(default_factory=UnknownIds)
    mixed: npt.NDArray[np.bool_] = field(init=False)
    _first_channel: Ints = field(init=False)
    _numbers: dict[str, int] = field(default_factory=dict)
    _hash: tuple[Ints, Ints] | None = None

    def __post_init__(self) -> None:
        self.mixed = np.zeros(len(self.lookup.messages), np.bool_)
        self._first_channel = np.full(len(self.lookup.messages), -1, np.int64)

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
        from hil.log.decode_pass import assign, fill_hash, scatter

        lookup, n, count = self.lookup, len(table), len(self.lookup.messages)
        if self._hash is None:
            size = 1 << max(4, (2 * len(lookup.keys)).bit_length())
            self._hash = np.full(size, -1, np.int64), np.zeros(size, np.int64)
            fill_hash(lookup.keys, lookup.slots.astype(np.int64), SEED, *self._hash)
        self.unknown.hashed()
        counts, short, longer = np.zeros(count, np.int64), np.zeros(count, np.int64), np.zeros(count, np.int64)
        least = lookup.lengths.copy()
        slots = np.empty(n, np.int32)
        totals = np.zeros(7, np.int64)
        totals[5] = self.unknown.kept
        unknown = self.unknown.places, self.unknown.found, self.unknown.keys, self.unknown.counts
        per_slot = lookup.lengths, lookup.longest, counts, least, short, longer, self._first_channel, self.mixed
        frames = table.time_ns, table.channel, table.can_id, table.extended, table.length, table.flags
        columns = tuple(np.ascontiguousarray(column) for column in frames)
        tables = lookup.dense, *self._hash, SEED, lookup.j1939
        bad = assign(columns, (networks, numbers), tables, unknown, per_slot, slots, totals)
        if bad >= 0:
            raise ValueError(_no_channel(table, bad))
        errors, remotes, strangers, transports, further, self.unknown.kept, back = totals.tolist()
        starts = np.concatenate(([0], np.cumsum(counts), [counts.sum() + transports])).astype(np.int64)
        rows, first = np.empty(starts[-1], np.int64), np.empty(starts[-1], np.uint64)
        stride = len(words) // n if n else 1
        scatter(slots, words.view(np.int64), stride, starts[:-1].copy(), rows, first.view(np.int64))
        return Assigned(starts, rows, first, least, short, longer, errors, remotes, strangers, further, back == 0)

    def _by_numpy(self, table: FrameTable, words: Words, networks: Ints, numbers: Ints) -> Assigned:
        lookup, n, count = self.lookup, len(table), len(self.lookup.messages)
        error = (table.flags & FrameFlag.ERROR) != 0
        remote = ~error & ((table.flags & FrameFlag.REMOTE) != 0)
        data = ~(error | remote)
        lost = data & ((table.channel < 0) | (table.channel >= len(networks)))
        if lost.any():
            raise ValueError(_no_channel(table, int(np.argmax(lost))))
        slots = np.full(n, -1, np.int64)
        channel = np.where(data, table.channel, 0).astype(np.int64)
        network = networks[channel] if len(networks) else np.full(n, -1, np.int64)
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
            if self._first_channel[one] < 0:
                self._first_channel[one] = came[0]
            self.mixed[one] |= bool((came != self._first_channel[one]).any())
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
