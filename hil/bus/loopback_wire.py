"""Packets between loopback members: pure bytes, no socket.

One packet of a seqpacket Unix socket, in the machine's byte order:

    offset  size       field
    0       4          b"BBL1"
    4       4          count     frames in this packet, 0..64; none: only tells what was lost before
    8       8          sequence  frames addressed to this peer before this packet, lost ones included
    16      8          time_ns   the sender's CLOCK_MONOTONIC, ns, at least 0
    24      16 count   frames    see `hil.bus.can_frame`; no remote frames

An error frame is what somebody who shares an adapter tells of its link: `hil.bus.error_frame`, the number of
occurrences in the three bytes behind the length.

The sequence counts frames, not packets: the gap to the one expected is exactly what a full queue lost.
"""

import struct

from dbc.frame import BusName, Frame, LinkEvent, Received
from hil.bus.can_frame import CAN_FRAME, ERROR_FLAG, EXTENDED_FLAG, EXTENDED_MASK, STANDARD_MASK
from hil.bus.error_frame import MOST_NUMBER, error_frame, event_of_record

MAGIC = b"BBL1"
MAX_FRAMES = 64
_frame = tuple.__new__  # what a named tuple's own constructor calls, at half the cost
_HEADER = struct.Struct("=4sIQq")
_EVENT = struct.Struct("=IB3s8s")
MAX_PACKET = _HEADER.size + MAX_FRAMES * CAN_FRAME.size


def pack_header(count: int, sequence: int, time_ns: int) -> bytes:
    """Return a packet's header, for one peer; ``count`` frames of `hil.bus.can_frame.pack_frame` follow."""
    return _HEADER.pack(MAGIC, count, sequence, time_ns)


def pack_event(event: LinkEvent) -> bytes:
    """Return a link event in place of a frame."""
    error_class, data = error_frame(event)
    number = min(event.number, MOST_NUMBER).to_bytes(3, "little")
    return _EVENT.pack(ERROR_FLAG | error_class, len(data), number, data)


def _event(packet: bytes, index: int, bus: BusName, time_ns: int) -> LinkEvent | None:
    flagged, length, number, data = _EVENT.unpack_from(packet, _HEADER.size + index * _EVENT.size)
    return event_of_record(flagged, length, int.from_bytes(number, "little"), data, bus, time_ns)


def unpack(packet: bytes, bus: BusName) -> tuple[int, list[Received]] | None:
    """Return a packet's sequence and frames, or None where it is not one of ours."""
    if len(packet) < _HEADER.size:
        return None
    magic, count, sequence, time_ns = _HEADER.unpack_from(packet)
    if magic != MAGIC or count > MAX_FRAMES or len(packet) != _HEADER.size + count * CAN_FRAME.size or time_ns < 0:
        return None
    frames: list[Received] = []
    records = CAN_FRAME.iter_unpack(packet[_HEADER.size :])
    for can_id, length, data in records:
        if can_id & ERROR_FLAG:
            event = _event(packet, len(frames), bus, time_ns)
            if event is None:
                return None
            frames.append(event)
            continue
        extended = can_id > STANDARD_MASK
        if extended:
            can_id ^= EXTENDED_FLAG  # where the flag is missing, this gives one too large
        if length > 8 or can_id > EXTENDED_MASK:
            return None
        frames.append(_frame(Frame, (bus, can_id, data[:length], time_ns, extended)))
    return sequence, frames
