"""What a log holds by its databases: messages, signals and their ranges, end-to-end protection, unknown frames."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from dbc.database import Signal
from hil.log.frames import FrameFlag, FrameTable
from hil.log.signals.databases import Databases
from hil.log.signals.decode import DecodedCounts, DecodedLog
from hil.log.signals.decoded import Column
from hil.log.signals.integrity import Integrity, IntegrityCounter, has_profile_layout
from hil.log.summary.summary import BitRates, Statistics
from hil.log.summary.values import Summary

MAX_PROTECTED = 4096  # identifiers, over all channels


@dataclass(slots=True)
class SignalSummary:
    """One signal of a log.

    Attributes
    ----------
    message, signal : as the database has them; the message with its source address where several nodes send it.
    dtype : of its values.
    least, greatest : of the finite values, None without one.
    """

    message: str
    signal: Signal
    dtype: np.dtype[Any]
    least: float | int | None = None
    greatest: float | int | None = None

    def add(self, column: Column) -> None:
        """Look at the values of one table."""
        values = column.values
        finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
        if len(finite):
            least, greatest = finite.min().item(), finite.max().item()
            self.least = least if self.least is None else min(self.least, least)
            self.greatest = greatest if self.greatest is None else max(self.greatest, greatest)


class Contents:
    """Counts the tables of a log by its databases; all of it in memory that does not grow with the log.

    Parameters
    ----------
    wanted : messages and signals that `signals` has, as of `hil.log.signals.decode.Decoder`; None for all.
    bit_rates : of channels by name; a channel that is not named has that of "", else its database's.
    legacy : check end-to-end protection by the check value of older recordings.

    Attributes
    ----------
    signals : by ``MESSAGE.SIGNAL``, those that the log has.
    frames_of : frames of each message, those of each J1939 source apart.
    """

    def __init__(
        self,
        databases: Databases,
        wanted: Collection[str] | None = None,
        bit_rates: dict[str, BitRates] | None = None,
        legacy: bool = False,
    ) -> None:
        self.databases = databases
        self.signals: dict[str, SignalSummary] = {}
        self.frames_of: dict[str, int] = {}
        self._legacy = legacy
        self._bit_rates = bit_rates or {}
        self._statistics = Statistics(self._rates)
        self._decoder = databases.decoder(wanted)
        self._protected: dict[int, tuple[str, IntegrityCounter]] = {}
        self._channels_of: dict[str, set[int]] = {}
        self._names: tuple[str, ...] = ()

    @property
    def counts(self) -> DecodedCounts:
        """Account of the frames so far; put together anew at every call."""
        return self._decoder.totals

    def add(self, table: FrameTable) -> None:
        """Count further frames."""
        self._statistics.add(table)
        self._know_channels(table.channels)
        if not len(table):
            return
        log = self._decoder.add(table)
        self._note_rows(log, table)
        for name, column in log.columns.items():
            if name not in self.signals:
                self.signals[name] = SignalSummary(name.rpartition(".")[0], column.signal, column.values.dtype)
            self.signals[name].add(column)
        self._check_protection(table)

    def _note_rows(self, log: DecodedLog, table: FrameTable) -> None:
        for name, rows in log.rows.items():
            self.frames_of[name] = self.frames_of.get(name, 0) + len(rows)
            came_on = self._channels_of.setdefault(name, set())
            if len(table.channels) == 1:
                came_on.add(0)
            else:
                came_on.update(np.flatnonzero(np.bincount(table.channel[rows])).tolist())

    def _rates(self, channel: str) -> BitRates:
        given = self._bit_rates.get(channel) or self._bit_rates.get("")
        return given or (self.databases.bit_rate(channel), None)

    def _know_channels(self, channels: tuple[str, ...]) -> None:
        for number, channel in enumerate(channels[len(self._names) :], len(self._names)):
            if len(self._protected) >= MAX_PROTECTED:
                break
            for (can_id, extended), message in self.databases.of(channel).messages.items():
                data_id = message.e2e_data_id
                if data_id is not None and has_profile_layout(message) and len(self._protected) < MAX_PROTECTED:
                    counter = IntegrityCounter(data_id, message.length, self._legacy)
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
            message = self.databases.message(channel, can_id, extended)
            return round(message.cycle_time_ms * 1e6) if message is not None and message.cycle_time_ms else None

        return self._statistics.result(nominal_ns)

    def name(self, channel: str, can_id: int, extended: bool) -> str | None:
        """Name of the message that an identifier stands for, None where no database describes it."""
        message = self.databases.message(channel, can_id, extended)
        if message is not None:
            return message.name
        return "J1939 transport" if self.databases.joins(channel, can_id, extended) else None

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
