"""The CAN frame in one BLF object, whose sizes were checked."""

import struct

from hil.log.blf import layout
from hil.log.frames import FrameFlag

Fields = tuple[int, int, int, bytes, FrameFlag]
"""Channel number, DLC, identifier with its bit 31, data bytes that are there, flags."""


def fields_of(one: bytes, header: int, kind: int) -> tuple[int, Fields | None]:
    """Read an object of one of the types in `hil.log.blf.layout.LEAST_BODY`.

    Returns
    -------
    Bytes behind the header (of ``header`` bytes) that the layout uses, and the fields; None in their place for a
    request to send, which is no frame yet.
    """
    used, direction, size = int(layout.FULL_BODY[kind]), 0, len(one)
    flags, fd = FrameFlag(0), (0, 0, 0)
    data, dlc, can_id = b"", 0, 0
    if kind in (layout.CAN_MESSAGE, layout.CAN_MESSAGE_2):
        channel, bits, dlc, can_id = layout.CLASSICAL.unpack_from(one, header)
        data, direction = one[header + 8 : header + 16], bits & layout.DIRECTION
        flags |= FrameFlag.REMOTE if bits & layout.REMOTE else FrameFlag(0)
    elif kind == layout.CAN_FD_MESSAGE:
        channel, bits, dlc, can_id, _, _, kinds, valid = layout.FD.unpack_from(one, header)
        data, direction = one[header + 20 : header + 20 + valid], bits & layout.DIRECTION
        flags |= FrameFlag.REMOTE if bits & layout.REMOTE else FrameFlag(0)
        fd = (kinds & 1, kinds & 2, kinds & 4)
    elif kind == layout.CAN_FD_MESSAGE_64:
        channel, dlc, valid, _, can_id, _, kinds, *_, direction, behind, _ = layout.FD_64.unpack_from(one, header)
        data = one[header + 40 : min(header + 40 + valid, behind or size)]
        used = 40 + len(data)
        flags |= FrameFlag.REMOTE if kinds & 0x10 else FrameFlag(0)
        fd = (kinds & 0x1000, kinds & 0x2000, kinds & 0x4000)
    elif kind == layout.CAN_ERROR:
        (channel,) = struct.unpack_from("<H", one, header)
        flags |= FrameFlag.ERROR
    elif kind == layout.CAN_ERROR_EXT:
        channel, _, _, _, _, dlc, _, can_id, more = layout.ERROR.unpack_from(one, header)
        data, dlc, direction = one[header + 24 : header + 32], dlc & 15, bool(more & layout.ERROR_SENT)
        flags |= FrameFlag.ERROR
    else:
        channel, dlc, valid, _, _, more, kinds, behind, can_id, *_ = layout.ERROR_64.unpack_from(one, header)
        data = one[header + 44 : min(header + 44 + valid, behind or size)]
        used = 44 + len(data)
        dlc, direction = dlc & 15, bool(more & layout.ERROR_SENT)
        flags |= FrameFlag.ERROR
        fd = (kinds & layout.ERROR_FD, kinds & layout.ERROR_BRS, kinds & layout.ERROR_ESI)
    if direction == layout.REQUESTED:
        return used, None
    if fd[0]:
        flags |= FrameFlag.FD
        flags |= FrameFlag.BIT_RATE_SWITCH if fd[1] else FrameFlag(0)
        flags |= FrameFlag.ERROR_STATE if fd[2] else FrameFlag(0)
    flags |= FrameFlag.SENT if direction == layout.SENT else FrameFlag(0)
    return used, (channel, dlc, can_id, data, flags)
