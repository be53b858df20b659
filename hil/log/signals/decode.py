"""Frames to signals: grouped by message, cut out of 64-bit words.

Columns are called "MESSAGE.SIGNAL". Where a name alone is not clear it gets a suffix:

- Two databases use one name for different messages: that of the later one is "MESSAGE@CHANNEL" (where the databases
  are given by channel) or "MESSAGE@FILE".
- Several nodes send one J1939 message: the columns of the first source address of the log keep the plain name, those
  of the others are "EEC1@17.EngineSpeed" (hexadecimal), since one signal of two nodes is two signals, as in the channel
  groups by source address of other tools. `DecodedLog.messages` counts all of them as "EEC1".

A J1939 message (``Message.pgn_match``) stands for its parameter group whatever the priority, the source address and
(below PDU format 240) the destination. On a channel with such messages transport frames are joined, see
`hil.log.signals.j1939`.
"""

import gc
import sys
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np

from dbc.database import Database, parse_database
from dbc.frame import BusName
from hil.log.frames import FrameTable, Recording
from hil.log.signals.assign import Assigned, Assigner
from hil.log.signals.decoded import (
    Column,
    DecodedCounts,
    DecodedLog,
    MessageCount,
    SignalCount,
    TransportCount,
    Values,
)
from hil.log.signals.extract import Found, Group, pieces_of, work_out
from hil.log.signals.extract_compiled import extract_all
from hil.log.signals.j1939 import Joined, Transport
from hil.log.signals.lookup import Databases, Lookup, group_number
from hil.log.signals.message_frames import frames_of, stamps_of, with_joined, words_of
from hil.log.signals.signal_plan import SNA, MessagePlan, Words
from hil.log.signals.sources import Sources
from hil.log.signals.unknown_ids import KEPT, OTHERS
from hil.log.signals.wanted import Wanted

__all__ = [
    "NOT_A_FRAME", "SNA", "TOO_SHORT", "Column", "Databases", "DecodedCounts", "DecodedLog", "Decoder", "MessageCount",
    "SignalCount", "TransportCount", "Values", "decode_log", "own_databases",
]  # fmt: skip

TOO_SHORT = "shorter than the message in the DBC"
NOT_A_FRAME = "not a frame"
FEW_FRAMES = 500_000
"""Up to here numpy is done before the compiled passes are loaded (0.3 to 0.5 s)."""
MAX_CELLS = 8_000_000
"""Most values (8 bytes each) of one piece of `Decoder.stream`, about."""


@cache
def own_databases() -> dict[str, Database]:
    """Our two databases, by the channel name that our recordings give their bus."""
    from dbc.contract import database_text  # loads cantools

    return {bus.value: parse_database(database_text(bus), f"our {bus.value} database") for bus in BusName}


def decode_log(
    recording: Recording,
    databases: Databases | None = None,
    wanted: Collection[str] | None = None,
    fast: bool | None = None,
) -> DecodedLog:
    """Decode a recording; parameters as of `Decoder`."""
    log = Decoder(databases, wanted, fast).add(recording.frames)
    log.recording = recording
    log.frames += recording.rejected
    log.rejected += recording.rejected
    if recording.rejected:
        log.reasons[NOT_A_FRAME] += recording.rejected
    return log


class Decoder:
    """Decodes a log table by table, in memory that its length does not matter for.

    Parameters
    ----------
    databases : one for all channels; several, of which the first one that knows an identifier is used; or either by
        channel name (a channel that is not named has that of "" or of "vehicle", or else none). None takes our own
        two.
    wanted : messages ("MESSAGE") and signals ("MESSAGE.SIGNAL") that become columns, ``*`` and ``?`` stand for any
        letters; None takes all. Frames are counted either way.
    fast : False never uses the compiled passes, True always, None from `FEW_FRAMES` on, and from the begin where they
        are loaded already. The results are the same.

    Attributes
    ----------
    unmatched : wanted names that no message or signal of the databases has.

    >>> decoder = Decoder(database, wanted=["WHEELS.*"])  # doctest: +SKIP
    >>> with open_log("drive.blf") as log:
    ...     for piece in decoder.stream(log.tables()):
    ...         time_s, speed = piece.series("WHEELS.FL")
    >>> decoder.totals.messages["WHEELS"].count
    """

    def __init__(
        self,
        databases: Databases | None = None,
        wanted: Collection[str] | None = None,
        fast: bool | None = None,
    ) -> None:
        self._lookup = Lookup(own_databases() if databases is None else databases, wanted)
        self._assigner = Assigner(self._lookup)
        self._transport = Transport()
        self._sources = Sources()
        self._fast = fast
        self._unknown_groups: set[str] = set()
        self._odd: dict[str, None] = {}
        self._heads: dict[str, _Head] = {}
        self._totals = DecodedCounts(notes=tuple(self._lookup.notes))
        self.unmatched = self._lookup.unmatched()

    def add(self, table: FrameTable) -> DecodedLog:
        """Decode further frames of the log.

        Returns
        -------
        Signals and account of these frames; ``rows`` count from the first frame of the table. A J1939 message that
        transport frames carry is there at the frame that completes it.

        Raises
        ------
        ValueError
            When a frame's channel is none of the table's.
        """
        if self._fast is None and (
            self._totals.frames + len(table) > FEW_FRAMES or "hil.log.signals.decode_pass" in sys.modules
        ):
            self._fast = True
        fast = bool(self._fast)
        log = DecodedLog(
            recording=Recording(Path(), "", table),
            frames=len(table),
            notes=self._totals.notes,
        )
        if len(table):
            words = words_of(table)
            assigned = self._assigner.assign(table, words, fast)
            self._count_others(log, assigned)
            joined = self._joined(log, table, assigned)
            with np.errstate(over="ignore", invalid="ignore"), _uncollected():  # a float may hold anything
                self._decode(log, table, words, assigned, joined, fast)
            self._note(log)
        log.transport.open = self._transport.open
        self._totals.merge(log)
        return log

    def stream(self, tables: Iterable[FrameTable]) -> Iterator[DecodedLog]:
        """Decode tables one after another, in pieces where the database has so many signals that one would be large.

        Columns of a piece index `DecodedLog.recording` of that piece.
        """
        rows = max(1, MAX_CELLS // max([1, *(len(m.signals) for m in self._lookup.messages)]))
        for table in tables:
            for begin in range(0, max(1, len(table)), rows):
                yield self.add(table if len(table) <= rows else table.take(slice(begin, begin + rows)))

    @property
    def totals(self) -> DecodedCounts:
        """The account of all tables so far."""
        signals: dict[str, SignalCount] = {}
        for head in self._heads.values():
            signals |= head.totals()
        self._totals.signals = signals
        return self._totals

    def _count_others(self, log: DecodedLog, assigned: Assigned) -> None:
        log.unknown = assigned.strangers + assigned.errors + assigned.remotes
        log.unknown_ids = self._assigner.unknown.take(self._assigner.channels, assigned.further)
        for name, count in (("error frame", assigned.errors), ("remote frame", assigned.remotes)):
            if count:
                log.unknown_ids[name] = count

    def _joined(self, log: DecodedLog, table: FrameTable, assigned: Assigned) -> dict[int, list[Joined]]:
        """Messages that transport frames complete, by slot."""
        rows = assigned.rows[assigned.starts[-2] :]
        numbers = self._assigner.numbers(table.channels).tolist()
        found: dict[int, list[Joined]] = {}
        for one in self._transport.add(table, rows, numbers):
            name = table.channels[one.channel]
            slot = self._lookup.group_slot(self._lookup.network(name), one.can_id)
            if slot is None:
                group = f"{name} PGN {group_number(one.can_id):#06x}"
                if len(self._unknown_groups) < KEPT:
                    self._unknown_groups.add(group)
                log.transport.unknown[group if group in self._unknown_groups else OTHERS] += 1
            else:
                found.setdefault(slot, []).append(one)
                self._assigner.came_on(slot, numbers[one.channel])
            log.transport.joined += 1
        log.transport.frames = len(rows)
        log.decoded += len(rows)
        log.transport.broken = Counter(self._transport.broken)
        return found

    def _decode(
        self,
        log: DecodedLog,
        table: FrameTable,
        words: Words,
        assigned: Assigned,
        joined: dict[int, list[Joined]],
        fast: bool,
    ) -> None:
        parts: list[tuple[MessagePlan, Group]] = []
        heads: list[_Head] = []
        came = np.flatnonzero(np.diff(assigned.starts[:-1]))
        stamps = stamps_of(table.time_ns, assigned, came)
        slots = came if not joined else np.union1d(came, list(joined))
        places = assigned.starts[slots], assigned.starts[slots + 1], assigned.least[slots]
        counts = assigned.short[slots], assigned.longer[slots]
        for slot, begin, end, least, short, longer in zip(
            *(a.tolist() for a in (slots, *places, *counts)), strict=True
        ):
            plan = self._lookup.plan(slot)
            group, too_short = frames_of(plan, table, words, assigned, begin, end, least)
            if too_short:
                log.rejected += too_short
                log.reasons[TOO_SHORT] += too_short
                short -= too_short
            log.decoded += len(group.rows)
            carried = [one for one in joined.get(slot, ()) if len(one.data) >= plan.least] if joined else []
            if carried:
                short += sum(len(one.data) < plan.message.length for one in carried)
                longer += sum(len(one.data) > plan.message.length for one in carried)
                group = with_joined(group, carried, table, words)
            count = len(group.rows)
            if not count:
                continue
            if carried or too_short:
                times = table.time_ns[group.rows]
                stamps[slot] = int(times.min()), int(times.max())
            log.messages[plan.name] = MessageCount(count, *stamps[slot], short, longer, len(carried))
            if not plan.from_sources:
                head = self._head(plan, plan.name, None)
                log.rows[plan.name] = group.rows
                heads.append(head)
                parts.append((plan, group))
                continue
            for head, one in self._by_source(plan, group, table, assigned):
                log.rows[head.name] = one.rows
                heads.append(head)
                parts.append((plan, one))
        log.several_channels = self._assigner.several_channels
        if fast:
            found = extract_all(parts, assigned.first)
        else:
            found = [[work_out(piece) for piece in pieces_of(plan, group)] for plan, group in parts]
        for head, signals in zip(heads, found, strict=True):
            head.add(log, signals)

    def _by_source(
        self, plan: MessagePlan, group: Group, table: FrameTable, assigned: Assigned
    ) -> Iterator[tuple["_Head", Group]]:
        """Frames of a J1939 message by the name of their columns."""
        sources = (table.can_id[group.rows] & 0xFF).astype(np.uint8)
        if sources.min() == sources.max():
            source = int(sources[0])
            yield self._head(plan, self._sources.name(plan.name, source), source), group
            return
        order, parts = self._sources.split(plan.name, sources)
        sorted_group = group.take(order)
        if group.begin is not None:  # sorted in place, so that each source is a piece of the assigned words, too
            assigned.first[group.begin : group.begin + len(order)] = sorted_group.plane(0)
        for part in parts:
            begin = None if group.begin is None else group.begin + part.begin
            yield self._head(plan, part.name, part.source), sorted_group.cut(part.begin, part.end, begin)

    def _head(self, plan: MessagePlan, name: str, source: int | None) -> "_Head":
        if name not in self._heads:
            self._heads[name] = _Head(plan, name, source, self._lookup.wanted)
        return self._heads[name]

    def _note(self, log: DecodedLog) -> None:
        for name, count in log.messages.items():
            for few, what in ((count.short, "shorter"), (count.longer, "longer")):
                if few:
                    self._odd.setdefault(f"{name}: frames {what} than the database says", None)
        log.notes = (*self._lookup.notes, *self._sources.notes.values(), *self._odd)


@contextmanager
def _uncollected() -> Iterator[None]:
    """Spare the garbage collector a look at each of up to a hundred thousand new columns; none is in a cycle."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


class _Head:
    """Columns of one message (from one source), table after table."""

    def __init__(self, plan: MessagePlan, name: str, source: int | None, wanted: Wanted) -> None:
        self.name = name
        self._source = source
        self._signals = [one.signal for one in plan.signals]
        self._columns = [f"{name}.{one.name}" if wanted.takes_from(name, one.name) else None for one in self._signals]
        self._n, self._sna, self._outside = ([0] * len(self._signals) for _ in range(3))

    def add(self, log: DecodedLog, signals: list[Found]) -> None:
        """Put the columns of a table into its result."""
        columns, counts = log.columns, log.signals
        for place, rows, values, n, sna, outside in signals:
            name = self._columns[place]
            if name is not None:
                columns[name] = Column(self._signals[place], rows, values, self._source)
                counts[name] = SignalCount(n, sna, outside)
                self._n[place] += n
                self._sna[place] += sna
                self._outside[place] += outside

    def totals(self) -> dict[str, SignalCount]:
        """Counts of all tables so far."""
        counts = map(SignalCount, self._n, self._sna, self._outside)
        return {name: count for name, count in zip(self._columns, counts, strict=True) if name is not None}
