"""Writes BLF, laid out so that python-can, vblf, Wireshark and Vector's own tools read it.

Frames become CAN_MESSAGE (48 bytes) and CAN_FD_MESSAGE (120 bytes) objects, error frames CAN_ERROR_EXT (64 bytes), or
CAN_FD_ERROR_64 (144 bytes) where they are flagged CAN FD. The class of an error frame stands where these objects have
the identifier of the disturbed frame, its data where they have that frame's data; that it was sent is bit 14 of the
extended error flags. All sizes are multiples of 8, so objects need no padding between them.
"""

import zlib
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import tzinfo
from typing import IO

import numpy as np
import numpy.typing as npt

from hil.log.blf import layout
from hil.log.frames import FD_CODES, MAX_STANDARD_ID, FrameFlag, FrameTable, LogError, LogFacts
from hil.log.write import numbered

CONTAINER_BYTES = 128 * 1024  # of objects in one container, as Vector's and python-can's writers have it
LEVEL = 4  # of zlib: the size of level 6 within 1 %, in half the time
THREADS = 2
API_NUMBER = 4_081_200  # of Vector's library whose layout this is, as vblf states it
HOUR_NS = 3_600_000_000_000

_HEAD = [
    ("signature", "S4"), ("header_size", "<u2"), ("version", "<u2"), ("size", "<u4"), ("type", "<u4"),
    ("unit", "<u4"), ("client", "<u2"), ("object_version", "<u2"), ("stamp", "<i8"),
]  # fmt: skip
_CLASSICAL = np.dtype([*_HEAD, ("channel", "<u2"), ("flags", "u1"), ("dlc", "u1"), ("id", "<u4"), ("data", "u1", 8)])
_FD = np.dtype([
    *_HEAD, ("channel", "<u2"), ("flags", "u1"), ("dlc", "u1"), ("id", "<u4"), ("frame_length", "<u4"),
    ("bits", "u1"), ("fd", "u1"), ("valid", "u1"), ("", "V5"), ("data", "u1", 64), ("", "V4"),
])  # fmt: skip
_ERROR = np.dtype([
    *_HEAD, ("channel", "<u2"), ("", "V8"), ("dlc", "u1"), ("", "V5"), ("id", "<u4"), ("more", "<u2"), ("", "V2"),
    ("data", "u1", 8),
])  # fmt: skip
_ERROR_64 = np.dtype([
    *_HEAD, ("channel", "u1"), ("dlc", "u1"), ("valid", "u1"), ("", "V3"), ("more", "<u2"), ("fd", "<u2"), ("", "V2"),
    ("id", "<u4"), ("", "V28"), ("data", "u1", 64), ("", "V4"),
])  # fmt: skip
_KINDS = (
    (layout.CAN_MESSAGE, _CLASSICAL),
    (layout.CAN_FD_MESSAGE, _FD),
    (layout.CAN_ERROR_EXT, _ERROR),
    (layout.CAN_FD_ERROR_64, _ERROR_64),
)
_SIZES = np.array([dtype.itemsize for _, dtype in _KINDS], np.int64)
_CODES = np.zeros(256, np.uint8)
"""Length code of a number of data bytes."""
_CODES[list(FD_CODES)] = range(16)


def write_blf(file: IO[bytes], tables: Iterable[FrameTable], facts: LogFacts, zone: tzinfo) -> None:
    """Write a BLF file: start to the millisecond, as a wall clock in ``zone``; stamps to the nanosecond.

    Raises
    ------
    LogError
        When the stamps are farther from the start than 64 bits of nanoseconds reach.
    """
    start_ns = _start(facts.least_ns if facts.start_ns is None else facts.start_ns, zone)
    if not -(2**63) <= facts.least_ns - start_ns <= facts.last_ns - start_ns < 2**63:
        raise LogError(getattr(file, "name", "BLF"), "stamps reach over more than 292 years; BLF holds less")
    file.write(bytes(layout.FILE_HEADER_SIZE))
    size = unpacked = layout.FILE_HEADER_SIZE
    head_size = layout.OBJECT.size + layout.CONTAINER.size
    with ThreadPoolExecutor(THREADS) as pool:
        for content_size, packed in _deflated(_pieces(tables, facts, start_ns), pool):
            object_size = head_size + len(packed)
            file.write(layout.OBJECT.pack(layout.SIGNATURE, layout.OBJECT.size, 1, object_size, layout.LOG_CONTAINER))
            file.write(layout.CONTAINER.pack(layout.DEFLATED, content_size))
            file.write(packed + bytes(object_size % 4))  # this many, not as many as are missing, is the custom
            size += object_size + object_size % 4
            unpacked += head_size + content_size
    first = layout.system_time(start_ns, zone)
    last = layout.system_time(facts.last_ns if facts.frames else start_ns, zone)
    application = (0, LEVEL, 0, 1)  # none of Vector's
    counts = (size, unpacked, min(facts.frames, 2**32 - 1), 0)
    file.seek(0)
    file.write(
        layout.FILE_HEADER.pack(b"LOGG", layout.FILE_HEADER_SIZE, API_NUMBER, *application, *counts, *first, *last)
    )
    file.seek(0, 2)


def _start(time_ns: int, zone: tzinfo) -> int:
    """The start: the whole millisecond before, at a wall clock that is not shown twice when clocks are put back."""
    start_ns = time_ns // 1_000_000 * 1_000_000
    if start_ns < -(2**63):
        start_ns += 1_000_000
    for earlier in range(4):
        shown_once = start_ns - earlier * HOUR_NS
        if layout.start_ns(layout.system_time(shown_once, zone), zone) == shown_once:
            return shown_once
    return start_ns


def _deflated(pieces: Iterable[bytes], pool: ThreadPoolExecutor) -> Iterator[tuple[int, bytes]]:
    """Sizes and deflated contents, in order; a few are deflated ahead."""
    jobs: deque[tuple[int, Future[bytes]]] = deque()
    for piece in pieces:
        jobs.append((len(piece), pool.submit(zlib.compress, piece, LEVEL)))
        if len(jobs) > 4 * THREADS:
            size, job = jobs.popleft()
            yield size, job.result()
    for size, job in jobs:
        yield size, job.result()


def _pieces(tables: Iterable[FrameTable], facts: LogFacts, start_ns: int) -> Iterator[bytes]:
    """The objects of all frames, cut into contents of containers wherever these are full."""
    rest = b""
    for table, channels in numbered(tables, facts):
        block = rest + objects(table, channels, start_ns).tobytes()
        whole = len(block) - len(block) % CONTAINER_BYTES
        for at in range(0, whole, CONTAINER_BYTES):
            yield block[at : at + CONTAINER_BYTES]
        rest = block[whole:]
    if rest:
        yield rest


def objects(table: FrameTable, channels: npt.NDArray[np.uint8], start_ns: int) -> npt.NDArray[np.uint64]:
    """BLF objects of the frames in their order, as words of 8 bytes."""
    fd = (table.flags & FrameFlag.FD) != 0
    error = (table.flags & FrameFlag.ERROR) != 0
    kinds = fd + 2 * error  # index into _KINDS
    sizes = _SIZES[kinds] // 8
    ends = np.cumsum(sizes)
    words = np.zeros(int(ends[-1]) if len(ends) else 0, np.uint64)
    begins = ends - sizes
    for k in np.unique(kinds).tolist():
        rows = np.flatnonzero(kinds == k)
        if len(rows) == len(kinds):
            return _records(table, channels, start_ns, k)
        packed = _records(table.take(rows), channels[rows], start_ns, k).reshape(len(rows), -1)
        words[begins[rows][:, None] + np.arange(packed.shape[1])] = packed
    return words


def _records(table: FrameTable, channels: npt.NDArray[np.uint8], start_ns: int, k: int) -> npt.NDArray[np.uint64]:
    """Objects of frames that are all of one kind."""
    kind, dtype = _KINDS[k]
    one = np.zeros(len(table), dtype)
    one["signature"], one["header_size"], one["version"] = layout.SIGNATURE, layout.TIME_HEADER_SIZE, 1
    one["size"], one["type"], one["unit"] = dtype.itemsize, kind, layout.ONE_NS
    one["stamp"] = table.time_ns - start_ns
    one["channel"] = channels
    flags = table.flags
    fd, error = kind in (layout.CAN_FD_MESSAGE, layout.CAN_FD_ERROR_64), "more" in (dtype.names or ())
    wide = table.can_id > MAX_STANDARD_ID if error else table.extended
    one["id"] = table.can_id | np.where(wide, np.uint32(layout.EXTENDED), np.uint32(0))
    one["dlc"] = _CODES[table.length]
    held = table.data[:, : one["data"].shape[1]]
    one["data"][:, : held.shape[1]] = held
    remote, sent = (flags & FrameFlag.REMOTE) != 0, (flags & FrameFlag.SENT) != 0
    if error:
        one["more"] = np.where(sent, layout.ERROR_SENT, 0)
    else:
        one["flags"] = np.where(remote, layout.REMOTE, 0) | np.where(sent, layout.SENT, 0)
    if fd:
        one["valid"] = np.where(remote, 0, table.length)
        switched, state = (flags & FrameFlag.BIT_RATE_SWITCH) != 0, (flags & FrameFlag.ERROR_STATE) != 0
        bits = (layout.ERROR_FD, layout.ERROR_BRS, layout.ERROR_ESI) if error else (1, 2, 4)
        one["fd"] = bits[0] | np.where(switched, bits[1], 0) | np.where(state, bits[2], 0)
    return one.view(np.uint64)
