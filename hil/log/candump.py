"""candump's log format, ``(seconds) channel ID#DATA``: read in blocks, written line by line."""

import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from hil.log.frames import (
    FD_LENGTHS,
    FIRST_REJECTED,
    MAX_EXTENDED_ID,
    MAX_STANDARD_ID,
    FrameFlag,
    FrameTable,
    Recording,
    Rejected,
)

BLOCK_BYTES = 2 * 1024 * 1024
MAX_LINE_BYTES = 4096
MIN_LINE_BYTES = len("(0) c 000#")
MAX_SECONDS = 9_000_000_000  # int64 nanoseconds reach a little farther
SMALL_GROUP = 16  # fewer lines of one shape are not worth an array operation
SHAPES_PER_GROUP = 4
ERROR_BIT = 0x2000_0000

# The one definition of a line; the array path below only takes lines that would match it.
LINE = re.compile(
    rb"\s*\((\d{1,10})(?:\.(\d{1,9}))?\)\s+(\S{1,32})\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#"
    rb"(?:(R)([0-8]?)|#([0-9A-Fa-f])((?:[0-9A-Fa-f]{2}){0,64})|((?:[0-9A-Fa-f]{2}){0,8}))"
    rb"(?:_[9A-Fa-f])?(?:\s+[RT])?\s*"
)
_SHAPE = re.compile(
    rb"\((?P<s>\d{1,10})\.(?P<f>\d{1,9})\) (?P<c>[!-~]{1,32}) (?P<i>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#"
    rb"(?P<d>(?:[0-9A-Fa-f]{2}){0,8})(?: [RT])?"
)
_HEX = np.full(256, 255, np.uint8)
for _i, _c in enumerate(b"0123456789ABCDEF"):
    _HEX[_c] = _i
    _HEX[ord(chr(_c).lower())] = _i
_SPACE = np.isin(np.arange(256), list(b" \t\n\r\x0b\x0c"))


class _Reader:
    """State of one reading: channel numbers and what was rejected."""

    def __init__(self) -> None:
        self.channels: dict[bytes, int] = {}
        self.parts: list[FrameTable] = []
        self.rejected = 0
        self.first: list[Rejected] = []
        self.truncated_at: int | None = None

    def channel(self, name: bytes) -> int:
        return self.channels.setdefault(name, len(self.channels))

    def show_rejected(self, offset: int, text: bytes) -> None:
        if len(self.first) < FIRST_REJECTED:
            self.first.append(Rejected(offset, text[:80].decode("ascii", "backslashreplace")))


def read_candump(path: Path) -> Recording:
    """Read a candump log; every line that is not blank becomes a frame or is counted as rejected.

    Bad lines do not end the reading. A last line without a line end is kept as a frame where it reads as one;
    ``truncated_at`` is then its offset, unless it is a classical frame of 8 bytes, to which nothing can be missing.
    """
    reader = _Reader()
    with path.open("rb") as file:
        for offset, block in _blocks(file, reader):
            if not block.endswith(b"\n"):
                tail = block.rfind(b"\n") + 1
                match = LINE.fullmatch(block, tail)
                if match is None or len(match[9] or b"") < 16:
                    reader.truncated_at = offset + tail
                block += b"\n"
            _parse_block(reader, np.frombuffer(block, np.uint8), block, offset)
    names = [name.decode("ascii", "backslashreplace") for name in reader.channels]
    frames = FrameTable.joined(reader.parts, names)
    return Recording(path, "candump", frames, reader.rejected, tuple(reader.first), reader.truncated_at)


def _blocks(file: BinaryIO, reader: _Reader) -> Iterator[tuple[int, bytes]]:
    """Yield (offset, whole lines); the last block may lack its line end. Overlong lines are rejected here."""
    carry = b""
    offset = 0  # of carry
    overlong = False
    while chunk := file.read(BLOCK_BYTES):
        block = carry + chunk
        if overlong:
            end = block.find(b"\n")
            if end < 0:
                offset += len(block)
                carry = b""
                continue
            overlong, reader.truncated_at = False, None
            offset, block = offset + end + 1, block[end + 1 :]
        end = block.rfind(b"\n") + 1
        if end:
            yield offset, block[:end]
        offset, carry = offset + end, block[end:]
        if len(carry) > MAX_LINE_BYTES:
            reader.rejected += 1
            reader.show_rejected(offset, carry)
            reader.truncated_at = offset  # until its line end is found
            overlong, offset, carry = True, offset + len(carry), b""
    if carry.strip():
        yield offset, carry


def _parse_block(reader: _Reader, buffer: npt.NDArray[np.uint8], raw: bytes, offset: int) -> None:
    ends = np.flatnonzero(buffer == 10)
    starts = np.concatenate(([0], ends[:-1] + 1))
    ends = ends - ((ends > starts) & (buffer[ends - 1] == 13))
    short = ends - starts < MIN_LINE_BYTES
    if short.any():  # no frame; blank or not is all that matters
        text = np.concatenate(([0], np.cumsum(~_SPACE[buffer], dtype=np.int32)))
        bad_starts = starts[short & (text[ends] > text[starts])]
        starts, ends = starts[~short], ends[~short]
    else:
        bad_starts = starts[:0]
    lengths = ends - starts
    hashes = np.flatnonzero(buffer == 35)
    line_of_hash = np.searchsorted(ends, hashes)
    line_of_hash, hashes = line_of_hash[line_of_hash < len(starts)], hashes[line_of_hash < len(starts)]
    inside = hashes >= starts[line_of_hash]
    line_of_hash, hashes = line_of_hash[inside], hashes[inside]
    hash_at = np.zeros(len(starts), np.int64)
    hash_at[line_of_hash] = hashes - starts[line_of_hash]
    plain = (np.bincount(line_of_hash, minlength=len(starts)) == 1) & (lengths < 128)

    table = FrameTable.empty(len(starts), 64 if b"##" in raw else 8)
    done = np.zeros(len(starts), bool)
    keys = np.where(plain, lengths * 128 + hash_at, -1)
    order = np.argsort(keys, kind="stable")
    bounds = np.flatnonzero(np.diff(keys[order], prepend=-2, append=-2))
    for a, b in pairwise(bounds):
        rows = order[a:b]
        if b - a >= SMALL_GROUP and keys[rows[0]] >= 0:
            _parse_group(reader, buffer, starts, int(lengths[rows[0]]), rows, table, done)
    bad: list[int] = []
    for row in np.flatnonzero(~done).tolist():
        line = raw[starts[row] : ends[row]]
        if _parse_line(reader, line, table, row):
            done[row] = True
        elif line.strip():
            bad.append(int(starts[row]))
    reader.rejected += len(bad) + len(bad_starts)
    for start in sorted([*bad_starts[:FIRST_REJECTED].tolist(), *bad[:FIRST_REJECTED]]):
        reader.show_rejected(offset + start, raw[start : raw.find(b"\n", start)].rstrip(b"\r"))
    reader.parts.append(table.take(done))


def _parse_group(
    reader: _Reader,
    buffer: npt.NDArray[np.uint8],
    starts: npt.NDArray[np.int64],
    length: int,
    rows: npt.NDArray[np.int64],
    table: FrameTable,
    done: npt.NDArray[np.bool_],
) -> None:
    """Parse lines of one length; each round takes those that have the shape of the first line left."""
    for _ in range(SHAPES_PER_GROUP):
        if not len(rows):
            return
        start = starts[rows]
        chars = np.lib.stride_tricks.sliding_window_view(buffer, length)[start]
        shape = _SHAPE.fullmatch(chars[0].tobytes())
        if shape is None:
            rows = rows[1:]
            continue
        seconds, s_ok = _digits(chars[:, shape.start("s") : shape.end("s")])
        fraction, f_ok = _digits(chars[:, shape.start("f") : shape.end("f")])
        can_id, i_ok = _hex_number(chars[:, shape.start("i") : shape.end("i")])
        nibbles = _HEX[chars[:, shape.start("d") : shape.end("d")]]
        name = chars[:, shape.start("c") : shape.end("c")]
        ok = s_ok & f_ok & i_ok & (nibbles < 16).all(1) & ((name > 32) & (name < 127)).all(1)
        ok &= seconds <= MAX_SECONDS
        for column in (0, shape.start("f") - 1, shape.end("f"), shape.end("f") + 1, shape.end("c")):
            ok &= chars[:, column] == chars[0, column]
        if shape.end("d") < length:
            ok &= (chars[:, length - 2] == 32) & np.isin(chars[:, length - 1], (82, 84))
        wide = shape.end("i") - shape.start("i") == 8
        ok &= can_id <= ((MAX_EXTENDED_ID | ERROR_BIT) if wide else MAX_STANDARD_ID)
        took = rows[ok]
        table.time_ns[took] = seconds[ok] * 1_000_000_000 + fraction[ok] * 10 ** (9 - len(shape["f"]))
        table.channel[took] = _channels(reader, name[ok])
        error = (can_id[ok] & ERROR_BIT) != 0
        table.can_id[took] = can_id[ok] & MAX_EXTENDED_ID
        table.extended[took] = wide & ~error
        table.flags[took] = np.where(error, int(FrameFlag.ERROR), 0)
        n = nibbles.shape[1] // 2
        table.length[took] = n
        table.data[took, :n] = nibbles[ok, 0::2] << 4 | nibbles[ok, 1::2]
        done[took] = True
        rows = rows[~ok]


def _digits(chars: npt.NDArray[np.uint8]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    digits = chars - np.uint8(48)
    value = np.zeros(len(chars), np.int64)
    for column in range(chars.shape[1]):
        value = value * 10 + digits[:, column]
    return value, np.asarray((digits <= 9).all(1))


def _hex_number(chars: npt.NDArray[np.uint8]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    nibbles = _HEX[chars]
    value = np.zeros(len(chars), np.int64)
    for column in range(chars.shape[1]):
        value = value << 4 | nibbles[:, column]
    return value, np.asarray((nibbles < 16).all(1))


def _channels(reader: _Reader, names: npt.NDArray[np.uint8]) -> npt.NDArray[np.int32]:
    if not len(names):
        return np.zeros(0, np.int32)
    keys = np.ascontiguousarray(names).view(f"S{names.shape[1]}").ravel()
    unique, inverse = np.unique(keys, return_inverse=True)
    return np.array([reader.channel(bytes(n)) for n in unique], np.int32)[inverse]


def _parse_line(reader: _Reader, line: bytes, table: FrameTable, row: int) -> bool:
    match = LINE.fullmatch(line)
    if match is None or int(match[1]) > MAX_SECONDS:
        return False
    can_id = int(match[4], 16)
    wide = len(match[4]) == 8
    if can_id > ((MAX_EXTENDED_ID | ERROR_BIT) if wide else MAX_STANDARD_ID):
        return False
    error = bool(can_id & ERROR_BIT)
    flags = FrameFlag.ERROR if error else FrameFlag(0)
    payload = b""
    if match[5]:
        flags |= FrameFlag.REMOTE
        table.length[row] = int(match[6] or b"0")
    else:
        payload = bytes.fromhex((match[8] if match[7] else match[9]).decode())
        table.length[row] = len(payload)
    if match[7]:
        if len(payload) not in FD_LENGTHS:
            return False
        bits = int(match[7], 16)
        flags |= FrameFlag.FD
        flags |= FrameFlag.BIT_RATE_SWITCH if bits & 1 else FrameFlag(0)
        flags |= FrameFlag.ERROR_STATE if bits & 2 else FrameFlag(0)
    table.time_ns[row] = int(match[1]) * 1_000_000_000 + int((match[2] or b"").ljust(9, b"0"))
    table.channel[row] = reader.channel(match[3])
    table.can_id[row] = can_id & MAX_EXTENDED_ID
    table.extended[row] = wide and not error
    table.flags[row] = flags
    table.data[row, : len(payload)] = np.frombuffer(payload, np.uint8)
    return True


def candump_lines(frames: FrameTable) -> Iterator[str]:
    """Yield the lines of a candump log; the stamp has six digits, or nine where the log is finer."""
    fine = bool((frames.time_ns % 1000).any())
    payloads = frames.data.tobytes().hex().upper()
    width = 2 * frames.data.shape[1]
    columns = (frames.time_ns, frames.channel, frames.can_id, frames.extended, frames.length, frames.flags)
    for row, (time_ns, channel, can_id, extended, length, flags) in enumerate(
        zip(*(c.tolist() for c in columns), strict=True)
    ):
        seconds, rest = divmod(time_ns, 1_000_000_000)
        stamp = f"{seconds:010d}.{rest:09d}" if fine else f"{seconds:010d}.{rest // 1000:06d}"
        error = flags & FrameFlag.ERROR
        name = f"{can_id | (ERROR_BIT if error else 0):08X}" if extended or error else f"{can_id:03X}"
        payload = payloads[row * width : row * width + 2 * length]
        if flags & FrameFlag.REMOTE:
            payload = f"R{length}"
        elif flags & FrameFlag.FD:
            bits = bool(flags & FrameFlag.BIT_RATE_SWITCH) + 2 * bool(flags & FrameFlag.ERROR_STATE)
            payload = f"#{bits:X}{payload}"
        yield f"({stamp}) {frames.channels[channel]} {name}#{payload}\n"
