"""How BLF lays out its file header, its objects and the CAN frames in them; all little endian.

Layouts as in Vector's ``binlog_objects.h``, python-can's ``can/io/blf.py`` and vblf, which are the oracles in tests.
"""

import struct
from datetime import datetime, tzinfo

import numpy as np
import numpy.typing as npt

from hil.log.wall_clock import wall_clock_ns, wall_clock_of

# Signature, header size, API number, application (id, compression level, major, minor), file size, size unpacked,
# objects, application build, start, last object (SYSTEMTIME: year, month, day of the week, day, h, min, s, ms).
FILE_HEADER = struct.Struct("<4sLL4BQQLL8H8H")
FILE_HEADER_SIZE = 144  # with its reserved bytes
SIGNATURE = b"LOBJ"
OBJECT = struct.Struct("<4sHHLL")  # signature, header size, header version, object size, type
CONTAINER = struct.Struct("<H6xL4x")  # behind OBJECT: compression, size of its content
STORED, DEFLATED = 0, 2  # compression
TIME = struct.Struct("<L4xq")  # behind OBJECT, in header versions 1 and 2: unit, stamp
TIME_HEADER_SIZE = OBJECT.size + TIME.size
TEN_US, ONE_NS = 1, 2  # unit
CLASSICAL = struct.Struct("<HBBL")  # channel, flags, dlc, id; then 8 data bytes
FD = struct.Struct("<HBBLLBBB5x")  # channel, flags, dlc, id, duration, bits, FD flags, valid bytes; then data
FD_64 = struct.Struct("<BBBBLLLLLLLHBBL")
"""Channel, dlc, valid bytes, ..., id, duration, flags, ..., direction, offset of what follows the data, CRC; data."""
ERROR = struct.Struct("<HHLBBBxLLH2x")  # channel, ..., dlc, duration, id, extended flags; then 8 data bytes
ERROR_64 = struct.Struct("<BBBBHHHBxLLLLLLLH2x")
"""Channel, dlc, valid bytes, ecc, flags, extended code, FD flags, offset of what follows the data, id, ...; data."""

CAN_MESSAGE, CAN_ERROR, LOG_CONTAINER, CAN_ERROR_EXT = 1, 2, 10, 73
CAN_MESSAGE_2, CAN_FD_MESSAGE, CAN_FD_MESSAGE_64, CAN_FD_ERROR_64 = 86, 100, 101, 104
EXTENDED, ID_BITS = 0x8000_0000, 0x1FFF_FFFF
REMOTE, DIRECTION, SENT, REQUESTED = 0x80, 0x0F, 1, 2  # flags of a frame; a request (TxRq) is no frame yet
ERROR_SENT = 0x4000  # of the extended error flags: sent by the application
ERROR_FD, ERROR_BRS, ERROR_ESI = 0x80, 0x40, 0x20  # of the FD flags of CAN_FD_ERROR_64

MAX_HEADER = 64  # bytes, of an object that holds a frame
LEAST_BODY: npt.NDArray[np.int64] = np.zeros(256, np.int64)
"""Bytes behind its header that a frame of each type has at least; 0 for types that are no frame."""
FULL_BODY: npt.NDArray[np.int64] = np.zeros(256, np.int64)
"""Bytes behind its header that the newest known layout of each type has at most."""
for _kind, _least, _full in (
    (CAN_MESSAGE, 16, 16),
    (CAN_ERROR, 4, 8),
    (CAN_ERROR_EXT, 32, 32),
    (CAN_MESSAGE_2, 16, 24),
    (CAN_FD_MESSAGE, FD.size, FD.size + 68),
    (CAN_FD_MESSAGE_64, FD_64.size, FD_64.size + 72),
    (CAN_FD_ERROR_64, ERROR_64.size, ERROR_64.size + 72),
):
    LEAST_BODY[_kind], FULL_BODY[_kind] = _least, _full
SURPLUS = 64  # bytes that a later version may add to a layout
MAX_OBJECT = 16 * 1024 * 1024
MAX_CONTAINER = 64 * 1024 * 1024
MAX_PADDING = 7  # between objects: Vector and python-can fill up to 4 bytes, vblf to 8
LOOK = 16  # bytes behind an object in which its end is judged, and shown where they are none


def start_ns(stamp: tuple[int, ...], zone: tzinfo) -> int | None:
    """Nanoseconds since 1970 of a SYSTEMTIME in a zone; None where it is no time, or one beyond 64 bits."""
    year, month, _, day, hour, minute, second, milli = stamp
    try:
        time_ns = wall_clock_ns(datetime(year, month, day, hour, minute, second, milli * 1000), zone)
    except (ValueError, OverflowError):
        return None
    return time_ns if -(2**63) <= time_ns < 2**63 else None


def system_time(time_ns: int, zone: tzinfo) -> tuple[int, ...]:
    """SYSTEMTIME in a zone, cut to the millisecond."""
    t = wall_clock_of(time_ns, zone)
    return t.year, t.month, t.isoweekday() % 7, t.day, t.hour, t.minute, t.second, t.microsecond // 1000
