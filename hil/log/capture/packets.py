"""CAN frames in captured packets: SocketCAN's link type and Linux cooked captures; and the bytes they are read from.

Sources: tcpdump.org's pages on LINKTYPE_CAN_SOCKETCAN, LINKTYPE_LINUX_SLL and LINKTYPE_LINUX_SLL2. The identifier is
big-endian in the first, in the byte order of the capturing machine (which is the file's) in the two others.
"""

import struct
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.frames import FrameFlag, FrameTable, LogError
from hil.log.source import Source

SOCKETCAN, COOKED, COOKED_2 = 227, 113, 276
HEADER = {SOCKETCAN: 0, COOKED: 16, COOKED_2: 20}
"""Bytes before the CAN header, by link type."""
FRAME_BYTES = 72  # the CAN FD frame of Linux
XL_BYTES = 12 + 2048
_CAN, _CAN_FD, _CAN_XL = 0x000C, 0x000D, 0x000E
_EXTENDED, _REMOTE, _ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
_BRS, _ESI, _FDF = 1, 2, 4
_XL = 0x80
_OUTGOING = 4
_FIRST_WINDOW = 256
BLOCK_BYTES = 256 * 1024  # read at once


class Packet(NamedTuple):
    """A CAN frame as `hil.log.builder.FrameBuilder.add` takes it, and the interface where the link type names one."""

    can_id: int
    extended: bool
    data: bytes
    flags: FrameFlag
    length: int
    interface: int | None


def frame_of(packet: bytes, size: int, link: int, order: str) -> Packet | str | None:
    """Decode a packet.

    Parameters
    ----------
    packet : what was captured of it.
    size : its whole size.
    link : its link type, one of `HEADER`.
    order : "<" or ">", the file's byte order.

    Returns
    -------
    The frame; or what the packet is instead (a packet of another protocol); or None, where it is damaged.
    """
    interface: int | None = None
    protocol: int | None = None
    flags = FrameFlag(0)
    if len(packet) < HEADER[link]:
        return None
    if link == COOKED:
        kind, protocol = int.from_bytes(packet[0:2], "big"), int.from_bytes(packet[14:16], "big")
        flags |= FrameFlag.SENT if kind == _OUTGOING else FrameFlag(0)
    elif link == COOKED_2:
        protocol, interface = int.from_bytes(packet[0:2], "big"), int.from_bytes(packet[4:8], "big")
        flags |= FrameFlag.SENT if packet[10] == _OUTGOING else FrameFlag(0)
    else:
        order = ">"
    if protocol not in (None, _CAN, _CAN_FD, _CAN_XL):
        return f"protocol 0x{protocol:04X}"
    frame = packet[HEADER[link] :]
    if len(frame) < 8:
        return None
    (word,) = struct.unpack_from(order + "I", frame)
    length, bits = frame[4], frame[5]
    if protocol == _CAN_XL or (protocol is None and length & _XL):
        return "CAN XL"
    if len(frame) > FRAME_BYTES:
        return None
    # Captures of old have no FDF bit: there the size tells.
    if protocol == _CAN_FD or (protocol is None and (bits & _FDF or size == FRAME_BYTES or length > 8)):
        flags |= FrameFlag.FD
        flags |= FrameFlag.BIT_RATE_SWITCH if bits & _BRS else FrameFlag(0)
        flags |= FrameFlag.ERROR_STATE if bits & _ESI else FrameFlag(0)
    flags |= FrameFlag.REMOTE if word & _REMOTE else FrameFlag(0)
    flags |= FrameFlag.ERROR if word & _ERROR else FrameFlag(0)
    data = b"" if flags & FrameFlag.REMOTE else frame[8 : 8 + length]
    if len(data) < length and not flags & FrameFlag.REMOTE:  # captured in part
        return None
    return Packet(word & 0x1FFF_FFFF, bool(word & _EXTENDED), data, flags, length, interface)


def with_can(tables: Iterable[FrameTable], source: Source, account: Account) -> Iterator[FrameTable]:
    """Yield the tables of a capture; LogError at the end of one that has other packets only, of a network say."""
    frames = 0
    for table in tables:
        frames += len(table)
        yield table
    if not frames and account.passed_over and account.whole:
        kinds = ", ".join(f"{count} of {kind}" for kind, count in account.passed_over.items())
        raise LogError(source.path, f"no CAN frame in it ({kinds}); give the capture of a CAN interface")


class Window:
    """The part of a source that is looked at: ``data`` from ``at`` on.

    Attributes
    ----------
    data, array, at : bytes of the source, the same as uint8 (n,), and where in them the reader stands.
    base : offset of the first of them in the source.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self.data = b""
        self.at = 0
        self.base = 0
        self.array: npt.NDArray[np.uint8] = np.zeros(0, np.uint8)
        self._ended = False

    @property
    def offset(self) -> int:
        """Where the reader stands in the source."""
        return self.base + self.at

    def few(self) -> bool:
        """Whether the source is small, as far as can be told here."""
        return self._source.few(self.base)

    def left(self, size: int) -> int:
        """How many bytes are left, as far as there are up to ``size`` of them."""
        if len(self.data) - self.at < size and not self._ended:
            parts = [self.data[self.at :]]
            have = len(parts[0])
            while have < size and (part := self._source.read(max(BLOCK_BYTES, size - have))):
                parts.append(part)
                have += len(part)
            self._ended = have < size
            self.base += self.at
            self.data, self.at = b"".join(parts), 0
            self.array = np.frombuffer(self.data, np.uint8)
        return len(self.data) - self.at

    def peek(self, size: int) -> bytes:
        """The next bytes, fewer at the end."""
        self.left(size)
        return self.data[self.at : self.at + size]

    def advance(
        self,
        reach: int,
        candidates: Callable[[npt.NDArray[np.uint8], int], npt.NDArray[np.int64]],
        sound: Callable[[int], bool],
    ) -> bool:
        """Go on to the next place that looks like the begin of a record; False where there is none up to the end.

        Parameters
        ----------
        reach : bytes from a place on that are needed to judge it.
        candidates : gives the places worth judging among the first n of a uint8 array.
        sound : judges a place, given as an index in `data`.
        """
        self.at += 1
        step = _FIRST_WINDOW
        while True:
            have = self.left(step + reach)
            n = min(step, have)
            if n == 0:
                return False
            begin = self.at
            for k in candidates(self.array[begin:], n).tolist():
                if sound(begin + k):
                    self.at = begin + k
                    return True
            self.at = begin + n
            step = min(2 * step, 65_536)


def words_at(array: npt.NDArray[np.uint8], n: int, shift: int, order: str) -> npt.NDArray[np.uint32]:
    """The 32-bit numbers that begin at ``shift``, ``shift`` + 1, ..., uint32 (m,), of as many of n as are whole."""
    m = max(0, min(n, len(array) - shift - 3))
    octets = (
        np.lib.stride_tricks.sliding_window_view(array[shift : shift + m + 3], 4) if m else np.zeros((0, 4), np.uint8)
    )
    return np.ascontiguousarray(octets).view(order + "u4")[:, 0].astype(np.uint32)
