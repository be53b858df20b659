"""candump's log format, ``(seconds) channel ID#DATA``."""

import re
from collections.abc import Iterable, Iterator
from datetime import tzinfo
from typing import IO

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.builder import FrameBuilder
from hil.log.frames import FrameFlag, FrameTable, LogFacts
from hil.log.source import ReadOptions, Source
from hil.log.text.line_writer import channel_bytes, write_rows
from hil.log.text.lines import read_lines
from hil.log.write import candump_names

MAX_SECONDS = 9_000_000_000  # int64 nanoseconds reach a little farther
ERROR_BIT = 0x2000_0000

# The one definition of a line; the compiled pass only takes lines that would match it.
LINE = re.compile(
    rb"\s*\((\d{1,10})(?:\.(\d{1,9}))?\)\s+(\S{1,32})\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#"
    rb"(?:(R)([0-8]?)|#([0-9A-Fa-f])((?:[0-9A-Fa-f]{2}){0,64})|((?:[0-9A-Fa-f]{2}){0,8}))"
    rb"(?:_[9A-Fa-f])?(?:\s+([RT]))?\s*"
)


def read_candump(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of a candump log; every line that is not blank becomes a frame or is counted as rejected."""
    return read_lines(source, account, CandumpParser(account), options.fast)


class CandumpParser:
    """Lines of candump's log form (see `hil.log.text.lines.LineParser`)."""

    def __init__(self, account: Account) -> None:
        self.account = account

    def take(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Add lines of the plain form."""
        from hil.log.text.candump_pass import take_lines

        return builder.fill(take_lines, buffer, begin)

    def line(self, line: bytes, offset: int, builder: FrameBuilder) -> bool:
        """Add one line; only a classical frame of 8 bytes, and a remote frame, is surely whole without a line end."""
        match = LINE.fullmatch(line)
        if match is None or int(match[1]) > MAX_SECONDS:
            text = line.strip()
            if text.startswith(b"DROPCOUNT: dropped "):
                self.account.passed_over["dropped frames"] += 1
                self.account.note("candump says that it missed frames (DROPCOUNT)")
                return False
            if text:
                builder.reject(offset, text)
            return not text
        can_id, wide = int(match[4], 16), len(match[4]) == 8
        flags = FrameFlag.SENT if match[10] == b"T" else FrameFlag(0)
        if wide and can_id & ERROR_BIT:
            flags |= FrameFlag.ERROR
        payload, length = b"", 0
        if match[5]:
            flags |= FrameFlag.REMOTE
            length = int(match[6] or b"0")
        else:
            payload = bytes.fromhex((match[8] if match[7] else match[9]).decode())
        if match[7]:
            bits = int(match[7], 16)
            flags |= FrameFlag.FD
            flags |= FrameFlag.BIT_RATE_SWITCH if bits & 1 else FrameFlag(0)
            flags |= FrameFlag.ERROR_STATE if bits & 2 else FrameFlag(0)
        time_ns = int(match[1]) * 1_000_000_000 + int((match[2] or b"").ljust(9, b"0"))
        channel = match[3].decode("utf-8", "backslashreplace")
        can_id &= ~ERROR_BIT if flags & FrameFlag.ERROR else 0xFFFF_FFFF
        if not builder.add(time_ns, channel, can_id, wide, payload, flags, length):
            builder.reject(offset, line.strip())
            return False
        return bool(match[5]) or len(payload) == (64 if match[7] else 8)


def write_candump(file: IO[bytes], tables: Iterable[FrameTable], facts: LogFacts, zone: tzinfo) -> None:
    """Write a candump log; stamps have six digits, or nine where the log is finer."""
    from hil.log.text.line_pass import candump_rows

    directed = bool(facts.flags & FrameFlag.SENT)
    for table in tables:
        names, starts = channel_bytes(candump_names(table.channels))
        write_rows(file, candump_rows, table, names, starts, facts.finer_than_us, directed)
