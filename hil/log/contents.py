"""What a log holds by its databases: messages, signals and their ranges, end-to-end protection, unknown frames."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dbc.contract import MessageSpec, contract
from dbc.database import Database, Message, Signal
from dbc.frame import BusName
from hil.log.choice import Choice
from hil.log.chunks import MessageCount, SignalCount, decode_chunk
from hil.log.databases import Databases
from hil.log.decode import Column
from hil.log.frames import FrameFlag, FrameTable
from hil.log.integrity import Integrity, IntegrityCounter, has_profile_layout
from hil.log.summary import BitRates, Statistics, Summary

NO_FRAMES = SignalCount(0)
MAX_PROTECTED = 65_535  # identifiers, over all channels


@dataclass(slots=True)
class SignalSummary:
    """One signal of a log.

    Attributes
    ----------
    message, signal : as the database has them.
    dtype : of its values.
    count : how often it came, and how often without a value or outside its range.
    least, greatest : of the finite values, None without one.
    """

    message: str
    signal: Signal
    dtype: np.dtype[Any]
    count: SignalCount = NO_FRAMES
    least: float | int | None = None
    greatest: float | int | None = None

    def add(self, column: Column, count: SignalCount) -> None:
        """Count the values of one table."""
        self.count += count
        values = column.values
        finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
        if len(finite):
            least, greatest = finite.min().item(), finite.max().item()
            self.least = least if self.least is None else min(self.least, least)
            self.greatest = greatest if self.greatest is None else max(self.greatest, greatest)


@dataclass(slots=True)
class Contents:
    """Counts the tables of a log by its databases; all of it in memory that does not grow with the log.

    Attributes
    ----------
    decoded, unknown, rejected : frames of a message, of none, and shorter than their message.
    errors, remotes : error frames and remote frames, which are among the unknown ones.
    messages, signals : by name; signals as ``MESSAGE.SIGNAL``, those of the choice that the log has.
    several_channels : a message came on more than one channel.
    """

    databases: Databases
    choice: Choice = field(default_factory=Choice)
    bit_rates: dict[str, BitRates] = field(default_factory=dict)
    bit_rate: BitRates = (None, None)
    legacy: bool = False
    fast: bool | None = None
    decoded: int = 0
    unknown: int = 0
    rejected: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    messages: dict[str, MessageCount] = field(default_factory=dict)
    signals: dict[str, SignalSummary] = field(default_factory=dict)
    several_channels: bool = False
    _statistics: Statistics | None = None
    _protected: dict[int, tuple[str, IntegrityCounter]] = field(default_factory=dict)
    _channels_of: dict[str, set[int]] = field(default_factory=dict)
    _by_group: dict[int, dict[int, Message]] = field(default_factory=dict)
    _names: tuple[str, ...] = ()

    def add(self, table: FrameTable) -> None:
        """Count further frames."""
        if self._statistics is None:
            self._statistics = Statistics(self._rates, self.fast)
        self._statistics.add(table)
        self._know_channels(table.channels)
        if not len(table):
            return
        chunk = decode_chunk(table, self.databases)
        self.decoded += chunk.decoded
        self.unknown += chunk.unknown
        self.rejected += chunk.rejected
        self.reasons.update(chunk.reasons)
        for name, count in chunk.messages.items():
            self.messages[name] = self.messages[name] + count if name in self.messages else count
            came_on = self._channels_of.setdefault(name, set())
            if len(table.channels) == 1:
                came_on.add(0)
            else:
                came_on.update(np.flatnonzero(np.bincount(table.channel[chunk.rows[name]])).tolist())
            self.several_channels |= len(came_on) > 1
        for name, column in chunk.columns.items():
            message, _, signal = name.rpartition(".")
            if self.choice.signal(message, signal):
                if name not in self.signals:
                    self.signals[name] = SignalSummary(message, column.signal, column.values.dtype)
                self.signals[name].add(column, chunk.signals[name])
        self._check_protection(table)

    def _rates(self, channel: str) -> BitRates:
        if channel in self.bit_rates:
            return self.bit_rates[channel]
        if self.bit_rate != (None, None):
            return self.bit_rate
        return getattr(self.databases.of(channel), "bit_rate", None), None

    def _know_channels(self, channels: tuple[str, ...]) -> None:
        for number, channel in enumerate(channels[len(self._names) :], len(self._names)):
            for (can_id, extended), message in self.databases.of(channel).messages.items():
                data_id = _data_id(self.databases, channel, message)
                if data_id is not None and has_profile_layout(message) and len(self._protected) < MAX_PROTECTED:
                    counter = IntegrityCounter(data_id, message.length, self.legacy)
                    self._protected[number << 32 | extended << 31 | can_id] = message.name, counter
        self._names = channels

    def _check_protection(self, table: FrameTable) -> None:
        if not self._protected:
            return
        known = np.array(sorted(self._protected), np.int64)
        rows = np.flatnonzero((table.flags & (FrameFlag.REMOTE | FrameFlag.ERROR)) == 0)
        key = table.channel[rows].astype(np.int64) << 32 | table.can_id[rows]
        key |= table.extended[rows].astype(np.int64) << 31
        place = np.minimum(np.searchsorted(known, key), len(known) - 1)
        mine = known[place] == key
        rows, number = rows[mine], place[mine].astype(np.uint16)  # small numbers are sorted ten times as fast
        order = np.argsort(number, kind="stable")
        rows = rows[order]
        bounds = np.concatenate(([0], np.cumsum(np.bincount(number, minlength=len(known)))))
        for k in np.flatnonzero(np.diff(bounds)).tolist():
            some = rows[bounds[k] : bounds[k + 1]]
            self._protected[int(known[k])][1].add(table.data[some], table.length[some])

    def summary(self) -> Summary:
        """Summary of the frames so far; cycle times stated by the databases are the nominal ones."""

        def nominal_ns(channel: str, can_id: int, extended: bool) -> int | None:
            message = self.message(channel, can_id, extended)
            return None if message is None else _cycle_ns(self.databases, channel, message)

        return (self._statistics or Statistics()).result(nominal_ns)

    def message(self, channel: str, can_id: int, extended: bool) -> Message | None:
        """Message of an identifier, None where no database describes it."""
        database = self.databases.of(channel)
        message = database.messages.get((can_id, extended))
        if message is None and extended:
            message = self._groups(database).get(_group(can_id))
        return message

    def _groups(self, database: Database) -> dict[int, Message]:
        """J1939 messages of a database by parameter group number, whatever address they come from."""
        if id(database) not in self._by_group:
            matched = [m for m in database.messages.values() if getattr(m, "pgn_match", False)]
            self._by_group[id(database)] = {_group(message.can_id): message for message in matched}
        return self._by_group[id(database)]

    def protection(self) -> dict[str, Integrity]:
        """End-to-end protection by message; what came on several channels is added up."""
        found: dict[str, Integrity] = {}
        for name, counter in self._protected.values():
            one = counter.result
            if one.received:
                found[name] = one if name not in found else found[name] + one
        return found

    def channel_of(self) -> dict[str, str]:
        """Channel of each message; several are named together."""
        return {name: ", ".join(self._names[number] for number in sorted(of)) for name, of in self._channels_of.items()}


def _group(can_id: int) -> int:
    """J1939 parameter group number: below PDU format 240 the low byte is a destination and no part of it."""
    group = can_id >> 8 & 0x3FFFF
    return group if group >> 8 & 0xFF >= 240 else group & 0x3FF00


def _own_spec(databases: Databases, channel: str, message: Message) -> MessageSpec | None:
    """Until the database itself tells cycle time and data id: those of our own messages."""
    if "our " not in databases.of(channel).source:
        return None
    return contract(BusName.BENCH if channel == BusName.BENCH.value else BusName.VEHICLE).by_id.get(message.can_id)


def _data_id(databases: Databases, channel: str, message: Message) -> int | None:
    spec = _own_spec(databases, channel, message)
    return getattr(message, "e2e_data_id", None) if spec is None else spec.data_id


def _cycle_ns(databases: Databases, channel: str, message: Message) -> int | None:
    spec = _own_spec(databases, channel, message)
    if spec is not None:
        return spec.cycle_ns or None
    cycle_ms = getattr(message, "cycle_time_ms", None)
    return round(cycle_ms * 1e6) if cycle_ms else None
