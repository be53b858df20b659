"""Signals of a log as columns, and the account of its frames."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from dbc.database import Signal
from hil.log.frames import Recording

Values = npt.NDArray[np.float64] | npt.NDArray[np.int64] | npt.NDArray[np.uint64]
Rows = npt.NDArray[np.int64]


@dataclass(slots=True, eq=False)
class Column:
    """One signal of a log: ``values`` in the DBC's own unit at the frames ``rows`` (ascending).

    ``source`` is the J1939 address it came from, None for a message that is known by its whole identifier.
    """

    signal: Signal
    rows: Rows
    values: Values
    source: int | None = None

    def names(self) -> npt.NDArray[np.object_]:
        """Names that the database gives the values: str, None where it gives none."""
        codes, texts = self._coded()
        return np.array([*texts, None], object)[codes]

    def to_arrow_names(self) -> Any:
        """Return the names as a pyarrow.DictionaryArray, null where a value has none."""
        import pyarrow as pa

        codes, texts = self._coded()
        indices = pa.array(codes.astype(np.int32), mask=codes == len(texts))
        return pa.DictionaryArray.from_arrays(indices, pa.array(texts, pa.string()))

    def _coded(self) -> tuple[Rows, list[str]]:
        """Index into the names for each value; one past the last where it has none."""
        named = _physical_names(self.signal, self.values.dtype)
        texts = list(dict.fromkeys(named.values()))
        number = {text: i for i, text in enumerate(texts)}
        known = np.array(sorted(named), self.values.dtype)
        codes = np.array([*(number[named[v]] for v in known.tolist()), len(texts)], np.int64)
        at = np.searchsorted(known, self.values)
        inside = np.minimum(at, max(0, len(known) - 1))
        found = known[inside] == self.values if len(known) else np.zeros(len(self.values), np.bool_)
        return codes[np.where(found, inside, len(known))], texts


def _physical_names(signal: Signal, dtype: np.dtype[Any]) -> dict[Any, str]:
    """Names by physical value, computed as the values are; of two raw values with one physical the first counts."""
    low, high = (0, 2**64) if dtype == np.uint64 else (-(2**63), 2**63)
    named: dict[Any, str] = {}
    for raw, text in signal.choices.items():
        if dtype == np.float64:
            value: Any = float(raw) * float(signal.factor) + float(signal.offset)
            if value != value:
                continue
        else:
            value = raw * int(signal.factor) + int(signal.offset)
            if not low <= value < high:
                continue
        named.setdefault(value, text)
    return named


@dataclass(frozen=True, slots=True)
class MessageCount:
    """How often a message was decoded.

    Attributes
    ----------
    count : how often, transported ones included.
    first_ns, last_ns : the least and the greatest stamp.
    short : of them shorter than the database says, so that signals are missing.
    longer : of them longer than the database says (and than the CAN FD length that holds it).
    transported : of them joined from J1939 transport frames.
    """

    count: int
    first_ns: int = 0
    last_ns: int = 0
    short: int = 0
    longer: int = 0
    transported: int = 0

    @property
    def rate_hz(self) -> float | None:
        """Mean rate; None for a single frame."""
        span_ns = self.last_ns - self.first_ns
        return (self.count - 1) * 1e9 / span_ns if span_ns > 0 else None

    def __add__(self, other: "MessageCount") -> "MessageCount":
        return MessageCount(
            self.count + other.count,
            min(self.first_ns, other.first_ns),
            max(self.last_ns, other.last_ns),
            self.short + other.short,
            self.longer + other.longer,
            self.transported + other.transported,
        )


class SignalCount(NamedTuple):
    """How often a signal came: ``n`` frames hold it, ``sna`` of them without a value ("signal not available").

    ``out_of_range`` of the values lie outside the range of the database, by more than a hundredth of a step, so that
    rounding does not count. Not-a-number counts; a value that the database names ("error") is meant to be there.
    """

    n: int
    sna: int = 0
    out_of_range: int = 0


@dataclass(slots=True)
class TransportCount:
    """What came by the J1939 transport protocol.

    Attributes
    ----------
    frames : TP.CM and TP.DT frames; they count as decoded.
    joined : messages put together.
    broken : transfers that came to nothing, by reason.
    unknown : joined messages whose parameter group no database has, by "channel PGN 0xFECA".
    open : transfers under way where the log (or what was read of it) ends.
    """

    frames: int = 0
    joined: int = 0
    broken: Counter[str] = field(default_factory=Counter)
    unknown: Counter[str] = field(default_factory=Counter)
    open: int = 0


@dataclass(slots=True, eq=False)
class DecodedCounts:
    """An account of every frame: frames = decoded + unknown + rejected.

    Attributes
    ----------
    frames : frames in the log, malformed ones included.
    decoded : frames of a message of the database, and J1939 transport frames.
    unknown : well-formed frames that the database does not describe, remote and error frames among them.
    rejected : malformed frames, and frames too short for every signal of their message.
    reasons : why frames were rejected.
    unknown_ids : number of frames by what they are: "channel 0x123", "error frame", ...; a bounded number of
        identifiers, the rest as "other identifiers".
    messages : counts by message name.
    signals : counts by "MESSAGE.SIGNAL".
    transport : J1939 transfers.
    several_channels : a message came on more than one channel.
    notes : what else the reader should know.
    """

    frames: int = 0
    decoded: int = 0
    unknown: int = 0
    rejected: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    unknown_ids: Counter[str] = field(default_factory=Counter)
    messages: dict[str, MessageCount] = field(default_factory=dict)
    signals: dict[str, SignalCount] = field(default_factory=dict)
    transport: TransportCount = field(default_factory=TransportCount)
    several_channels: bool = False
    notes: tuple[str, ...] = ()

    def merge(self, other: "DecodedCounts") -> Self:
        """Add the account of further frames (not the counts of signals); notes and open transfers are the last ones."""
        self.frames += other.frames
        self.decoded += other.decoded
        self.unknown += other.unknown
        self.rejected += other.rejected
        self.reasons.update(other.reasons)
        self.unknown_ids.update(other.unknown_ids)
        for name, message in other.messages.items():
            self.messages[name] = self.messages[name] + message if name in self.messages else message
        mine, its = self.transport, other.transport
        mine.frames += its.frames
        mine.joined += its.joined
        mine.broken.update(its.broken)
        mine.unknown.update(its.unknown)
        mine.open = its.open
        self.several_channels |= other.several_channels
        self.notes = other.notes
        return self


@dataclass(slots=True, eq=False)
class DecodedLog(DecodedCounts):
    """Signals of a log (or of one table of it), with the account of its frames.

    Attributes
    ----------
    recording : the frames.
    columns : signals by "MESSAGE.SIGNAL", an empty one too where the message came but not the signal; see
        `hil.log.signals.decode` for the names where that alone is not clear. The values lie in one memory that the
        columns share: a copy of one column lets go of all others.
    rows : frames of each message (of each source of a J1939 message), ascending, by the name that its columns have
        before the point.
    """

    recording: Recording = field(kw_only=True)
    columns: dict[str, Column] = field(default_factory=dict)
    rows: dict[str, Rows] = field(default_factory=dict)
    _time_s: npt.NDArray[np.float64] | None = field(default=None, init=False, repr=False)

    @property
    def time_s(self) -> npt.NDArray[np.float64]:
        """Time stamps of the well-formed frames, s; `Column.rows` index it."""
        if self._time_s is None:
            self._time_s = np.asarray(self.recording.frames.time_ns / 1e9, np.float64)
        return self._time_s

    def series(self, name: str) -> tuple[npt.NDArray[np.float64], Values]:
        """Times (s) and values of one column, ``MESSAGE.SIGNAL``; KeyError where the log has none."""
        column = self.columns[name]
        return self.time_s[column.rows], column.values

    def table(self, message: str, names: bool = False) -> Any:
        """Return a pyarrow.Table of one message: ``time`` (timestamp[ns]), then a column a signal, null where absent.

        Parameters
        ----------
        message : key of `rows`; KeyError where the log has none.
        names : after each signal whose values have names, a column ``SIGNAL.name`` follows with them.

        Fields carry the unit as metadata. ``.to_pandas()`` of it is the data frame.
        """
        import pyarrow as pa

        rows = self.rows[message]
        arrays = [pa.array(self.recording.frames.time_ns[rows], pa.timestamp("ns"))]
        fields = [pa.field("time", arrays[0].type, nullable=False)]
        for name, column in self.columns.items():
            group, _, signal = name.rpartition(".")
            if group != message:
                continue
            everywhere = len(column.rows) == len(rows)
            at = np.searchsorted(column.rows, rows) if not everywhere else None
            if at is not None:
                found = np.minimum(at, max(0, len(column.rows) - 1))
                there = column.rows[found] == rows if len(column.rows) else np.zeros(len(rows), np.bool_)
                at = pa.array(found, mask=~there)
            one = pa.array(column.values)
            arrays.append(one if at is None else one.take(at))
            fields.append(pa.field(signal, one.type, metadata={"unit": column.signal.unit}))
            if names and column.signal.choices:
                texts = column.to_arrow_names()
                arrays.append(texts if at is None else texts.take(at))
                fields.append(pa.field(f"{signal}.name", texts.type))
        return pa.Table.from_arrays(arrays, schema=pa.schema(fields))
