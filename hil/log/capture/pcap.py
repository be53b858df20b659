"""Packet captures with CAN frames, as tcpdump and Wireshark write them: pcap.

The reader of pcapng and its writer stand in `hil.log.capture.pcapng`.
"""

import struct
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.builder import FrameBuilder
from hil.log.capture.packets import (
    COOKED_2,
    FRAME_BYTES,
    HEADER,
    XL_BYTES,
    Packet,
    Window,
    frame_of,
    with_can,
    words_at,
)  # fmt: skip
from hil.log.capture.pcapng import read_pcapng, write_pcapng
from hil.log.frames import FrameTable, LogError
from hil.log.source import ReadOptions, Source

__all__ = ["read_pcap", "read_pcapng", "write_pcapng"]

_MAGIC = {0xA1B2C3D4: 1000, 0xA1B23C4D: 1}  # ns of the unit of a stamp's fraction
_MAX_RECORD = 262_144  # libpcap's limit of what is captured of a packet
FAST_INTERFACES = 256


def read_pcap(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the CAN frames of a pcap file.

    A record that is damaged is rejected, and reading goes on with the next that looks sound.
    The channel is can0; in a Linux cooked capture of version 2 it is if{n}, after the interface's index.

    Raises
    ------
    LogError
        When the file's header is none, or all its packets are of something else.
    """
    window = Window(source)
    header = window.peek(24)
    order = "<" if header[:1] in (b"\xd4", b"\x4d") else ">"
    magic = struct.unpack(order + "I", header[:4])[0] if len(header) >= 4 else 0
    if magic not in _MAGIC or len(header) < 24:
        raise LogError(source.path, f"no pcap file: its header is {header!r}", 0)
    link = int(struct.unpack_from(order + "I", header, 20)[0]) & 0x03FF_FFFF  # the bits above tell of a checksum
    window.at = 24
    records = _Records(window, account, link, order, _MAGIC[magic])
    yield from with_can(records.tables(options.fast), source, account)


class _Records:
    def __init__(self, window: Window, account: Account, link: int, order: str, unit_ns: int) -> None:
        self.window = window
        self.account = account
        self.builder = FrameBuilder(account)
        self.link = link
        self.order = order
        self.unit_ns = unit_ns
        self.interfaces: npt.NDArray[np.int64] = np.full(FAST_INTERFACES, -1, np.int64)

    def tables(self, fast: bool | None) -> Iterator[FrameTable]:
        window, builder = self.window, self.builder
        while window.left(16):
            if builder.full:
                yield builder.take()
            compiled = not window.few() if fast is None else fast
            if compiled and self.link in HEADER:
                self._take()
                if builder.full or not window.left(16):
                    continue
            if not self._one():
                break
        yield builder.take()

    def _take(self) -> None:
        from hil.log.capture.pcap_pass import take_records

        window = self.window
        little = self.order == "<"
        window.at = self.builder.fill(
            take_records, window.array, window.at, little, self.unit_ns, self.link, self.interfaces
        )

    def _one(self) -> bool:
        """Take one record; False where nothing can follow."""
        window, account = self.window, self.account
        offset, head = window.offset, window.peek(16 + FRAME_BYTES)
        if not self._sound(head, strict=False):
            account.reject(offset, head[:16])
            if len(head) < 16:
                account.cut_at(offset)
                return False
            return self._advance()
        seconds, fraction, captured, size = struct.unpack_from(self.order + "4I", head)
        if window.left(16 + captured) < 16 + captured:  # cut off, or a damaged length
            account.reject(offset, head[:16])
            if self._advance():
                return True
            account.cut_at(offset)
            return False
        packet = window.data[window.at + 16 : window.at + 16 + captured]
        window.at += 16 + captured
        if self.link not in HEADER:
            account.passed_over[f"link type {self.link}"] += 1
            return True
        frame = frame_of(packet, size, self.link, self.order)
        if isinstance(frame, str):
            account.passed_over[frame] += 1
        elif frame is None or not self._added(seconds * 1_000_000_000 + fraction * self.unit_ns, frame):
            account.reject(offset, packet)
        return True

    def _added(self, time_ns: int, frame: Packet) -> bool:
        number = frame.interface or 0
        channel = f"if{number}" if self.link == COOKED_2 else "can0"
        if not self.builder.add(time_ns, channel, frame.can_id, frame.extended, frame.data, frame.flags, frame.length):
            return False
        if number < FAST_INTERFACES:
            self.interfaces[number] = self.builder.channel(channel)
        return True

    def _sound(self, head: bytes, strict: bool = True) -> bool:
        """Whether a record may begin with these bytes; ``strict`` where nothing else tells that one does."""
        if len(head) < 16:
            return False
        _, fraction, captured, size = struct.unpack_from(self.order + "4I", head)
        if fraction * self.unit_ns >= 1_000_000_000 or captured > _MAX_RECORD:
            return False
        if strict and not captured <= size <= _MAX_RECORD:
            return False
        before = HEADER.get(self.link)
        if before is None:
            return captured > 0 or not strict
        if captured < max(before, 8):
            return False
        if before:
            at = 16 if self.link == COOKED_2 else 30
            protocol = head[at : at + 2]
            if protocol not in (b"\x00\x0c", b"\x00\x0d"):
                return protocol != b"\x00\x0e" or bool(captured <= before + XL_BYTES)
        elif head[20:21] >= b"\x80":
            return bool(captured <= XL_BYTES)
        return bool(before + 8 <= captured <= before + FRAME_BYTES)

    def _advance(self) -> bool:
        return self.window.advance(_MAX_RECORD + 32 + FRAME_BYTES, self._candidates, self._followed)

    def _candidates(self, array: npt.NDArray[np.uint8], n: int) -> npt.NDArray[np.int64]:
        size = words_at(array, n, 12, self.order)
        fraction, captured = (words_at(array, n, shift, self.order)[: len(size)] for shift in (4, 8))
        limit = 1_000_000_000 // self.unit_ns
        return np.flatnonzero((captured <= size) & (size <= _MAX_RECORD) & (captured > 0) & (fraction < limit))

    def _followed(self, at: int) -> bool:
        """Whether a record begins at a place of the window: a frame of the usual form, or two records in a row."""
        data = self.window.data
        head = data[at : at + 16 + FRAME_BYTES]
        if not self._sound(head):
            return False
        captured, size = struct.unpack_from(self.order + "2I", head, 8)
        end = at + 16 + captured
        before = HEADER.get(self.link, 0)
        if self.link in HEADER and captured == size and captured - before in (16, FRAME_BYTES) and end <= len(data):
            frame = data[at + 16 + before : end]
            if frame[4] <= len(frame) - 8 and not frame[6]:
                return True
        return end == len(data) or self._sound(data[end : end + 16 + FRAME_BYTES])
