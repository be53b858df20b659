"""One table of a log decoded, with the counts that are added up over all tables."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dbc.database import Signal
from hil.log.blocks import Block, Rows
from hil.log.databases import Databases
from hil.log.decode import SNA, Column, DecodedLog, Values, decode_log
from hil.log.frames import FrameTable, Recording


@dataclass(frozen=True, slots=True)
class MessageCount:
    """How often a message was decoded, and its least and greatest stamp, ns."""

    count: int
    first_ns: int
    last_ns: int

    @property
    def rate_hz(self) -> float | None:
        """Mean rate; None for a single frame."""
        span = self.last_ns - self.first_ns
        return (self.count - 1) * 1e9 / span if span > 0 else None

    def __add__(self, other: "MessageCount") -> "MessageCount":
        first, last = min(self.first_ns, other.first_ns), max(self.last_ns, other.last_ns)
        return MessageCount(self.count + other.count, first, last)


@dataclass(frozen=True, slots=True)
class SignalCount:
    """How often a signal came: ``n`` frames hold it, ``sna`` of them without a value, ``out_of_range`` outside."""

    n: int
    sna: int = 0
    out_of_range: int = 0

    def __add__(self, other: "SignalCount") -> "SignalCount":
        return SignalCount(self.n + other.n, self.sna + other.sna, self.out_of_range + other.out_of_range)


@dataclass(slots=True, eq=False)
class Chunk:
    """A table decoded; ``columns`` and ``rows`` (frames of each message) index it."""

    table: FrameTable
    decoded: int
    unknown: int
    rejected: int
    reasons: Counter[str]
    messages: dict[str, MessageCount]
    signals: dict[str, SignalCount]
    columns: dict[str, Column]
    rows: dict[str, Rows]


def decode_chunk(table: FrameTable, databases: Databases) -> Chunk:
    """Decode one table."""
    log = decode_log(Recording(Path(), "", table), {name: databases.of(name) for name in table.channels})
    return chunk_of(log)


def chunk_of(log: DecodedLog) -> Chunk:
    """Return a decoded log as one chunk."""
    table = log.recording.frames
    parts: dict[str, list[Rows]] = {name: [] for name in log.messages}
    for name, column in log.columns.items():
        parts[name.rpartition(".")[0]].append(column.rows)
    rows = {name: _union(some) for name, some in parts.items()}
    messages = {}
    for name, message in log.messages.items():
        times = table.time_ns[rows[name]]
        span = (int(times.min()), int(times.max())) if len(times) else (0, 0)
        messages[name] = MessageCount(message.count, *span)
    signals = {}
    for name, column in log.columns.items():
        n, sna = len(column.values), 0
        if column.signal.multiplexer is None and SNA in column.signal.choices.values():
            sna = log.messages[name.rpartition(".")[0]].count - n
        signals[name] = SignalCount(n + sna, sna, _out_of_range(column.values, column.signal))
    return Chunk(table, log.decoded, log.unknown, log.rejected, log.reasons, messages, signals, log.columns, rows)


def blocks_of(tables: Iterable[FrameTable], databases: Databases) -> Iterator[Block]:
    """Yield the signals of tables as rows to be written, one row per frame."""
    for table in tables:
        chunk = decode_chunk(table, databases)
        columns = {name: (column.rows, column.values) for name, column in chunk.columns.items()}
        yield Block(table.time_ns, table.channel, table.channels, columns, chunk.rows)


def _union(parts: list[Rows]) -> Rows:
    longest = max(parts, key=len, default=np.zeros(0, np.int64))
    others = [part for part in parts if len(part) < len(longest)]
    return np.unique(np.concatenate([longest, *others])) if others else longest


def _out_of_range(values: Values, signal: Signal) -> int:
    """Values outside the stated range by more than half a step; a named value is meant to be there."""
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or low == high or not len(values):
        return 0
    half = 1e-9 if signal.is_float else abs(float(signal.factor)) / 2
    outside = ~((values >= low - half) & (values <= high + half))
    if outside.any() and signal.choices:
        outside &= ~np.isin(values, [raw * float(signal.factor) + float(signal.offset) for raw in signal.choices])
    return int(np.count_nonzero(outside))
