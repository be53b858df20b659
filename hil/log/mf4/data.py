"""Data of an MDF 4 file as one stream of bytes: a data block, or lists of them (DT, DV, SD, DZ, DL, LD, HL)."""

import struct
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from hil.log.mf4.blocks import DamagedError, MdfFile
from hil.log.mf4.layout import LENGTH_OPEN, LIST_OPEN
from hil.log.mf4.packed import BlockBytes, Stored, open_block

MAX_TRANSPOSED_BYTES = 1 << 28  # of one block; the standard recommends 4 MiB at most
MAX_TOLD = 1 << 50  # bytes of a block, as its list tells
MAX_RATIO = 1100  # deflate packs 1032 to 1 at best
PLAIN = (b"DT", b"DV", b"SD")
LISTS = (b"DL", b"LD")


@dataclass(slots=True)
class Gap:
    """Bytes that cannot be read: how many (None: nobody knows), why, and where in the file."""

    length: int | None
    problem: str
    offset: int


@dataclass(slots=True)
class _Link:
    """A data block in a list: its address, the length that the list tells (None: none), whether it is the last."""

    address: int
    length: int | None
    last: bool


class DataStream:
    """Bytes behind the data link of a group (or of a channel's signal data), block after block.

    Parameters
    ----------
    mdf : the file.
    link : the data link; 0 gives no bytes.

    Attributes
    ----------
    position : bytes given so far, those of gaps included.
    gap : what should come next and cannot be read; `pass_over` goes on behind it.
    cut : the file ends before the stream does.
    """

    def __init__(self, mdf: MdfFile, link: int) -> None:
        self.mdf = mdf
        self.position = 0
        self.gap: Gap | None = None
        self.cut = False
        self._links = self._all_links(link)
        self._open: BlockBytes | None = None
        self._missing = 0  # bytes of the open block that its list tells and it has not
        self._starts: list[int] = []  # positions at which blocks begin,
        self._where: list[tuple[int, bool]] = []  # and where their first bytes stand, and whether they are packed

    def fill(self, view: memoryview) -> int:
        """Fill a buffer; returns fewer bytes only before a gap and at the end."""
        filled = 0
        while filled < len(view) and self.gap is None:
            if self._open is None and not self._next():
                break
            block = self._open
            if block is None:
                continue
            if block.left:
                try:
                    n = block.read_into(view[filled:])
                except DamagedError as error:
                    self.gap = Gap(block.left, error.problem, error.offset)
                    block.left = 0
                    n = 0
                filled += n
                self.position += n
            if not block.left:
                block.close()
                self._open = None
                if self._missing and self.gap is None:
                    self.gap = Gap(self._missing, "a block of data is shorter than its list says", self._where[-1][0])
        return filled

    def pass_over(self) -> Gap:
        """Go on behind the gap, and return what it was."""
        gap = self.gap
        assert gap is not None
        self.position += gap.length or 0
        self.gap = None
        return gap

    def offset_of(self, position: int) -> int:
        """Where in the file a byte of the stream stands (of a packed one: its block)."""
        k = bisect_right(self._starts, position) - 1
        if k < 0:
            return self._where[0][0] if self._where else 0
        offset, packed = self._where[k]
        return int(offset if packed else offset + position - self._starts[k])

    def offsets_of(self, positions: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """As `offset_of`, for many."""
        if not self._starts:
            return np.zeros(len(positions), np.int64)
        k = np.maximum(np.searchsorted(np.array(self._starts, np.int64), positions, side="right") - 1, 0)
        where = np.array(self._where, np.int64)[k]
        return where[:, 0] + np.where(where[:, 1] != 0, 0, positions - np.array(self._starts, np.int64)[k])

    def starts_between(self, begin: int, end: int) -> npt.NDArray[np.int64]:
        """Positions from ``begin`` to before ``end`` at which blocks begin."""
        return np.array(self._starts[bisect_left(self._starts, begin) : bisect_left(self._starts, end)], np.int64)

    def end(self) -> None:
        """Give no more bytes."""
        self.next_block()
        self._links = iter(())

    def next_block(self) -> None:
        """Go on at the begin of the next block."""
        if self._open is not None:
            self.position += self._open.left
            self._open.left = 0
            self.close()

    def forget(self, position: int) -> None:
        """Where bytes before a position stand is no longer asked."""
        k = bisect_right(self._starts, position) - 1
        if k > 64:
            del self._starts[:k], self._where[:k]

    def close(self) -> None:
        """Give back what is held in memory."""
        if self._open is not None:
            self._open.close()
            self._open = None

    # -- blocks ------------------------------------------------------------------------------------------------------

    def _next(self) -> bool:
        """Open the next block; False at the end, and where there is a gap instead."""
        try:
            link = next(self._links, None)
        except DamagedError as error:  # a list: what it lists is not known
            self._note_cut(error.offset)
            self.gap = Gap(None, error.problem, error.offset)
            return False
        if link is None:
            return False
        try:
            stored = self._stored(link)
            self._open = open_block(self.mdf, stored)
        except DamagedError as error:
            self._note_cut(error.offset)
            self.gap = Gap(link.length, error.problem, error.offset)
            return False
        self._missing = max(0, link.length - stored.length) if link.length is not None and not stored.cut else 0
        self._starts.append(self.position)
        packed = stored.columns is not None
        self._where.append((stored.address if packed else stored.begin, packed))
        return True

    def _note_cut(self, offset: int) -> None:
        self.cut = self.cut or offset + 24 > self.mdf.size

    def _all_links(self, link: int) -> Iterator[_Link]:
        mdf = self.mdf
        if not link:
            return
        ident, _, _ = mdf.ident_at(link)
        if ident == b"HL":
            self._visit(link)
            link = mdf.block(link, b"HL", 1).links[0]
            if not link:
                return
            ident, _, _ = mdf.ident_at(link)
        if ident not in LISTS:
            yield _Link(link, None, True)
            return
        while link:
            self._visit(link)
            block = mdf.block(link, ident, 1)
            flags, count = struct.unpack("<II", mdf.data(block, 8))
            n = min(len(block.links) - 1, count)
            addresses = list(block.links[1 : 1 + n])
            lengths = self._lengths(block.begin + 8, block.end, flags, n) if ident == b"DL" else [None] * n
            link = block.links[0]
            while addresses and not addresses[-1]:
                addresses.pop()
            if not link and mdf.unfinalised & LIST_OPEN:
                addresses += self._following(addresses[-1] if addresses else block.address)
            for k, address in enumerate(addresses):
                if address:
                    last = not link and k == len(addresses) - 1
                    yield _Link(address, lengths[k] if k < len(lengths) and not last else None, last)

    def _lengths(self, begin: int, end: int, flags: int, n: int) -> list[int | None]:
        """Lengths of the blocks of a list, as far as it tells them."""
        n = min(n, max(0, end - begin) // 8)
        if flags & 1 and n:
            (length,) = struct.unpack("<Q", self.mdf.bytes_at(begin, 8))
            return [length if 0 < length < MAX_TOLD else None] * n
        offsets = struct.unpack(f"<{n}Q", self.mdf.bytes_at(begin, 8 * n))
        lengths = [b - a for a, b in pairwise(offsets)]
        return [*lengths, None] if all(0 < a < MAX_TOLD for a in lengths) else [None] * n

    def _visit(self, address: int) -> None:
        if address in self.mdf.seen:
            raise DamagedError(address, "a list of data is linked a second time")
        self.mdf.seen.add(address)

    def _following(self, address: int) -> list[int]:
        """Data blocks that stand right behind a block, not yet entered in the list of a writer that did not end."""
        found: list[int] = []
        while True:
            try:
                _, length, _ = self.mdf.ident_at(address)
                address += max(24, length) + 7 & ~7
                ident, length, _ = self.mdf.ident_at(address)
            except DamagedError:
                return found
            if ident not in (*PLAIN, b"DZ") or address in self.mdf.seen:
                return found
            found.append(address)

    def _stored(self, link: _Link) -> Stored:
        mdf, address = self.mdf, link.address
        if address in mdf.seen:
            raise DamagedError(address, "a block of data is linked a second time")
        mdf.seen.add(address)
        ident, length, _ = mdf.ident_at(address)
        if ident in PLAIN:
            behind = mdf.next_block(address)
            if link.last and (length < 24 or (mdf.unfinalised & LENGTH_OPEN and not self._ends_well(address + length))):
                if mdf.finalised:
                    mdf.account.reject(address, f"a block of data of {length} bytes; it is read up to the next one")
                length = behind - address
            told = behind - address if behind < mdf.size else length
            if link.length is not None:
                told = min(told, 24 + link.length)
            if length > told:
                mdf.account.reject(address, f"a block of data of {length} bytes reaches into the next one")
                length = told
            if length < 24:
                raise DamagedError(address, f"a block of data of {length} bytes")
            stored = Stored(address, address + 24, length - 24, length - 24)
        elif ident == b"DZ":
            stored = self._packed(address, length)
        else:
            raise DamagedError(address, f"a block of data should stand here, got {ident!r}")
        if stored.begin + stored.stored > mdf.size:
            stored.cut = self.cut = True
            stored.stored = max(0, mdf.size - stored.begin)
            if stored.columns is None:
                stored.length = stored.stored
        mdf.budget -= stored.stored
        if mdf.budget < 0:
            raise DamagedError(address, "blocks of data overlap")
        return stored

    def _ends_well(self, end: int) -> bool:
        """A block, or the end of the file, stands where a block says that it ends."""
        end = end + 7 & ~7
        if end >= self.mdf.size:
            return end - self.mdf.size < 8
        try:
            self.mdf.ident_at(end)
        except DamagedError:
            return False
        return True

    def _packed(self, address: int, length: int) -> Stored:
        kind, parameter, unpacked, packed = struct.unpack("<2xBxIQQ", self.mdf.bytes_at(address + 24, 24))
        if kind > 1:
            raise DamagedError(address, f"data packed in way {kind} (MDF 4.3); deflate (ways 0 and 1) is read")
        if unpacked > MAX_RATIO * packed + 64 or packed > length:
            raise DamagedError(address, f"{packed} packed bytes cannot be {unpacked} bytes")
        columns = parameter if kind == 1 else 0
        if columns > 1 and unpacked > MAX_TRANSPOSED_BYTES:
            raise DamagedError(address, f"{unpacked} bytes transposed in one block are refused")
        return Stored(address, address + 48, packed, unpacked, columns)
