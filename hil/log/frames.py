"""Recorded frames as columns: one numpy array per property, one row per frame."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntFlag
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from hil.errors import BrakebenchError

MAX_STANDARD_ID = 0x7FF
MAX_EXTENDED_ID = 0x1FFFFFFF
FD_CODES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)  # data bytes by length code
FD_LENGTHS = frozenset(FD_CODES)


class FrameFlag(IntFlag):
    """What a frame is beside a plain classical data frame that was received."""

    REMOTE = 1
    ERROR = 2
    FD = 4
    BIT_RATE_SWITCH = 8
    ERROR_STATE = 16
    SENT = 32  # by the recorder itself (Tx)


NO_FLAG = FrameFlag(0)


class LogError(BrakebenchError):
    """A log that cannot be read or written: which file, where in it (byte offset, where known), and why."""

    def __init__(self, path: Path | str, problem: str, offset: int | None = None) -> None:
        where = "" if offset is None else f" at byte {offset}"
        super().__init__(f"{path}{where}: {problem}")
        self.path = Path(path)
        self.offset = offset


@dataclass(frozen=True, slots=True, eq=False)
class FrameTable:
    """Frames in the order of the log.

    Attributes
    ----------
    channels : channel names; ``channel`` indexes them.
    time_ns : int64 (n,), the log's own time stamps, ns; since 1970 where the log has a start time.
    channel : int32 (n,).
    can_id : uint32 (n,), without flag bits; for an error frame the error class.
    extended : bool (n,), 29-bit identifier; False for an error frame.
    length : uint8 (n,), data bytes; of a remote frame the requested number.
    data : uint8 (n, 8), or (n, 64) where a CAN FD frame is longer than 8 bytes; zero behind ``length``.
    flags : uint8 (n,), bits of `FrameFlag`.
    """

    channels: tuple[str, ...]
    time_ns: npt.NDArray[np.int64]
    channel: npt.NDArray[np.int32]
    can_id: npt.NDArray[np.uint32]
    extended: npt.NDArray[np.bool_]
    length: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint8]
    flags: npt.NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.time_ns)

    @classmethod
    def empty(cls, n: int = 0, width: int = 8, channels: tuple[str, ...] = ()) -> Self:
        """Return a table of ``n`` zeroed rows, to be filled in."""
        return cls(
            channels,
            np.zeros(n, np.int64),
            np.zeros(n, np.int32),
            np.zeros(n, np.uint32),
            np.zeros(n, np.bool_),
            np.zeros(n, np.uint8),
            np.zeros((n, width), np.uint8),
            np.zeros(n, np.uint8),
        )

    @classmethod
    def joined(cls, parts: Sequence[Self], channels: Iterable[str]) -> Self:
        """Join tables that share one channel numbering."""
        names = tuple(channels)
        if not parts:
            return cls.empty(channels=names)
        width = max(part.data.shape[1] for part in parts)
        data = [part.widened(width).data for part in parts]
        return cls(
            names,
            np.concatenate([part.time_ns for part in parts]),
            np.concatenate([part.channel for part in parts]),
            np.concatenate([part.can_id for part in parts]),
            np.concatenate([part.extended for part in parts]),
            np.concatenate([part.length for part in parts]),
            np.concatenate(data),
            np.concatenate([part.flags for part in parts]),
        )

    def take(self, rows: npt.NDArray[np.int64] | npt.NDArray[np.bool_] | slice) -> Self:
        """Return the table of the chosen rows."""
        return type(self)(
            self.channels,
            self.time_ns[rows],
            self.channel[rows],
            self.can_id[rows],
            self.extended[rows],
            self.length[rows],
            self.data[rows],
            self.flags[rows],
        )

    def widened(self, width: int) -> Self:
        """Return the table with at least ``width`` columns of data."""
        missing = width - self.data.shape[1]
        if missing <= 0:
            return self
        data = np.pad(self.data, ((0, 0), (0, missing)))
        return type(self)(
            self.channels, self.time_ns, self.channel, self.can_id, self.extended, self.length, data, self.flags
        )

    def to_arrow(self) -> Any:
        """Return a pyarrow.Table: time (timestamp[ns]), channel, id, extended, length, flags, data (binary).

        ``.to_pandas()`` of it is the data frame.
        """
        import pyarrow as pa

        width = self.data.shape[1]
        shown = np.where(self.flags & FrameFlag.REMOTE, 0, self.length).astype(np.int64)
        offsets = np.concatenate(([0], np.cumsum(shown))).astype(np.int32)
        held = self.data[np.arange(width) < shown[:, None]]
        data = pa.Array.from_buffers(pa.binary(), len(self), [None, pa.py_buffer(offsets), pa.py_buffer(held)])
        return pa.table(
            {
                "time": pa.array(self.time_ns, pa.timestamp("ns")),
                "channel": pa.DictionaryArray.from_arrays(self.channel, pa.array(list(self.channels), pa.string())),
                "id": self.can_id,
                "extended": self.extended,
                "length": self.length,
                "flags": self.flags,
                "data": data,
            }
        )


@dataclass(frozen=True, slots=True)
class Rejected:
    """One piece of a log that is no frame: its byte offset and what stands there, escaped."""

    offset: int
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """What a log file held, all of it in memory.

    Attributes
    ----------
    path, format : the file and its format ("candump", "asc", ...).
    frames : the frames, in the file's order.
    rejected : lines (or objects) that should be a frame and are none.
    first_rejected : the first of them.
    truncated_at : byte offset from which the file is cut off, None where it is whole.
    start_ns : start time that the log states, ns since 1970; None where it states none.
    notes : what the reader should know (an assumed time zone, say).
    """

    path: Path
    format: str
    frames: FrameTable
    rejected: int = 0
    first_rejected: tuple[Rejected, ...] = ()
    truncated_at: int | None = None
    start_ns: int | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LogFacts:
    """What a writer must know of all frames before it writes the first one.

    Attributes
    ----------
    channels : channel names, in the numbering of the tables.
    frames : number of frames.
    start_ns : start time that the source states, None where it states none.
    first_ns, least_ns, last_ns : stamp of the first frame, the least and the greatest stamp; 0 without a frame.
    flags : bits of `FrameFlag` that any frame has.
    errors : number of error frames.
    finer_than_us : a stamp is no whole number of microseconds.
    longest : most data bytes of a frame.
    """

    channels: tuple[str, ...] = ()
    frames: int = 0
    start_ns: int | None = None
    first_ns: int = 0
    least_ns: int = 0
    last_ns: int = 0
    flags: FrameFlag = NO_FLAG
    errors: int = 0
    finer_than_us: bool = False
    longest: int = 0

    @classmethod
    def of(cls, tables: Iterable[FrameTable]) -> Self:
        """Look through the frames of a log; what start time it states, its tables do not tell."""
        channels: tuple[str, ...] = ()
        frames = errors = longest = bits = 0
        first = least = last = 0
        fine = False
        for table in tables:
            channels = table.channels
            if not len(table):
                continue
            low, high = int(table.time_ns.min()), int(table.time_ns.max())
            first = first if frames else int(table.time_ns[0])
            least, last = (min(least, low), max(last, high)) if frames else (low, high)
            frames += len(table)
            bits |= int(np.bitwise_or.reduce(table.flags))
            errors += int(np.count_nonzero(table.flags & FrameFlag.ERROR))
            longest = max(longest, int(table.length.max()))
            fine = fine or bool((table.time_ns % 1000).any())
        return cls(channels, frames, None, first, least, last, FrameFlag(bits), errors, fine, longest)
