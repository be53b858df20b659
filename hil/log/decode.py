"""Frames to signals, vectorised: grouped by identifier, cut out of 64-bit words."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from dbc.contract import database_text
from dbc.database import Database, Message, Signal, parse_database
from dbc.frame import BusName
from hil.log.frames import FrameFlag, FrameTable, Recording

Values = npt.NDArray[np.float64] | npt.NDArray[np.int64] | npt.NDArray[np.uint64]

SNA = "SNA"  # a raw value of this name means "signal not available": an empty cell, not a number
TOO_SHORT = "shorter than the message in the DBC"
NOT_A_FRAME = "not a frame"


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One signal of a log: ``values`` in the DBC's own unit at the frames ``rows`` (ascending)."""

    signal: Signal
    rows: npt.NDArray[np.int64]
    values: Values


@dataclass(frozen=True, slots=True)
class MessageCount:
    """How often a message was decoded, and its mean rate (None for a single frame)."""

    count: int
    rate_hz: float | None


@dataclass(slots=True, eq=False)
class DecodedLog:
    """Signals of a log, and an account of every frame: frames = decoded + unknown + rejected.

    Attributes
    ----------
    time_s : time stamps of the well-formed frames, s; `Column.rows` index it.
    frames : frames in the log, malformed ones included.
    decoded : frames of a message of the database.
    unknown : well-formed frames that the database does not describe, remote and error frames among them.
    rejected : malformed frames, and frames shorter than their message: no signal is taken from those.
    reasons : why frames were rejected.
    unknown_ids : number of frames by what they are: "channel 0x123", "error frame", ...
    messages : count and rate by message name.
    columns : signals by "MESSAGE.SIGNAL".
    several_channels : a message came on more than one channel.
    """

    recording: Recording
    time_s: npt.NDArray[np.float64]
    frames: int
    decoded: int = 0
    unknown: int = 0
    rejected: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    unknown_ids: Counter[str] = field(default_factory=Counter)
    messages: dict[str, MessageCount] = field(default_factory=dict)
    columns: dict[str, Column] = field(default_factory=dict)
    several_channels: bool = False

    def series(self, name: str) -> tuple[npt.NDArray[np.float64], Values]:
        """Times (s) and values of one column, ``MESSAGE.SIGNAL``; KeyError where the log has none."""
        column = self.columns[name]
        return self.time_s[column.rows], column.values


@cache
def own_databases() -> dict[str, Database]:
    """Our two databases, by the channel name that our recordings give their bus."""
    return {bus.value: parse_database(database_text(bus), f"our {bus.value} database") for bus in BusName}


def decode_log(recording: Recording, databases: Database | Mapping[str, Database] | None = None) -> DecodedLog:
    """Decode a recording.

    Parameters
    ----------
    databases : one for all channels, or one by channel name (a channel that is not named has that of "vehicle",
        or else none); None takes our own two.
    """
    frames = recording.frames
    time_s = np.asarray(frames.time_ns / 1e9, np.float64)
    log = DecodedLog(recording, time_s, len(frames) + recording.rejected, rejected=recording.rejected)
    if recording.rejected:
        log.reasons[NOT_A_FRAME] = recording.rejected
    of_channel = _by_channel(frames.channels, own_databases() if databases is None else databases)
    distinct = list({id(d): d for d in of_channel if d is not None}.values())
    number = {id(d): i for i, d in enumerate(distinct)}
    index = np.array([len(distinct) if d is None else number[id(d)] for d in of_channel], np.int64)

    special = (frames.flags & (FrameFlag.REMOTE | FrameFlag.ERROR)) != 0
    _count_special(log, frames)
    rows = np.flatnonzero(~special)
    if not len(rows):
        return log
    key = index[frames.channel[rows]] << 32 | frames.extended[rows].astype(np.int64) << 31 | frames.can_id[rows]
    order = np.argsort(key, kind="stable")
    rows, key = rows[order], key[order]
    bounds = np.concatenate(([0], np.flatnonzero(np.diff(key)) + 1, [len(key)]))
    groups: dict[tuple[int, int, bool], npt.NDArray[np.int64]] = {}
    for a, b in pairwise(bounds):
        whole = int(key[a])
        groups[whole >> 32, whole & 0x1FFF_FFFF, bool(whole >> 31 & 1)] = rows[a:b]
    with np.errstate(over="ignore", invalid="ignore"):  # a floating-point signal may hold anything
        for i, database in enumerate(distinct):
            for (can_id, extended), message in database.messages.items():
                group = groups.pop((i, can_id, extended), None)
                if group is not None:
                    _decode_message(log, frames, message, group)
    for (_, can_id, extended), group in groups.items():
        _count_unknown(log, frames, can_id, extended, group)
    return log


def _by_channel(channels: tuple[str, ...], databases: Database | Mapping[str, Database]) -> list[Database | None]:
    if isinstance(databases, Database):
        return [databases] * len(channels)
    other = databases.get(BusName.VEHICLE.value)
    return [databases.get(name, other) for name in channels]


def _count_special(log: DecodedLog, frames: FrameTable) -> None:
    error = (frames.flags & FrameFlag.ERROR) != 0
    remote = ~error & ((frames.flags & FrameFlag.REMOTE) != 0)
    for name, mask in (("error frame", error), ("remote frame", remote)):
        count = int(mask.sum())
        if count:
            log.unknown += count
            log.unknown_ids[name] += count


def _count_unknown(
    log: DecodedLog, frames: FrameTable, can_id: int, extended: bool, rows: npt.NDArray[np.int64]
) -> None:
    log.unknown += len(rows)
    for channel, count in enumerate(np.bincount(frames.channel[rows])):
        if count:
            name = f"{can_id:#010x}" if extended else f"{can_id:#05x}"
            log.unknown_ids[f"{frames.channels[channel]} {name}"] += int(count)


def _decode_message(log: DecodedLog, frames: FrameTable, message: Message, rows: npt.NDArray[np.int64]) -> None:
    long_enough = frames.length[rows] >= message.length
    short = len(rows) - int(long_enough.sum())
    if short:
        log.rejected += short
        log.reasons[TOO_SHORT] += short
        rows = rows[long_enough]
    if not len(rows):
        return
    log.decoded += len(rows)
    channels = np.unique(frames.channel[rows])
    log.several_channels |= len(channels) > 1
    name = message.name
    if name in log.messages:  # two databases use the name for different messages
        name = f"{name}@{frames.channels[channels[0]]}"
    log.messages[name] = MessageCount(len(rows), _rate_hz(frames.time_ns[rows]))

    data = frames.data[rows]
    raw = {s.name: _raw(data, s) for s in message.signals}
    there = _presence(message, raw)
    for signal in message.signals:
        values, mask = raw[signal.name], there[signal.name]
        for number in [n for n, text in signal.choices.items() if text == SNA and not signal.is_float]:
            mask = (values != number) if mask is None else mask & (values != number)
        chosen = rows if mask is None else rows[mask]
        column = Column(signal, chosen, _physical(values if mask is None else values[mask], signal))
        log.columns[f"{name}.{signal.name}"] = column


def _rate_hz(time_ns: npt.NDArray[np.int64]) -> float | None:
    span_ns = int(time_ns.max()) - int(time_ns.min())
    return (len(time_ns) - 1) * 1e9 / span_ns if span_ns > 0 else None


def _presence(message: Message, raw: dict[str, Values]) -> dict[str, npt.NDArray[np.bool_] | None]:
    """Frames that hold each signal; None where all do. A multiplexer value no branch lists selects no branch."""
    by_name = {s.name: s for s in message.signals}
    found: dict[str, npt.NDArray[np.bool_] | None] = {}

    def mask(signal: Signal) -> npt.NDArray[np.bool_] | None:
        if signal.name not in found:
            selected = None
            if signal.multiplexer is not None:
                values = raw[signal.multiplexer]
                selected = np.zeros(len(values), np.bool_)
                limit = 2**64 if values.dtype == np.uint64 else 2**63
                for first, last in signal.mux_ranges:
                    if first < limit:
                        selected |= (values >= first) & (values <= min(last, limit - 1))
                parent = mask(by_name[signal.multiplexer])
                selected = selected if parent is None else selected & parent
            found[signal.name] = selected
        return found[signal.name]

    for signal in message.signals:
        mask(signal)
    return found


def _raw(data: npt.NDArray[np.uint8], signal: Signal) -> Values:
    """Raw values of a signal: int64, uint64 (unsigned of 64 bits) or float64.

    Eight bytes around the signal are read as one word of its byte order; a signal that touches nine bytes (CAN FD
    only) takes its last bits from the ninth.
    """
    first, length = signal.first_bit, signal.length
    byte = min(first // 8, data.shape[1] - 8)
    words = np.ascontiguousarray(data[:, byte : byte + 8]).view(">u8" if signal.big_endian else "<u8")
    word = words.ravel().astype(np.uint64)
    begin, over = first - 8 * byte, first - 8 * byte + length - 64
    if over > 0:
        ninth = data[:, byte + 8].astype(np.uint64)
        if signal.big_endian:
            word = word << np.uint64(over) | ninth >> np.uint64(8 - over)
        else:
            word = word >> np.uint64(begin) | ninth << np.uint64(64 - begin)
    else:
        word = word >> np.uint64(-over if signal.big_endian else begin)
    if signal.is_float:
        kinds = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}
        as_int, as_float = kinds[length]
        return word.astype(as_int).view(as_float).astype(np.float64)
    spare = np.uint64(64 - length)
    word = word << spare
    if signal.signed:
        return word.view(np.int64) >> np.int64(64 - length)
    word = word >> spare
    return word if length == 64 else word.view(np.int64)


def _physical(raw: Values, signal: Signal) -> Values:
    """Values in the DBC's unit: whole numbers stay integers where 64 bits hold them, all others are float64."""
    if not signal.is_integer:
        return np.asarray(raw * float(signal.factor) + float(signal.offset), np.float64)
    factor, offset = int(signal.factor), int(signal.offset)
    if factor == 1 and offset == 0:
        return raw
    bits = signal.length - signal.signed
    ends = [factor * (-(2**bits) if signal.signed else 0) + offset, factor * (2**bits - 1) + offset]
    if raw.dtype == np.int64 and min(*ends, offset, factor) >= -(2**63) and max(*ends, offset, factor) < 2**63:
        return np.asarray(raw * np.int64(factor) + np.int64(offset), np.int64)
    return np.asarray(raw * float(factor) + float(offset), np.float64)
