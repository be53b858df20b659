"""Frames being read: rows of preallocated columns, handed on as tables of bounded size."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hil.log.account import Account, printable
from hil.log.frames import FD_LENGTHS, MAX_EXTENDED_ID, MAX_STANDARD_ID, FrameFlag, FrameTable, Recording

ROWS = 65_536  # of one table
NAME_BYTES = 32  # of a channel name
FAST_NAMES = 64  # channel names that a compiled pass looks through

Columns = tuple[
    npt.NDArray[np.int64],
    npt.NDArray[np.int32],
    npt.NDArray[np.uint32],
    npt.NDArray[np.bool_],
    npt.NDArray[np.uint8],
    npt.NDArray[np.uint8],
    npt.NDArray[np.uint8],
]


class FrameBuilder:
    """Takes frames one at a time (`add`), or has a compiled pass write them (`fill`), and gives tables (`take`).

    What no CAN frame can be is refused: identifiers out of range, wrong lengths, stamps beyond 64 bits.

    Parameters
    ----------
    account : where rejected pieces are counted.
    rows : frames of one table.

    Attributes
    ----------
    columns : time_ns, channel, can_id, extended, length, data, flags, as in `FrameTable`, of `rows` rows each.
    n : rows filled.
    names, name_lengths : the first `FAST_NAMES` channel names as bytes (k, 32) and their lengths, for `fill`.
    """

    def __init__(self, account: Account | None = None, rows: int = ROWS) -> None:
        self.account = Account() if account is None else account
        self.rows = rows
        self.n = 0
        self.width = 8
        self.names: npt.NDArray[np.uint8] = np.zeros((0, NAME_BYTES), np.uint8)
        self.name_lengths: npt.NDArray[np.int64] = np.zeros(0, np.int64)
        self._channels: dict[str, int] = {}
        self.columns = self._fresh()

    def _fresh(self) -> Columns:
        n = self.rows  # not zeroed: every row is written whole
        return (
            np.empty(n, np.int64), np.empty(n, np.int32), np.empty(n, np.uint32), np.empty(n, np.bool_),
            np.empty(n, np.uint8), np.empty((n, self.width), np.uint8), np.empty(n, np.uint8),
        )  # fmt: skip

    @property
    def full(self) -> bool:
        """No row is left."""
        return self.n >= self.rows

    def channel(self, name: str) -> int:
        """Number of a channel; a new name gets the next one."""
        number = self._channels.get(name)
        if number is None:
            number = self._channels[name] = len(self._channels)
            if number < FAST_NAMES:  # length 0, which no name has, for one that the compiled pass cannot compare
                raw = name.encode() if name.isascii() and len(name) <= NAME_BYTES else b""
                row = np.frombuffer(raw.ljust(NAME_BYTES, b"\0"), np.uint8)
                self.names = np.vstack((self.names, row))
                self.name_lengths = np.append(self.name_lengths, len(raw))
        return number

    def limit(self, rows: int) -> None:
        """Have the table that begins now end after ``rows`` frames at most."""
        if rows < self.rows and not self.n:
            self.rows = rows
            self.columns = self._fresh()

    def widen(self) -> None:
        """Make room for CAN FD frames of more than 8 bytes."""
        if self.width < 64:
            self.width = 64
            *before, data, flags = self.columns
            self.columns = (*before, np.pad(data, ((0, 0), (0, 56))), flags)  # type: ignore[assignment]  # same columns

    def add(
        self, time_ns: int, channel: str, can_id: int, extended: bool, data: bytes, flags: FrameFlag | int, length: int
    ) -> bool:
        """Add a frame; False (and nothing added) where it can be none. ``length`` counts for remote frames only.

        A row must be left (`full`).
        """
        remote, error = bool(flags & FrameFlag.REMOTE), bool(flags & FrameFlag.ERROR)
        limit = MAX_EXTENDED_ID if extended or error else MAX_STANDARD_ID
        size = length if remote else len(data)
        sound = size in FD_LENGTHS if flags & FrameFlag.FD else 0 <= size <= 8
        if not (sound and 0 <= can_id <= limit and -(2**63) <= time_ns < 2**63):
            return False
        if size > 8 and not remote:
            self.widen()
        row = self.n
        times, channels, ids, wide, lengths, payload, bits = self.columns
        times[row], channels[row], ids[row] = time_ns, self.channel(channel), can_id
        wide[row], lengths[row], bits[row] = extended and not error, size, int(flags)
        payload[row] = 0  # a compiled pass may have begun this row before it left the frame to the careful parser
        if not remote and size:
            payload[row, :size] = np.frombuffer(data, np.uint8)
        self.n += 1
        return True

    def fill(self, compiled: Callable[..., tuple[int, int]], *arguments: object) -> int:
        """Have a compiled pass write rows.

        ``compiled(*arguments, names, name_lengths, columns, n)`` returns what it reached and the new ``n``; it
        writes whole rows only (data zero behind the length) and never beyond the last one.
        """
        reached, self.n = compiled(*arguments, self.names, self.name_lengths, self.columns, self.n)
        return reached

    def take(self) -> FrameTable:
        """Return the rows as a table, and begin a new one."""
        n, columns = self.n, self.columns
        names = tuple(map(printable, self._channels))
        parts = [column if n == self.rows else column[:n].copy() for column in columns]
        self.n = 0
        self.columns = self._fresh()
        return FrameTable(names, *parts)  # type: ignore[arg-type]  # in the order of the fields

    def reject(self, offset: int, text: bytes | str) -> None:
        """Count something that should be a frame and is none."""
        self.account.reject(offset, text)

    def recording(self, path: Path, form: str) -> Recording:
        """Return what was added, with the account."""
        return recording_of(path, form, [self.take()], self.account)


def recording_of(path: Path, form: str, tables: list[FrameTable], account: Account) -> Recording:
    """Whole recording from the tables of a reader that is through."""
    channels = tables[-1].channels if tables else ()
    return Recording(
        path,
        form,
        FrameTable.joined(tables, channels),
        account.rejected,
        tuple(account.first_rejected),
        account.truncated_at,
        account.start_ns,
        tuple(account.notes),
    )
