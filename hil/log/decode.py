"""Frames to signals: grouped by message, cut out of 64-bit words.

Columns are called "MESSAGE.SIGNAL". Where a name alone is not clear it gets a suffix:

- Two databases use one name for different messages: that of the later one is "MESSAGE@CHANNEL" (where the databases
  are given by channel) or "MESSAGE@FILE".
- Several nodes send one J1939 message: the columns of the first source address of the log keep the plain name, those
  of the others are "EEC1@17.EngineSpeed" (hexadecimal), since one signal of two nodes is two signals, as in the channel
  groups by source address of other tools. `DecodedLog.messages` counts all of them as "EEC1".

A J1939 message (``Message.pgn_match``) stands for its parameter group whatever the priority, the source address and
(below PDU format 240) the destination. On a channel with such messages transport frames are joined, see
`hil.log.j1939`.
"""

from collections import Counter
from collections.abc import Collection
from functools import cache
from pathlib import Path

import numpy as np

from dbc.contract import database_text
from dbc.database import Database, parse_database
from dbc.frame import BusName
from hil.log.assign import Assigned, Assigner
from hil.log.decoded import (
    Column,
    DecodedCounts,
    DecodedLog,
    MessageCount,
    SignalCount,
    TransportCount,
    Values,
)
from hil.log.extract import Group, Piece, pieces_of, work_out_all
from hil.log.frames import FrameTable, Recording
from hil.log.j1939 import Joined, Transport
from hil.log.lookup import Databases, Lookup
from hil.log.signal_plan import SNA, MessagePlan, Words
from hil.log.sources import Sources
from hil.log.unknown_ids import KEPT, OTHERS

__all__ = [
    "NOT_A_FRAME", "SNA", "TOO_SHORT", "Column", "Databases", "DecodedCounts", "DecodedLog", "Decoder", "MessageCount",
    "SignalCount", "TransportCount", "Values", "decode_log", "own_databases",
]  # fmt: skip

TOO_SHORT = "shorter than the message in the DBC"
NOT_A_FRAME = "not a frame"
FEW_FRAMES = 20_000
"""Up to here numpy is done before the compiled passes are loaded."""


@cache
def own_databases() -> dict[str, Database]:
    """Our two databases, by the channel name that our recordings give their bus."""
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
        channel name (a channel that is not named has that of "vehicle", or else none). None takes our own two.
    wanted : messages ("MESSAGE") and signals ("MESSAGE.SIGNAL") that become columns, ``*`` and ``?`` stand for any
        letters; None takes all. Frames are counted either way.
    fast : False never uses the compiled passes, True always, None from `FEW_FRAMES` on. The results are the same.

    Attributes
    ----------
    totals : the account of all tables so far.
    unmatched : wanted names that no message or signal of the databases has.

    >>> decoder = Decoder(database, wanted=["WHEELS.*"])  # doctest: +SKIP
    >>> with open_log("drive.blf") as log:
    ...     for table in log.tables():
    ...         time_s, speed = decoder.add(table).series("WHEELS.FL")
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
        self.totals = DecodedCounts(notes=tuple(self._lookup.notes))
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
        if self._fast is None and self.totals.frames + len(table) > FEW_FRAMES:
            self._fast = True
        fast = bool(self._fast)
        log = DecodedLog(
            recording=Recording(Path(), "", table),
            time_s=np.asarray(table.time_ns / 1e9, np.float64),
            frames=len(table),
            notes=self.totals.notes,
        )
        if len(table):
            words = _words(table)
            assigned = self._assigner.assign(table, words, fast)
            self._count_others(log, assigned)
            joined = self._joined(log, table, assigned)
            with np.errstate(over="ignore", invalid="ignore"):  # a floating-point signal may hold anything
                self._decode(log, table, words, assigned, joined, fast)
            self._note(log)
        self.totals.merge(log)
        return log

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
                group = f"{name} PGN {one.can_id >> 8 & 0x3FFFF:#06x}"
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
        log.transport.open = self._transport.open
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
        parts: list[tuple[MessagePlan, list[Piece]]] = []
        heads: list[tuple[str, int | None]] = []
        came = set(np.flatnonzero(np.diff(assigned.starts[:-1])).tolist()) | set(joined)
        for slot in sorted(came):
            plan = self._lookup.plan(slot)
            group, too_short = _frames_of(slot, plan, table, words, assigned)
            if too_short:
                log.rejected += too_short
                log.reasons[TOO_SHORT] += too_short
            log.decoded += len(group.rows)
            short, longer = int(assigned.short[slot]) - too_short, int(assigned.longer[slot])
            carried = [one for one in joined.get(slot, ()) if len(one.data) >= plan.least]
            if carried:
                short += sum(len(one.data) < plan.message.length for one in carried)
                longer += sum(len(one.data) > plan.message.length for one in carried)
                group = _with_joined(group, carried, table, words)
            if not len(group.rows):
                continue
            times = table.time_ns[group.rows[[0, -1]] if assigned.ascending else group.rows]
            log.messages[plan.name] = MessageCount(
                len(group.rows), int(times.min()), int(times.max()), short, longer, len(carried)
            )
            if getattr(plan.message, "pgn_match", False):
                sources = (table.can_id[group.rows] & 0xFF).astype(np.uint8)
                for name, source, chosen in self._sources.split(plan.name, sources):
                    one = group if chosen is None else group.take(chosen)
                    log.rows[name] = one.rows
                    heads.append((name, source))
                    parts.append((plan, pieces_of(plan, one)))
            else:
                log.rows[plan.name] = group.rows
                heads.append((plan.name, None))
                parts.append((plan, pieces_of(plan, group)))
        log.several_channels = self._assigner.several_channels
        work_out_all(parts, fast, assigned.first)
        for (name, source), (_, pieces) in zip(heads, parts, strict=True):
            for piece in pieces:
                signal = piece.plan.signal
                if self._lookup.wanted.takes_from(name, signal.name):
                    full = f"{name}.{signal.name}"
                    log.columns[full] = Column(signal, piece.rows, piece.values, source)
                    log.signals[full] = SignalCount(piece.n, piece.sna, piece.outside)

    def _note(self, log: DecodedLog) -> None:
        for name, count in log.messages.items():
            for few, what in ((count.short, "shorter"), (count.longer, "longer")):
                if few:
                    self._odd.setdefault(f"{name}: frames {what} than the database says", None)
        log.notes = (*self._lookup.notes, *self._sources.notes.values(), *self._odd)


def _words(table: FrameTable) -> Words:
    """Payloads as words, as many a frame as its row of data has."""
    data = table.data
    if data.shape[1] % 8:
        data = np.pad(data, ((0, 0), (0, -data.shape[1] % 8)))
    return np.ascontiguousarray(data).reshape(-1).view("<u8").astype(np.uint64, copy=False)


def _frames_of(slot: int, plan: MessagePlan, table: FrameTable, words: Words, assigned: Assigned) -> tuple[Group, int]:
    """Frames of a message that hold a signal, and how many do not."""
    a, b = assigned.starts[slot : slot + 2].tolist()
    group = Group(assigned.rows[a:b], None, words, len(words) // len(table))
    group.put_plane(assigned.first[a:b], a)
    if assigned.least[slot] >= plan.full:
        return group, 0
    group.lengths = table.length[group.rows]
    if assigned.least[slot] >= plan.least:
        return group, 0
    group = group.take(np.flatnonzero(group.lengths >= plan.least))
    return group, b - a - len(group.rows)


def _with_joined(group: Group, joined: list[Joined], table: FrameTable, words: Words) -> Group:
    """Frames of a message and those that transport frames carried, in the order of the log."""
    padded = [one.data.ljust(-(-len(one.data) // 8) * 8, b"\0") for one in joined]
    further = np.frombuffer(b"".join(padded), "<u8").astype(np.uint64)
    begins = np.concatenate(([0], np.cumsum([len(one) // 8 for one in padded])))[:-1].astype(np.int64)
    stride = len(words) // len(table)
    own = words.reshape(-1, stride)[group.rows].reshape(-1)
    rows = np.concatenate((group.rows, np.array([one.row for one in joined], np.int64)))
    at = np.concatenate((np.arange(len(group.rows)) * stride, begins + len(own)))
    sizes = np.array([len(one.data) for one in joined], np.int64)
    lengths = np.concatenate((table.length[group.rows].astype(np.int64), sizes))
    order = np.argsort(rows, kind="stable")
    return Group(rows[order], lengths[order], np.concatenate((own, further)), stride, at[order])
