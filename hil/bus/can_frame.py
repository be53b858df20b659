"""A frame in 16 bytes: linux/can.h's ``struct can_frame``, used on SocketCAN and between loopback members alike.

u32  can_id    bits 0..28 the identifier, 29 error frame, 30 remote frame, 31 extended
u8   length    0..8
3    of padding
8    data      padded with 0
"""

import struct

from dbc.frame import BusName, Frame

CAN_FRAME = struct.Struct("=IB3x8s")
ERROR_FLAG, REMOTE_FLAG, EXTENDED_FLAG = 1 << 29, 1 << 30, 1 << 31
STANDARD_MASK, EXTENDED_MASK = 0x7FF, 0x1FFFFFFF

_pack = CAN_FRAME.pack


def pack_frame(frame: Frame, bus: BusName) -> bytes:
    """Return the frame as bytes for ``bus``.

    Raises
    ------
    ValueError : a frame of the other bus, an identifier out of range, more than 8 data bytes.
    """
    frame_bus, can_id, data, _, extended = frame
    if frame_bus != bus or len(data) > 8 or not 0 <= can_id <= (EXTENDED_MASK if extended else STANDARD_MASK):
        raise ValueError(f"cannot send {frame}: expected bus {bus}, 0..8 bytes, an id of 11 (extended: 29) bits")
    return _pack(can_id | EXTENDED_FLAG if extended else can_id, len(data), data)
