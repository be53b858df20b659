"""Bytes of one data block of an MDF 4 file: plain, deflated, or deflated after its records were transposed."""

import tempfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import IO, Any, Protocol

import numpy as np
import numpy.typing as npt

from hil.log.mf4.blocks import DamagedError, MdfFile

INPUT_BYTES = 65_536
WHOLE_BYTES = 8 << 20  # a deflated block up to this is unpacked at once
HELD_BYTES = 64 << 20  # unpacked blocks in memory, all streams of a file together

try:
    from isal import isal_zlib as _fast  # twice as fast

    inflater: Callable[[], Any] = _fast.decompressobj
    INFLATE_ERRORS: Any = (zlib.error, _fast.error)
except ImportError:
    inflater = zlib.decompressobj
    INFLATE_ERRORS = (zlib.error,)


@dataclass(slots=True)
class Stored:
    """One data block as it is stored.

    Attributes
    ----------
    address : of the block.
    begin, stored : where its bytes stand, and how many of them the file has.
    length : bytes of it, unpacked.
    columns : bytes of a transposed record; 0 where none is transposed, None where the block is not packed.
    cut : the file ends within it.
    """

    address: int
    begin: int
    stored: int
    length: int
    columns: int | None = None
    cut: bool = False


class BlockBytes(Protocol):
    """Gives the bytes of a block in order; ``left`` is how many are still to come."""

    left: int

    def read_into(self, view: memoryview) -> int:
        """Write at least one byte, at most ``left``.

        Raises
        ------
        DamagedError
            When they cannot be read.
        """
        ...

    def close(self) -> None:
        """Give back what it holds in memory."""
        ...


def open_block(mdf: MdfFile, stored: Stored) -> BlockBytes:
    """Return the bytes of a block."""
    if stored.columns is None:
        return _Plain(mdf, stored)
    return _Transposed(mdf, stored) if stored.columns > 1 else _Deflated(mdf, stored)


class _Plain:
    def __init__(self, mdf: MdfFile, stored: Stored) -> None:
        self.file = mdf.file
        self.at = stored.begin
        self.left = stored.length

    def read_into(self, view: memoryview) -> int:
        self.file.seek(self.at)
        n: int = self.file.readinto(view[: min(len(view), self.left)])  # type: ignore[attr-defined]  # BinaryIO has none
        if not n:
            raise DamagedError(self.at, f"{self.left} bytes should stand here and cannot be read")
        self.at += n
        self.left -= n
        return n

    def close(self) -> None:
        pass


class _Inflation:
    """Deflated bytes in pieces of any size."""

    def __init__(self, mdf: MdfFile, stored: Stored) -> None:
        self.file = mdf.file
        self.stored = stored
        self.at = stored.begin
        self.input_left = stored.stored
        self.left = stored.length
        self.inflate = inflater()
        self.rest = b""

    def read(self, most: int) -> bytes:
        """At most ``most`` bytes, at least one."""
        most = min(most, self.left)
        while True:
            if not self.rest and self.input_left:
                self.file.seek(self.at)
                self.rest = self.file.read(min(INPUT_BYTES, self.input_left))
                self.at += len(self.rest)
                self.input_left -= len(self.rest)
                if not self.rest:
                    self.input_left = 0
            try:
                content: bytes = self.inflate.decompress(self.rest, most)
            except INFLATE_ERRORS as error:
                raise DamagedError(self.stored.address, f"damaged packed block: {error}") from error
            self.rest = self.inflate.unconsumed_tail
            if content:
                self.left -= len(content)
                return content
            if self.inflate.eof or not (self.rest or self.input_left):
                what = "the file ends within a packed block" if self.stored.cut else "a packed block is too short"
                raise DamagedError(
                    self.stored.address, f"{what}: {self.left} of {self.stored.length} bytes are missing"
                )


class _Deflated:
    def __init__(self, mdf: MdfFile, stored: Stored) -> None:
        self.mdf = mdf
        self.left = stored.length
        self.held = 0
        self.content = b""
        self.at = 0
        self.pieces: _Inflation | None = _Inflation(mdf, stored)
        if stored.length <= WHOLE_BYTES and mdf.held + stored.length <= HELD_BYTES and not stored.cut:
            self.content = _whole(mdf, stored)
            self.pieces = None
            self.held = stored.length
            mdf.held += self.held

    def read_into(self, view: memoryview) -> int:
        if self.pieces is None:
            n = min(len(view), self.left)
            view[:n] = self.content[self.at : self.at + n]
            self.at += n
        else:
            content = self.pieces.read(min(len(view), INPUT_BYTES * 8))
            n = len(content)
            view[:n] = content
        self.left -= n
        return n

    def close(self) -> None:
        self.mdf.held -= self.held
        self.held, self.content = 0, b""


def _whole(mdf: MdfFile, stored: Stored) -> bytes:
    """All bytes of a deflated block at once."""
    mdf.file.seek(stored.begin)
    inflate = inflater()
    try:
        content: bytes = inflate.decompress(mdf.file.read(stored.stored), max(1, stored.length))
    except INFLATE_ERRORS as error:
        raise DamagedError(stored.address, f"damaged packed block: {error}") from error
    if len(content) != stored.length:
        missing = stored.length - len(content)
        raise DamagedError(
            stored.address, f"a packed block is too short: {missing} of {stored.length} bytes are missing"
        )
    return content


class _Transposed:
    """Stored column by column: all first bytes of the records, all second ones, ...; what is left over comes last."""

    def __init__(self, mdf: MdfFile, stored: Stored) -> None:
        assert stored.columns
        self.mdf = mdf
        self.left = self.length = stored.length
        self.columns = stored.columns
        self.lines = stored.length // stored.columns
        self.held = 0
        self.spilled: IO[bytes] | None = None
        self.content: npt.NDArray[np.uint8] = np.zeros(0, np.uint8)
        self.tail = b""
        if stored.cut:
            raise DamagedError(stored.address, "the file ends within a transposed block")
        if stored.length <= WHOLE_BYTES and mdf.held + stored.length <= HELD_BYTES:
            content = _whole(mdf, stored)
            self.held = stored.length
            mdf.held += self.held
            square = self.columns * self.lines
            self.content, self.tail = np.frombuffer(content, np.uint8)[:square], content[square:]
        else:
            self._spill(_Inflation(mdf, stored))

    def _spill(self, pieces: _Inflation) -> None:
        """Keep the block in a temporary file."""
        self.spilled = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the block)
        try:
            while pieces.left:
                self.spilled.write(pieces.read(INPUT_BYTES * 8))
        except BaseException:
            self.spilled.close()
            raise
        self.spilled.seek(self.columns * self.lines)
        self.tail = self.spilled.read()

    def _rows(self, first: int, n: int) -> npt.NDArray[np.uint8]:
        """Bytes (columns, n) of records."""
        if self.spilled is None:
            return self.content.reshape(self.columns, self.lines)[:, first : first + n]
        rows = np.zeros((self.columns, n), np.uint8)
        for column in range(self.columns):
            self.spilled.seek(column * self.lines + first)
            rows[column] = np.frombuffer(self.spilled.read(n), np.uint8)
        return rows

    def read_into(self, view: memoryview) -> int:
        at = self.length - self.left
        row, within = divmod(at, self.columns)
        if row >= self.lines:
            begin = at - self.columns * self.lines
            n = min(len(view), self.left)
            view[:n] = self.tail[begin : begin + n]
        elif within or len(view) < self.columns:
            n = min(len(view), self.columns - within)
            view[:n] = self._rows(row, 1)[within : within + n, 0].tobytes()
        else:
            lines = min(len(view) // self.columns, self.lines - row)
            n = lines * self.columns
            np.frombuffer(view[:n], np.uint8).reshape(lines, self.columns)[:] = self._rows(row, lines).T
        self.left -= n
        return n

    def close(self) -> None:
        self.mdf.held -= self.held
        self.held = 0
        self.content = np.zeros(0, np.uint8)
        if self.spilled is not None:
            self.spilled.close()
