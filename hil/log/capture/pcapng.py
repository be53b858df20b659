"""Packet captures with CAN frames in blocks, pcapng: interfaces with names, stamps of any resolution, directions.

Source: draft-ietf-opsawg-pcapng.
"""

import struct
from collections.abc import Callable, Iterable, Iterator
from datetime import tzinfo
from typing import IO

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.builder import FrameBuilder
from hil.log.capture.packets import COOKED_2, HEADER, SOCKETCAN, Window, frame_of, with_can, words_at
from hil.log.frames import FrameFlag, FrameTable, LogError, LogFacts
from hil.log.source import ReadOptions, Source

SECTION, INTERFACE, PACKET, SIMPLE_PACKET, ENHANCED_PACKET = 0x0A0D0D0A, 1, 2, 3, 6
_PACKETS = (PACKET, SIMPLE_PACKET, ENHANCED_PACKET)
_OTHERS = (4, 5, 10)  # names, statistics, secrets
_BYTE_ORDER = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
_NAME, _RESOLUTION, _OFFSET = 2, 9, 14  # options of an interface
_FLAGS = 2  # option of a packet
_MAX_BLOCK = 16 * 1024 * 1024
_MAX_FOUND = 1024 * 1024  # of a block behind a damaged one
_MAX_NAME = 256
FAST_INTERFACES = 64


def read_pcapng(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the CAN frames of a pcapng file.

    A block that is damaged is rejected, and reading goes on with the next sound one. An interface's name is the
    channel's; the k-th interface (from 0) of a section without a name is can{k}; in a Linux cooked capture of
    version 2 the channel is if{n}, after the index of the packet's interface.

    Raises
    ------
    LogError
        When the file does not begin with a section, or all its packets are of something else.
    """
    window = Window(source)
    blocks = _Blocks(window, account)
    if not blocks.begin_section(window.peek(12)):
        raise LogError(source.path, f"no pcapng file: it begins with {window.peek(12)!r}", 0)
    yield from with_can(blocks.tables(options.fast), source, account)


class _Interface:
    """One interface of a section."""

    def __init__(self, body: bytes, number: int, order: str) -> None:
        self.link, _, self.snapped = struct.unpack_from(order + "HHI", body)
        self.name = f"can{number}"
        self.multiplier, self.divisor, self.power, self.offset_ns = 1000, 1, 0, 0
        for code, value in _options(body[8:], order):
            if code == _NAME:
                self.name = value.rstrip(b"\0").decode("utf-8", "backslashreplace")[:_MAX_NAME] or self.name
            elif code == _RESOLUTION and len(value) == 1:
                power = value[0] & 0x7F
                if value[0] & 0x80:
                    self.multiplier, self.divisor, self.power = 1_000_000_000, 1, power
                else:
                    self.multiplier, self.divisor, self.power = 10 ** max(9 - power, 0), 10 ** max(power - 9, 0), 0
            elif code == _OFFSET and len(value) == 8:
                self.offset_ns = int(struct.unpack(order + "q", value)[0]) * 1_000_000_000

    @property
    def fast(self) -> bool:
        """Whether the compiled pass can count its stamps."""
        return self.power <= 32 and self.divisor < 2**62 and abs(self.offset_ns) < 2**61

    @property
    def scale(self) -> tuple[int, int, int, int]:
        """For the compiled pass: multiplier, divisor, power of two, and the limit of ticks over that power."""
        if not self.fast:
            return 1, 1, 0, 0
        return self.multiplier, self.divisor, self.power, 2**62 // self.multiplier

    def time_ns(self, ticks: int) -> int:
        """Stamp in ns, cut."""
        return (ticks * self.multiplier // self.divisor >> self.power) + self.offset_ns


class _Blocks:
    def __init__(self, window: Window, account: Account) -> None:
        self.window = window
        self.account = account
        self.builder = FrameBuilder(account)
        self.order = "<"
        self.last_ns = 0
        self.interfaces: list[_Interface] = []
        self.channels: npt.NDArray[np.int64] = np.zeros(0, np.int64)
        self._facts: tuple[npt.NDArray[np.int64], ...] | None = None

    def begin_section(self, head: bytes) -> bool:
        """Begin a section; False where these bytes begin none."""
        if len(head) < 12 or head[:4] != b"\x0a\x0d\x0d\x0a" or head[8:12] not in _BYTE_ORDER:
            return False
        self.order = _BYTE_ORDER[head[8:12]]
        self.interfaces = []
        self.channels = np.full(FAST_INTERFACES, -1, np.int64)
        self._facts = None
        return True

    def tables(self, fast: bool | None) -> Iterator[FrameTable]:
        window, builder = self.window, self.builder
        while window.left(12):
            if builder.full:
                yield builder.take()
            compiled = not window.few() if fast is None else fast
            if compiled and self.interfaces:
                self._take()
                if builder.full or not window.left(12):
                    continue
            if not self._one():
                break
        yield builder.take()

    def _take(self) -> None:
        from hil.log.capture.pcap_pass import take_blocks

        if self._facts is None:
            known = self.interfaces[:FAST_INTERFACES]
            self._facts = (
                np.array([i.link if i.fast else -1 for i in known], np.int64),
                np.array([i.scale for i in known], np.int64),
                np.array([i.offset_ns if i.fast else 0 for i in known], np.int64),
            )
        window, before = self.window, self.builder.n
        channels = self.channels[: len(self._facts[0])]
        window.at = self.builder.fill(take_blocks, window.array, window.at, self.order == "<", *self._facts, channels)
        if self.builder.n > before:
            self.last_ns = int(self.builder.columns[0][self.builder.n - 1])

    def _one(self) -> bool:
        """Take one block; False where nothing can follow."""
        window, account = self.window, self.account
        offset, head = window.offset, window.peek(12)
        if len(head) < 12:
            account.reject(offset, head)
            account.cut_at(offset)
            return False
        kind, length = self._kind(head)
        if length % 4 or not 12 <= length <= _MAX_BLOCK or (kind == SECTION and head[8:12] not in _BYTE_ORDER):
            account.reject(offset, head)
            return self._advance()
        if window.left(length) < length:  # cut off, or a damaged length
            if kind in _PACKETS or kind not in (SECTION, INTERFACE, *_OTHERS):
                account.reject(offset, head)
            if self._advance():
                return True
            account.cut_at(offset)
            return False
        block = window.data[window.at : window.at + length]
        if block[-4:] != block[4:8]:
            account.reject(offset, head)
            return self._advance()
        window.at += length
        self._block(kind, block, offset)
        return True

    def _block(self, kind: int, block: bytes, offset: int) -> None:
        body = block[8:-4]
        if kind == SECTION:
            self.begin_section(block)
        elif kind == INTERFACE and len(body) >= 8:
            self.interfaces.append(_Interface(body, len(self.interfaces), self.order))
            if len(self.interfaces) <= FAST_INTERFACES:
                self._facts = None
        elif kind in _PACKETS:
            reader: Callable[[bytes], bool] = {
                ENHANCED_PACKET: self._enhanced, PACKET: self._old, SIMPLE_PACKET: self._simple
            }[kind]  # fmt: skip
            if not reader(body):
                self.account.reject(offset, body)

    def _enhanced(self, body: bytes) -> bool:
        if len(body) < 20:
            return False
        number, high, low, captured, size = struct.unpack_from(self.order + "5I", body)
        return self._packet(number, high << 32 | low, captured, size, body[20:])

    def _old(self, body: bytes) -> bool:
        if len(body) < 20:
            return False
        number, _, high, low, captured, size = struct.unpack_from(self.order + "2H4I", body)
        return self._packet(number, high << 32 | low, captured, size, body[20:])

    def _simple(self, body: bytes) -> bool:
        if len(body) < 4 or not self.interfaces:
            return False
        (size,) = struct.unpack_from(self.order + "I", body)
        captured = min(size, self.interfaces[0].snapped or size)
        self.account.note("some packets have no stamp (simple packet blocks): they take that of the packet before")
        return self._packet(0, None, captured, size, body[4:])

    def _packet(self, number: int, ticks: int | None, captured: int, size: int, rest: bytes) -> bool:
        """Add a packet's frame, or pass it over; False where it is damaged."""
        if number >= len(self.interfaces) or captured > len(rest):
            return False
        interface = self.interfaces[number]
        if interface.link not in HEADER:
            self.account.passed_over[f"link type {interface.link}"] += 1
            return True
        frame = frame_of(rest[:captured], size, interface.link, self.order)
        if isinstance(frame, str):
            self.account.passed_over[frame] += 1
            return True
        if frame is None:
            return False
        flags = frame.flags
        for code, value in _options(rest[(captured + 3) // 4 * 4 :], self.order):
            if code == _FLAGS and len(value) == 4:
                if struct.unpack(self.order + "I", value)[0] & 3 == 2:
                    flags |= FrameFlag.SENT
                break
        channel = interface.name if frame.interface is None else f"if{frame.interface}"
        time_ns = self.last_ns if ticks is None else interface.time_ns(ticks)
        if not self.builder.add(time_ns, channel, frame.can_id, frame.extended, frame.data, flags, frame.length):
            return False
        self.last_ns = time_ns
        if number < FAST_INTERFACES and interface.link != COOKED_2:
            self.channels[number] = self.builder.channel(channel)
        return True

    def _kind(self, head: bytes) -> tuple[int, int]:
        """Type and length of a block; a section tells its byte order itself."""
        order = _BYTE_ORDER.get(head[8:12], self.order) if head[:4] == b"\x0a\x0d\x0d\x0a" else self.order
        kind, length = struct.unpack_from(order + "2I", head)
        return int(kind), int(length)

    def _advance(self) -> bool:
        return self.window.advance(_MAX_FOUND, self._candidates, self._closed)

    def _candidates(self, array: npt.NDArray[np.uint8], n: int) -> npt.NDArray[np.int64]:
        kinds = words_at(array, n, 0, self.order)
        return np.flatnonzero(np.isin(kinds, (SECTION, INTERFACE, *_PACKETS, *_OTHERS)))

    def _closed(self, at: int) -> bool:
        """Whether a block begins at a place of the window and ends as it must."""
        data = self.window.data
        head = data[at : at + 12]
        if len(head) < 12:
            return False
        kind, length = self._kind(head)
        if length % 4 or not 12 <= length <= _MAX_FOUND or (kind == SECTION and head[8:12] not in _BYTE_ORDER):
            return False
        return data[at + length - 4 : at + length] == head[4:8]


def _options(raw: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 4 <= len(raw):
        code, length = struct.unpack_from(order + "2H", raw, at)
        if code == 0 or at + 4 + length > len(raw):
            return
        yield code, raw[at + 4 : at + 4 + length]
        at += 4 + (length + 3) // 4 * 4


def write_pcapng(file: IO[bytes], tables: Iterable[FrameTable], facts: LogFacts, zone: tzinfo) -> None:
    """Write pcapng as SocketCAN gives it: an interface a channel, stamps in ns, frames of 16 or 72 bytes.

    Directions are written where any frame was sent. Stamps before 1970 move every interface's time offset.
    """
    offset_s = min(facts.least_ns // 1_000_000_000, 0)
    directed = bool(facts.flags & FrameFlag.SENT)
    file.write(_block(SECTION, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)))
    for name in facts.channels:
        options = [(_NAME, name.encode()[:0xFFFF]), (_RESOLUTION, b"\x09")]
        if offset_s:
            options.append((_OFFSET, struct.pack("<q", offset_s)))
        coded = b"".join(struct.pack("<2H", code, len(value)) + _padded(value) for code, value in options)
        file.write(_block(INTERFACE, struct.pack("<HHI", SOCKETCAN, 0, 0) + coded + bytes(4)))
    for table in tables:
        file.write(_packets(table, offset_s, directed))


def _block(kind: int, body: bytes) -> bytes:
    length = struct.pack("<I", len(body) + 12)
    return struct.pack("<I", kind) + length + body + length


def _padded(value: bytes) -> bytes:
    return value + bytes(-len(value) % 4)


def _packets(table: FrameTable, offset_s: int, directed: bool) -> bytes:
    fd = (table.flags & FrameFlag.FD) != 0
    classical = _rows(table.take(~fd), 8, offset_s, directed)
    if not fd.any():
        return classical.tobytes()
    flexible = _rows(table.take(fd).widened(64), 64, offset_s, directed)
    sizes = classical.shape[1] + fd.astype(np.int64) * (flexible.shape[1] - classical.shape[1])
    begins = np.cumsum(sizes) - sizes
    out = np.empty(int(sizes.sum()), np.uint8)
    out[begins[~fd, None] + np.arange(classical.shape[1])] = classical
    out[begins[fd, None] + np.arange(flexible.shape[1])] = flexible
    return out.tobytes()


def _rows(table: FrameTable, width: int, offset_s: int, directed: bool) -> npt.NDArray[np.uint8]:
    """Enhanced packet blocks, uint8 (n, bytes of a block), of frames with ``width`` bytes of data."""
    n, size = len(table), 8 + width
    length = 32 + size + (12 if directed else 0)
    rows = np.zeros((n, length), np.uint8)

    def put(at: int, values: npt.NDArray[np.generic] | int, kind: str) -> None:
        column = np.broadcast_to(np.asarray(values).astype(kind), (n,))
        rows[:, at : at + column.itemsize] = np.ascontiguousarray(column).view(np.uint8).reshape(n, column.itemsize)

    ticks = table.time_ns.view(np.uint64) - np.uint64(offset_s * 1_000_000_000 % 2**64)  # modulo 2 ** 64: never < 0
    bits = table.flags
    word = table.can_id | np.where(table.extended, np.uint32(0x8000_0000), np.uint32(0))
    word = word | np.where(bits & FrameFlag.REMOTE, np.uint32(0x4000_0000), np.uint32(0))
    word = word | np.where(bits & FrameFlag.ERROR, np.uint32(0x2000_0000), np.uint32(0))
    put(0, ENHANCED_PACKET, "<u4")
    put(4, length, "<u4")
    put(8, table.channel, "<u4")
    put(12, ticks >> np.uint64(32), "<u4")
    put(16, ticks & np.uint64(0xFFFF_FFFF), "<u4")
    put(20, size, "<u4")
    put(24, size, "<u4")
    put(28, word, ">u4")
    rows[:, 32] = table.length
    if width > 8:
        brs, esi = (bits & FrameFlag.BIT_RATE_SWITCH) != 0, (bits & FrameFlag.ERROR_STATE) != 0
        rows[:, 33] = 4 | brs * np.uint8(1) | esi * np.uint8(2)
    rows[:, 36 : 36 + width] = table.data[:, :width]
    if directed:
        put(28 + size, _FLAGS | 4 << 16, "<u4")
        put(32 + size, np.where(bits & FrameFlag.SENT, 2, 1), "<u4")
    put(length - 4, length, "<u4")
    return rows
