"""Recorded frames as columns: one numpy array per property, one row per frame."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntFlag
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from hil.errors import BrakebenchError

MAX_STANDARD_ID = 0x7FF
MAX_EXTENDED_ID = 0x1FFFFFFF
FD_CODES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)  # data bytes by length code
FD_LENGTHS = frozenset(FD_CODES)
FIRST_REJECTED = 10  # how many rejected pieces are shown


class FrameFlag(IntFlag):
    """What a frame is beside a plain classical data frame."""

    REMOTE = 1
    ERROR = 2
    FD = 4
    BIT_RATE_SWITCH = 8
    ERROR_STATE = 16


class LogError(BrakebenchError):
    """A log that cannot be read: which file, where in it (byte offset, where known), and why."""

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
    time_ns : int64 (n,), the log's own time stamps, ns.
    channel : int32 (n,).
    can_id : uint32 (n,), without flag bits; for an error frame the error class.
    extended : bool (n,), 29-bit identifier.
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
        data = [np.pad(part.data, ((0, 0), (0, width - part.data.shape[1]))) for part in parts]
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


@dataclass(frozen=True, slots=True)
class Rejected:
    """One piece of a log that is no frame: its byte offset and what stands there, escaped."""

    offset: int
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """What a log file held.

    Attributes
    ----------
    path, format : the file and its format ("candump", "asc", ...).
    frames : the frames, in the file's order.
    rejected : lines (or objects) that should be a frame and are none.
    first_rejected : the first of them.
    truncated_at : byte offset from which the file is cut off, None where it is whole.
    """

    path: Path
    format: str
    frames: FrameTable
    rejected: int = 0
    first_rejected: tuple[Rejected, ...] = ()
    truncated_at: int | None = None


class FrameBuilder:
    """Collects frames one at a time where a format leaves no other way.

    What no CAN frame can be is rejected: identifiers out of range, wrong lengths, stamps that are no time.
    """

    def __init__(self) -> None:
        self.rejected = 0
        self.first_rejected: list[Rejected] = []
        self._channels: dict[str, int] = {}
        self._rows: list[tuple[int, int, int, bool, int, int]] = []
        self._data: list[bytes] = []

    def add(
        self, time_ns: int, channel: str, can_id: int, extended: bool, data: bytes, flags: FrameFlag, length: int
    ) -> bool:
        """Add a frame; False (and nothing added) where it can be none. ``length`` counts for remote frames only."""
        remote = bool(flags & FrameFlag.REMOTE)
        limit = MAX_EXTENDED_ID if extended or flags & FrameFlag.ERROR else MAX_STANDARD_ID
        size = length if remote else len(data)
        sound = size in FD_LENGTHS if flags & FrameFlag.FD else 0 <= size <= 8
        if not (sound and 0 <= can_id <= limit and 0 <= time_ns < 2**63):
            return False
        number = self._channels.setdefault(channel, len(self._channels))
        self._rows.append((time_ns, number, can_id, extended, size, int(flags)))
        self._data.append(b"" if remote else data)
        return True

    def reject(self, offset: int, text: str) -> None:
        """Count something that should be a frame and is none."""
        self.rejected += 1
        if len(self.first_rejected) < FIRST_REJECTED:
            self.first_rejected.append(Rejected(offset, text[:80].encode("ascii", "backslashreplace").decode()))

    def recording(self, path: Path, form: str, truncated_at: int | None = None) -> Recording:
        """Return what was collected."""
        width = 64 if any(len(d) > 8 for d in self._data) else 8
        n = len(self._rows)
        rows = np.array(self._rows, np.int64).reshape(n, 6)
        data = np.frombuffer(b"".join(d.ljust(width, b"\0") for d in self._data), np.uint8).reshape(n, width)
        frames = FrameTable(
            tuple(self._channels),
            rows[:, 0].copy(),
            rows[:, 1].astype(np.int32),
            rows[:, 2].astype(np.uint32),
            rows[:, 3].astype(np.bool_),
            rows[:, 4].astype(np.uint8),
            data,
            rows[:, 5].astype(np.uint8),
        )
        return Recording(path, form, frames, self.rejected, tuple(self.first_rejected), truncated_at)
