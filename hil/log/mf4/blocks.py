"""Blocks of an ASAM MDF 4 file: what groups of records it describes, and where their data stand.

Nothing in the file is believed: every link, length and count is held against the file's size, and no block is read
twice, so that a loop of links ends. Layouts: ASAM MDF 4.2.0, chapter 4 (associated standard for bus logging: 1.1).
"""

import re
import struct
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import IO

from hil.log.account import Account
from hil.log.mf4.layout import (
    CG_REMOTE_MASTER,
    CYCLES_OPEN,
    KINDS,
    LENGTH_OPEN,
    LIST_OPEN,
    MASTER,
    OTHER_BUSES,
    VIRTUAL_MASTER,
    DataGroup,
    Group,
    Member,
)

HEADER = struct.Struct("<4s4xQQ")  # identifier, length, number of links
MAX_NAME_BYTES = 64  # of a name that is looked at


class DamagedError(Exception):
    """A block that is none: where, and what is wrong with it."""

    def __init__(self, offset: int, problem: str) -> None:
        super().__init__(problem)
        self.offset = offset
        self.problem = problem


@dataclass(frozen=True, slots=True)
class Block:
    """One block: links, and where its data begin and end."""

    address: int
    ident: bytes
    links: tuple[int, ...]
    begin: int
    end: int


class MdfFile:
    """The description of a file's groups.

    Parameters
    ----------
    file : can be sought in.
    size : bytes of it that count.
    account : where damaged blocks are counted as rejected.

    Raises
    ------
    DamagedError
        When the file has not even an identification.

    Attributes
    ----------
    unfinalised : flags of what the writer left open; 0 for a finalised file.
    finalised : False where the file says that its writer did not end.
    start_ns, local_start : start time, ns since 1970, and whether it is a wall clock without a zone.
    groups : data groups in the file's order.
    cut : an address behind the end of the file was met.
    budget : bytes of data blocks that may still be read; blocks that overlap use it up.
    """

    def __init__(self, file: IO[bytes], size: int, account: Account) -> None:
        self.file = file
        self.size = size
        self.account = account
        self.seen: set[int] = set()
        self.budget = size
        self.link_budget = size
        self.held = 0  # bytes of unpacked blocks in memory
        self.cut = False
        head = self.bytes_at(0, 64)
        self.finalised = not head.startswith(b"UnFin")
        (version,) = struct.unpack_from("<H", head, 28)
        self.version = version or 400
        (left_open,) = struct.unpack_from("<H", head, 60)
        self.unfinalised = 0 if self.finalised else left_open or CYCLES_OPEN | LENGTH_OPEN | LIST_OPEN
        self.start_ns = 0
        self.local_start = False
        self.groups: list[DataGroup] = []
        self._data_links: list[int] = []
        self._addresses: list[int] = []

    def describe(self) -> None:
        """Read the header and all groups.

        Raises
        ------
        DamagedError
            When the header itself cannot be read.
        """
        header = self.block(64, b"HD", 24)
        self.start_ns, _, _, flags = struct.unpack("<QhhB", self.data(header, 13))
        self.local_start = bool(flags & 1)
        for block in self._chain(header.links[0], b"DG", 3):
            id_bytes = self.data(block, 1)[0]
            group = DataGroup(block.address, block.links[2], id_bytes)
            if id_bytes not in (0, 1, 2, 4, 8):
                self.account.reject(block.address, f"data group with record ids of {id_bytes} bytes")
                continue
            group.groups = [self._group(cg) for cg in self._chain(block.links[1], b"CG", 6)]
            self.groups.append(group)
            self._data_links.append(group.data)
        self._addresses = sorted(self.seen.union(self._data_links))

    def next_block(self, address: int) -> int:
        """Address of the next block that is known behind an address; the size of the file where there is none."""
        k = bisect_right(self._addresses, address)
        return min(self._addresses[k], self.size) if k < len(self._addresses) else self.size

    # -- blocks ------------------------------------------------------------------------------------------------------

    def bytes_at(self, offset: int, n: int) -> bytes:
        """``n`` bytes at an offset.

        Raises
        ------
        DamagedError
            Where the file ends before.
        """
        if n < 0 or offset < 0 or offset + n > self.size:
            self.cut = True
            raise DamagedError(offset, f"{n} bytes should stand here; the file ends at {self.size}")
        self.file.seek(offset)
        content = self.file.read(n)
        if len(content) != n:
            self.cut = True
            raise DamagedError(offset, f"{n} bytes should stand here, {len(content)} could be read")
        return content

    def ident_at(self, address: int) -> tuple[bytes, int, int]:
        """Identifier, length and number of links of the block at an address."""
        ident, length, links = HEADER.unpack(self.bytes_at(address, 24))
        if ident[:2] != b"##":
            raise DamagedError(address, f"a block should stand here, got {ident!r}")
        return ident[2:], length, links

    def block(self, address: int, ident: bytes, links: int) -> Block:
        """Return the block at an address, which must be of a kind and have a number of links at least."""
        got, length, count = self.ident_at(address)
        if got != ident:
            raise DamagedError(address, f"a block {ident.decode()} should stand here, got {got!r}")
        begin = address + 24 + 8 * count
        if length < 24 or count > length // 8 or begin > address + length:
            raise DamagedError(address, f"block {ident.decode()} of {length} bytes and {count} links")
        if ident in (b"DL", b"LD"):
            self.link_budget -= 8 * count
            if self.link_budget < 0:
                raise DamagedError(address, "lists of data overlap")
        else:
            count = min(count, max(links, 16))
        values = struct.unpack(f"<{count}Q", self.bytes_at(address + 24, 8 * count))
        return Block(address, got, values + (0,) * (links - count), begin, address + length)

    def data(self, block: Block, n: int) -> bytes:
        """First ``n`` bytes of a block's data; zero where it is shorter (older versions have fewer fields)."""
        return self.bytes_at(block.begin, min(n, block.end - block.begin)).ljust(n, b"\0")

    def _chain(self, first: int, ident: bytes, links: int) -> Iterator[Block]:
        """Blocks from one on, each linked by the first link of the one before."""
        address = first
        while address:
            if address in self.seen:
                self.account.reject(address, f"block {ident.decode()} linked a second time")
                return
            self.seen.add(address)
            try:
                block = self.block(address, ident, links)
            except DamagedError as error:
                self.account.reject(error.offset, error.problem)
                return
            yield block
            address = block.links[0]

    def text(self, address: int) -> str:
        """First letters of a text block; empty where there is none."""
        if not address:
            return ""
        try:
            ident, length, links = self.ident_at(address)
            begin = 24 + 8 * min(links, 1)
            raw = self.bytes_at(address + begin, min(MAX_NAME_BYTES, max(0, length - begin), self.size - address))
        except DamagedError:
            return ""
        return raw.split(b"\0")[0].decode("utf-8", "replace") if ident in (b"TX", b"MD") else ""

    # -- groups and channels -----------------------------------------------------------------------------------------

    def _group(self, block: Block) -> Group:
        record_id, cycles, flags, _, data_bytes, inval_bytes = struct.unpack("<QQHH4xII", self.data(block, 32))
        group = Group(block.address, record_id, cycles, flags, data_bytes, inval_bytes)
        if flags & CG_REMOTE_MASTER and len(block.links) > 6:
            group.master_link = block.links[6]
        for channel in self._chain(block.links[1], b"CN", 8):
            try:
                self._channel(channel, group)
            except DamagedError as error:
                self.account.reject(error.offset, error.problem)
        if group.kind and "BusChannel" not in group.members:
            group.channel = self._channel_of(block)
        return group

    def _channel_of(self, block: Block) -> int:
        """Number in the name of a group, or of its source: CAN2 -> 2; 1 where there is none."""
        names = [self.text(block.links[2])]
        with suppress(DamagedError):
            names.append(self.text(self.block(block.links[3], b"SI", 1).links[0]) if block.links[3] else "")
        numbers = [int(found[1]) for name in names if (found := re.search(r"(?i)\bCAN ?([1-9]\d?)\b", name))]
        return numbers[0] if numbers else 1

    def _channel(self, block: Block, group: Group) -> None:
        name = self.text(block.links[2])
        kind, sync = self.data(block, 2)
        if kind in (MASTER, VIRTUAL_MASTER):
            if sync == 1 and group.master is None:
                group.master = self._member(block)
            return
        root, _, member = name.partition(".")
        if root in KINDS and group.kind in ("", root):
            if not member:
                group.kind, group.frame = root, self._member(block)
                for child in self._chain(block.links[1], b"CN", 8) if self._is_channel(block.links[1]) else ():
                    group.members.setdefault(self.text(child.links[2]).rpartition(".")[2], self._member(child))
            else:
                group.kind = root
                group.members.setdefault(member, self._member(block))
        for prefix, bus in OTHER_BUSES.items():
            if root.startswith(prefix) and group.holds == "signal":
                group.holds = bus

    def _is_channel(self, address: int) -> bool:
        return bool(address) and self.ident_at(address)[0] == b"CN"

    def _member(self, block: Block) -> Member:
        kind, _, data_type, bit, byte, bits, flags, invalid = struct.unpack("<4B4I", self.data(block, 20))
        member = Member(kind, data_type, byte + bit // 8, bit % 8, bits, data=block.links[5])
        if member.data:
            self._data_links.append(member.data)
        if flags & 0x3:
            member.invalid_bit = invalid if flags & 0x2 else -1
        if block.links[4]:
            self._convert(member, block.links[4])
        return member

    def _convert(self, member: Member, address: int) -> None:
        try:
            block = self.block(address, b"CC", 4)
            kind, _, _, _, values = struct.unpack("<BBHHH", self.data(block, 8))
            if kind == 1 and values >= 2:
                offset, factor = struct.unpack("<24x2d", self.data(block, 40))
                member.offset, member.factor = Fraction(repr(offset)), Fraction(repr(factor))
                return
        except (DamagedError, ValueError):  # a factor that is not finite
            kind = -1
        member.linear = kind == 0
