"""Values of variable length in an MDF 4 file: data bytes of frames that stand outside their records."""

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.mf4.data import DataStream
from hil.log.mf4.fields import KEPT_64, Bytes

STORE_BYTES = 16 << 20  # of values that are kept for records still to come
BATCH_ROWS = 4096
PAD = 4 + 64  # readable behind the last value, so that all are copied alike


class Values:
    """A window of the stream of values: each 4 bytes of length, then its bytes; found by where it begins.

    Parameters
    ----------
    most : bytes of the window.

    Attributes
    ----------
    begin, end : positions in the stream, of the window.
    """

    def __init__(self, most: int = STORE_BYTES) -> None:
        self.most = most
        self.begin = 0
        self.end = 0
        self.content: npt.NDArray[np.uint8] = np.zeros(65_536 + PAD, np.uint8)

    def room(self, n: int) -> memoryview:
        """Return room for ``n`` bytes behind the end; what is oldest goes where the window is full."""
        have = self.end - self.begin
        if have + n > len(self.content) - PAD:
            keep = min(have, max(self.most - n, 0))
            old = self.content[have - keep : have]
            size = max(2 * (keep + n), 65_536)
            self.content = np.zeros(min(size, max(self.most, keep + n)) + PAD, np.uint8)
            self.content[:keep] = old
            self.begin, have = self.end - keep, keep
        return self.content.data[have : have + n]

    def gap(self, n: int) -> None:
        """Go on behind ``n`` bytes that are not known; so are the values before."""
        self.begin = self.end = self.end + n

    def take(
        self, at: npt.NDArray[np.int64], rows: npt.NDArray[np.int64], lengths: npt.NDArray[np.int64], data: Bytes
    ) -> None:
        """Copy the values that begin at ``at`` into rows; those that do not lie within the window are left out."""
        have = self.end - self.begin
        at = at - self.begin
        inside = (at >= 0) & (at + 4 <= have)
        at, rows = at[inside], rows[inside]
        length = numbers_at(self.content, "<u4", at).astype(np.int64)
        inside = (length <= 64) & (at + 4 + length <= have)
        at, rows, length = at[inside], rows[inside], length[inside]
        if not len(at):
            return
        lengths[rows] = length
        found = np.empty((len(at), (int(length.max()) + 7) // 8), np.uint64)
        for k in range(found.shape[1]):
            found[:, k] = numbers_at(self.content, "u8", at + (4 + 8 * k))
        found &= KEPT_64[length, : found.shape[1]]
        data.view(np.uint64)[rows, : found.shape[1]] = found


def numbers_at(content: Bytes, kind: str, at: npt.NDArray[np.int64]) -> npt.NDArray[np.unsignedinteger]:
    """Numbers at byte positions, which may be unaligned."""
    size = np.dtype(kind).itemsize
    every: npt.NDArray[np.unsignedinteger] = np.ndarray(len(content) - size + 1, kind, content, 0, 1)
    return every[at]


class SignalData:
    """Values in blocks of their own (SD), read on as far as the records ask for."""

    def __init__(self, stream: DataStream, account: Account, most: int = STORE_BYTES) -> None:
        self.stream = stream
        self.account = account
        self.window = Values(most)
        self.ended = False

    def values(self, offsets: npt.NDArray[np.uint64]) -> tuple[npt.NDArray[np.int64], Bytes]:
        """See `hil.log.mf4.records.ValueStore`."""
        n = len(offsets)
        lengths = np.full(n, -1, np.int64)
        data = np.zeros((n, 64), np.uint8)
        order = np.argsort(offsets, kind="stable")
        at = np.minimum(offsets[order], np.uint64(2**62)).astype(np.int64)
        done = 0
        while done < n:
            first = int(at[done])
            if first > self.window.end + self.window.most:  # values follow each other: this one cannot be right
                break
            stop = min(done + BATCH_ROWS, int(np.searchsorted(at, first + self.window.most // 4, side="right")))
            self._read_to(int(at[stop - 1]) + PAD)
            self.window.take(at[done:stop], order[done:stop], lengths, data)
            done = stop
        return lengths, data

    def _read_to(self, wanted: int) -> None:
        """Have the stream up to a position, as far as it goes."""
        while self.window.end < wanted and not self.ended:
            n = self.stream.fill(self.window.room(min(1 << 20, self.window.most // 4)))
            self.window.end += n
            if self.stream.gap is not None:
                gap = self.stream.pass_over()
                self.account.reject(gap.offset, gap.problem)
                self.window.gap(gap.length or 0)
                self.ended = gap.length is None
            elif not n:
                self.ended = True
