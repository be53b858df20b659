"""Packets between loopback members: pure bytes, no socket.

One packet of a seqpacket Unix socket, little endian:

    offset  size       field
    0       4          b"BBL1"
    4       4          count     frames in this packet, 1..64
    8       8          sequence  frames addressed to this peer before this packet, lost ones included
    16      8          time_ns   the sender's CLOCK_MONOTONIC, ns, at least 0
    24      16 count   frames    can_id u32 (bit 31: extended), length u8 (0..8), 3 of padding, 8 of data

The sequence counts frames, not packets: the gap to the one expected is exactly what a full queue lost.
"""

import struct
from collections.abc import Sequence

from dbc.frame import BusName, Frame

MAGIC = b"BBL1"
MAX_FRAMES = 64
_HEADER = struct.Struct("<4sIQq")
_RECORD = struct.Struct("<IB3x8s")
_EXTENDED = 1 << 31
MAX_PACKET = _HEADER.size + MAX_FRAMES * _RECORD.size

pack_header = _HEADER.pack


def pack_frames(frames: Sequence[Frame], bus: BusName) -> bytes:
    """Return the records of up to `MAX_FRAMES` frames.

    Raises
    ------
    ValueError : a frame of the other bus, an identifier out of range, more than 8 data bytes.
    """
    pack = _RECORD.pack
    records = []
    for frame in frames:
        frame_bus, can_id, data, _, extended = frame
        if frame_bus != bus or len(data) > 8 or not 0 <= can_id <= (0x1FFFFFFF if extended else 0x7FF):
            raise ValueError(f"cannot send {frame}: expected bus {bus}, 0..8 bytes, an id of 11 (extended: 29) bits")
        records.append(pack(can_id | _EXTENDED if extended else can_id, len(data), data))
    return b"".join(records)


def unpack(packet: bytes, bus: BusName) -> tuple[int, list[Frame]] | None:
    """Return a packet's sequence and frames, or None where it is not one of ours."""
    if len(packet) < _HEADER.size:
        return None
    magic, count, sequence, time_ns = _HEADER.unpack_from(packet)
    if (
        magic != MAGIC
        or not 0 < count <= MAX_FRAMES
        or len(packet) != _HEADER.size + count * _RECORD.size
        or time_ns < 0
    ):
        return None
    frames = []
    for can_id, length, data in _RECORD.iter_unpack(memoryview(packet)[_HEADER.size :]):
        if length > 8:
            return None
        if can_id <= 0x7FF:
            frames.append(Frame(bus, can_id, data[:length], time_ns))
        elif can_id & _EXTENDED and can_id ^ _EXTENDED <= 0x1FFFFFFF:
            frames.append(Frame(bus, can_id ^ _EXTENDED, data[:length], time_ns, True))
        else:
            return None
    return sequence, frames
