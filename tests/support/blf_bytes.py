"""BLF files put together by hand, object by object."""

import struct
import zlib

FILE_HEADER = struct.Struct("<4sLL4BQQLL8H8H")
START = (2024, 9, 2, 24, 10, 15, 30, 500)  # a Tuesday
START_NS = 1_727_172_930_500_000_000


def file_of(*pieces, start=START, size=None, header_size=144):
    """A file of objects and containers."""
    body = b"".join(pieces)
    size = header_size + len(body) if size is None else size
    header = FILE_HEADER.pack(b"LOGG", header_size, 4_081_200, 0, 6, 0, 0, size, size, 0, 0, *start, *start)
    return header.ljust(header_size, b"\0") + body


def container(content, method=2, size=None, packed=None):
    """A container; ``size`` and ``packed`` where they are not those of the content."""
    if packed is None:
        packed = zlib.compress(content) if method == 2 else content
    body = struct.pack("<H6xL4x", method, len(content) if size is None else size) + packed
    whole = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body
    return whole + bytes(len(whole) % 4)


def one(kind, body, stamp=0, unit=2, version=1, header_size=None, size=None):
    """An object with its header; ``size`` where it is not the right one."""
    header_size = {1: 32, 2: 40}.get(version, 32) if header_size is None else header_size
    size = header_size + len(body) if size is None else size
    head = struct.pack("<4sHHLL", b"LOBJ", header_size, version, size, kind)
    return (head + struct.pack("<L4xq", unit, stamp)).ljust(header_size, b"\0") + body


def classical(can_id=0x123, data=b"\1\2", dlc=None, flags=0, channel=1, kind=1, **more):
    """CAN_MESSAGE, or CAN_MESSAGE2 as ``kind`` 86."""
    body = struct.pack("<HBBL8s", channel, flags, len(data) if dlc is None else dlc, can_id, data)
    return one(kind, body + (struct.pack("<LBxH", 200_000, 100, 0) if kind == 86 else b""), **more)


def fd(can_id=0x123, data=bytes(12), dlc=9, flags=0, kinds=1, valid=None, held=64, channel=1, **more):
    """CAN_FD_MESSAGE; ``held`` data bytes are stored."""
    valid = len(data) if valid is None else valid
    body = struct.pack("<HBBLLBBB5x", channel, flags, dlc, can_id, 0, 0, kinds, valid)
    return one(100, body + data.ljust(held, b"\0")[:held] + bytes(4), **more)


def fd_64(can_id=0x123, data=bytes(12), dlc=9, kinds=0x1000, valid=None, direction=0, behind=b"", channel=1, **more):
    """CAN_FD_MESSAGE_64; ``behind`` follows the data."""
    valid, offset = len(data) if valid is None else valid, 72 + len(data) if behind else 0
    body = struct.pack("<BBBBLLLLLLLHBBL", channel, dlc, valid, 0, can_id, 0, kinds, *[0] * 5, direction, offset, 0)
    return one(101, body + data + behind, **more)


def error(**more):
    """CAN_ERROR."""
    return one(2, struct.pack("<HHL", 1, 0, 0), **more)


def error_ext(can_id=0x123, data=b"", dlc=None, flags=0, **more):
    """CAN_ERROR_EXT; ``flags`` are the extended ones."""
    dlc = len(data) if dlc is None else dlc
    return one(73, struct.pack("<HHLBBBxLLH2x8s", 1, 0, 0, 0, 0, dlc, 0, can_id, flags, data), **more)


def error_64(can_id=0x123, data=b"", dlc=None, flags=0, kinds=0, **more):
    """CAN_FD_ERROR_64; ``flags`` are the extended ones, ``kinds`` those of CAN FD."""
    dlc, numbers = len(data) if dlc is None else dlc, [0] * 6
    head = struct.pack("<BBBBHHHBxL", 1, dlc, len(data), 0, 0, flags, kinds, 0, can_id)
    return one(104, head + struct.pack("<LLLLLLHxx", *numbers, 0) + data, **more)


def marker(text=b"a note", kind=96, **more):
    """An object that is no frame."""
    return one(kind, text, **more)
