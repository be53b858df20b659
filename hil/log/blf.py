"""Vector's binary logging format (BLF), read object by object and with every length checked; written.

Layouts as in python-can's ``can/io/blf.py``, which is the oracle in tests. It is not used itself because its reader
loops for ever on an object of size 0, inflates without a bound and takes a cut file for a whole one, and its writer
loses stamps before 1990 and cuts the others to what a float holds.
"""

import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from hil.log.frames import FD_CODES, FrameBuilder, FrameFlag, FrameTable, LogError, Recording

FILE_HEADER = struct.Struct("<4sL8xQQLL8H8H")  # signature, header size, ..., file size, ..., start, stop
OBJECT = struct.Struct("<4sHHLL")  # signature, header size, header version, object size, type
FILE_HEADER_SIZE = 144
TIME = struct.Struct("<L4xQ")  # behind OBJECT in header versions 1 and 2: unit, stamp
CONTAINER = struct.Struct("<H6xL4x")  # compression, size of its content
CLASSICAL = struct.Struct("<HBBL")  # channel, flags, dlc, id; then 8 data bytes
FD = struct.Struct("<HBBLLBBB5x")  # channel, flags, dlc, id, ..., FD flags, valid bytes; then data
FD_64 = struct.Struct("<BBBBLLLLLLLHBBL")  # channel, dlc, valid bytes, ..., id, ..., flags; then data
ERROR = struct.Struct("<HHLBBBxLLH2x")  # channel, ..., dlc, ..., id; then 8 data bytes
LOG_CONTAINER, CAN_MESSAGE, CAN_MESSAGE_2, CAN_ERROR, CAN_FD_MESSAGE, CAN_FD_MESSAGE_64 = 10, 1, 86, 73, 100, 101
EXTENDED, REMOTE = 0x8000_0000, 0x80
CONTAINER_BYTES = 128 * 1024  # of a container we write
MAX_CONTAINER = 64 * 1024 * 1024
MAX_OBJECT = 16 * 1024 * 1024
MAX_PADDING = 3
FRAME_KINDS = frozenset({CAN_MESSAGE, CAN_MESSAGE_2, CAN_ERROR, CAN_FD_MESSAGE, CAN_FD_MESSAGE_64})
FD_FLAGS = (FrameFlag.FD, FrameFlag.BIT_RATE_SWITCH, FrameFlag.ERROR_STATE, FrameFlag.REMOTE)


def read_blf(path: Path) -> Recording:
    """Read a BLF file; objects that are no CAN frame are passed over, damaged ones are rejected.

    Raises
    ------
    LogError
        When it has no BLF header, or a container of absurd size.
    """
    content = path.read_bytes()
    if len(content) < FILE_HEADER.size or content[:4] != b"LOGG":
        raise LogError(path, f"no BLF file: expected LOGG and a header of {FILE_HEADER_SIZE} bytes", 0)
    header = FILE_HEADER.unpack_from(content)
    start_ns = _start_ns(header[6:14])
    builder = FrameBuilder()
    truncated_at: int | None = None
    tail = b""
    position = header[1]
    while position < len(content):
        found = content.find(b"LOBJ", position)
        if (found if found >= 0 else len(content)) - position > MAX_PADDING:
            builder.reject(position, f"bytes that are no object: {content[position : position + 16]!r}")
        if found < 0:
            break
        if found + OBJECT.size > len(content):
            truncated_at = found
            break
        position = found
        _, header_size, _, size, kind = OBJECT.unpack_from(content, position)
        if size < OBJECT.size:
            builder.reject(position, f"object of type {kind} and {size} bytes")
            position += OBJECT.size
            continue
        if position + size > len(content):
            truncated_at = position
        if kind == LOG_CONTAINER:
            body = memoryview(content)[position + header_size : position + size]
            stream, cut = _content(path, position, body, builder)
            tail = _objects(builder, tail + stream, position, start_ns)
            truncated_at = position if cut else truncated_at
        else:
            _objects(builder, content[position : position + size], position, start_ns)
        position += size
    if tail.startswith(b"LOBJ") and truncated_at is None:
        truncated_at = len(content)
    whole = header[2]  # a writer that was killed leaves the size of the bare header
    if truncated_at is None and (whole > len(content) or whole == header[1] < len(content)):
        truncated_at = len(content)
    return builder.recording(path, "blf", truncated_at)


def _start_ns(stamp: tuple[int, ...]) -> int:
    year, month, _, day, hour, minute, second, milli = stamp
    try:
        return int(datetime(year, month, day, hour, minute, second, tzinfo=UTC).timestamp()) * 10**9 + milli * 10**6
    except ValueError:
        return 0  # no start time; stamps count from 0


def _content(path: Path, position: int, body: memoryview, builder: FrameBuilder) -> tuple[bytes, bool]:
    """Content of a container, and whether it ends early; a damaged one counts as one rejected object."""
    if len(body) < CONTAINER.size:
        return b"", True
    method, size = CONTAINER.unpack_from(body)
    if size > MAX_CONTAINER:
        raise LogError(path, f"container of {size} bytes; at most {MAX_CONTAINER} are read", position)
    packed = body[CONTAINER.size :]
    if method == 0:
        return bytes(packed[:size]), len(packed) < size
    try:
        inflater = zlib.decompressobj()
        stream = inflater.decompress(packed, size + 1) if method == 2 else None
    except zlib.error:
        stream = None
    if stream is None or len(stream) > size:
        builder.reject(position, f"container of compression {method} and {size} bytes cannot be unpacked")
        return b"", False
    return stream, len(stream) < size


def _objects(builder: FrameBuilder, stream: bytes, offset: int, start_ns: int) -> bytes:
    """Take the objects of a stream; return the unfinished rest. ``offset`` is where its container starts."""
    position = 0
    lost = False  # behind an object of impossible size, counted already
    while True:
        found = stream.find(b"LOBJ", position)
        if not lost and (found if found >= 0 else len(stream)) - position > MAX_PADDING:
            builder.reject(offset, f"bytes that are no object: {stream[position : position + 16]!r}")
        if found < 0:
            return stream[max(position, len(stream) - MAX_PADDING) :]
        if found + OBJECT.size > len(stream):
            return stream[found:]
        _, header_size, version, size, kind = OBJECT.unpack_from(stream, found)
        if not OBJECT.size <= size <= MAX_OBJECT:
            builder.reject(offset, f"object of type {kind} and {size} bytes")
            position, lost = found + 4, True
            continue
        if found + size > len(stream):
            return stream[found:]
        if kind in FRAME_KINDS:
            one = stream[found : found + size]
            try:
                taken = _frame(builder, one, (header_size, version, kind), start_ns)
            except struct.error:  # shorter than its layout
                taken = False
            if not taken:
                builder.reject(offset, f"object of type {kind}: {one[:32].hex(' ')}")
        position, lost = found + size, False


def _frame(builder: FrameBuilder, one: bytes, layout: tuple[int, int, int], start_ns: int) -> bool:
    header_size, version, kind = layout
    if version not in (1, 2):
        return False
    unit, stamp = TIME.unpack_from(one, OBJECT.size)
    time_ns = start_ns + stamp * (10_000 if unit == 1 else 1)
    flags = FrameFlag(0)
    if kind in (CAN_MESSAGE, CAN_MESSAGE_2):
        channel, bits, length, can_id = CLASSICAL.unpack_from(one, header_size)
        at = header_size + CLASSICAL.size
        data = one[at : at + min(length, 8)]
        flags |= FrameFlag.REMOTE if bits & REMOTE else FrameFlag(0)
    elif kind == CAN_ERROR:
        channel, _, _, _, _, length, _, can_id, _ = ERROR.unpack_from(one, header_size)
        at = header_size + ERROR.size
        data = one[at : at + min(length, 8)]
        flags |= FrameFlag.ERROR
    else:
        if kind == CAN_FD_MESSAGE:
            channel, bits, _, can_id, _, _, fd, length = FD.unpack_from(one, header_size)
            at = header_size + FD.size
            kinds = (fd & 1, fd & 2, fd & 4, bits & REMOTE)
        else:
            channel, _, length, _, can_id, _, fd, *_ = FD_64.unpack_from(one, header_size)
            at = header_size + FD_64.size
            kinds = (fd & 0x1000, fd & 0x2000, fd & 0x4000, fd & 0x10)
        # Some writers store fewer bytes than they state; the rest reads as zero (as Vector's own library does).
        data = one[at : at + length].ljust(length, b"\0")
        for wanted, flag in zip(kinds, FD_FLAGS, strict=True):
            flags |= flag if wanted else FrameFlag(0)
    if kind != CAN_FD_MESSAGE_64 and len(data) < length and not flags & FrameFlag.REMOTE:
        return False
    extended = bool(can_id & EXTENDED)
    return builder.add(time_ns, f"can{max(channel, 1) - 1}", can_id & 0x1FFF_FFFF, extended, data, flags, length)


def write_blf(frames: FrameTable, path: Path, numbers: list[int]) -> None:
    """Write a BLF file: start to the millisecond, stamps to the nanosecond, from channel ``numbers``."""
    first_ns = int(frames.time_ns.min()) // 10**6 * 10**6 if len(frames) else 0
    last_ns = int(frames.time_ns.max()) if len(frames) else 0
    size, unpacked = FILE_HEADER_SIZE, FILE_HEADER_SIZE
    with path.open("wb") as file:
        file.write(bytes(FILE_HEADER_SIZE))
        objects = bytearray()
        for one in _packed(frames, numbers, first_ns):
            objects += one
            if len(objects) >= CONTAINER_BYTES:
                size, unpacked = size + file.write(_container(objects)), unpacked + len(objects)
                objects = bytearray()
        if objects:
            size, unpacked = size + file.write(_container(objects)), unpacked + len(objects)
        file.seek(0)
        stamps = (*_system_time(first_ns), *_system_time(last_ns))
        file.write(FILE_HEADER.pack(b"LOGG", FILE_HEADER_SIZE, size, unpacked, len(frames), 0, *stamps))


def _system_time(time_ns: int) -> tuple[int, ...]:
    t = datetime.fromtimestamp(time_ns // 10**9, UTC)
    return t.year, t.month, t.isoweekday() % 7, t.day, t.hour, t.minute, t.second, time_ns // 10**6 % 1000


def _container(objects: bytearray) -> bytes:
    packed = zlib.compress(objects)
    size = OBJECT.size + CONTAINER.size + len(packed)
    head = OBJECT.pack(b"LOBJ", OBJECT.size, 1, size, LOG_CONTAINER) + CONTAINER.pack(2, len(objects))
    return head + packed + bytes(size % 4)


def _packed(frames: FrameTable, numbers: list[int], first_ns: int) -> Iterator[bytes]:
    columns = (frames.time_ns, frames.channel, frames.can_id, frames.extended, frames.length, frames.flags)
    head_size = OBJECT.size + TIME.size
    for row, (time_ns, number, can_id, extended, length, flags) in enumerate(
        zip(*(c.tolist() for c in columns), strict=True)
    ):
        channel, can_id = numbers[number] + 1, can_id | (EXTENDED if extended else 0)
        data = frames.data[row, :length].tobytes()
        bits = REMOTE if flags & FrameFlag.REMOTE else 0
        if flags & FrameFlag.ERROR:
            kind, body = CAN_ERROR, ERROR.pack(channel, 0, 0, 0, 0, length, 0, can_id, 0) + data.ljust(8, b"\0")
        elif flags & FrameFlag.FD:
            fd = sum(1 << i for i, flag in enumerate(FD_FLAGS[:3]) if flags & flag)
            body = FD.pack(channel, bits, FD_CODES.index(length), can_id, 0, 0, fd, length) + data.ljust(64, b"\0")
            kind = CAN_FD_MESSAGE
        else:
            kind, body = CAN_MESSAGE, CLASSICAL.pack(channel, bits, length, can_id) + data.ljust(8, b"\0")
        size = head_size + len(body)
        stamp = TIME.pack(2, time_ns - first_ns)
        yield OBJECT.pack(b"LOBJ", head_size, 1, size, kind) + stamp + body + bytes(size % 4)
