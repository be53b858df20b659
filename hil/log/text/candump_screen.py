"""What candump shows on a screen, ``(seconds)  channel  ID   [length]  data``, with all its options."""

import re
from collections.abc import Iterator
from datetime import datetime, tzinfo
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.builder import FrameBuilder
from hil.log.frames import FrameFlag, FrameTable
from hil.log.source import ReadOptions, Source
from hil.log.text.candump import ERROR_BIT, MAX_SECONDS
from hil.log.text.lines import read_lines
from hil.log.wall_clock import wall_clock_ns

ABSOLUTE_DIGITS = (
    10  # of the seconds of candump -ta; less has a time from the first frame (-tz) or the one before (-td)
)
MAX_NS = 4_000_000_000_000_000_000  # of the compiled pass

# The one definition of a line; the compiled pass only takes lines that would match it.
LINE = re.compile(
    rb"\s*(?:\((?:(\d{1,10})\.(\d{1,9})|(\d{4}-\d\d-\d\d \d\d:\d\d):(\d\d)\.(\d{1,9}))\)\s+)?((?!\()\S{1,32})\s+"
    rb"(?:([RT])X\s+([B-])\s([E-])\s+)?([0-9A-Fa-f]{8}|[0-9A-Fa-f]{3})\s+(?:\[(\d{1,2})\]|\{[9A-Fa-f]\})(?:\s+(\S.*)|\s*)",
    re.DOTALL,
)
_RELATIVE = re.compile(rb"^[ \t]*\((\d{1,9}\.\d{1,9})\)[ \t]", re.MULTILINE)
_COLOUR = re.compile(rb"\x1b\[[0-9;]{0,20}m")
_BYTE = re.compile(rb"[0-9A-Fa-f]{2}")
_BITS = re.compile(rb"[01]{8}")


def read_candump_screen(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of candump's output on a screen; every line that is not blank is a frame, or is rejected.

    Dates (-tA) are read in the zone of ``options``; times from frame to frame (-td) are added up, told from times
    since the first frame (-tz) by the begin of the log, where the former go back. Lines of error text (-e) are passed
    over.
    """
    stamps = [float(stamp) for stamp in _RELATIVE.findall(source.head())]
    delta = any(late < early for early, late in pairwise(stamps))
    return read_lines(source, account, ScreenParser(account, options.timezone, delta), options.fast)


class ScreenParser:
    """Lines of candump's screen form (see `hil.log.text.lines.LineParser`)."""

    def __init__(self, account: Account, zone: tzinfo, delta: bool) -> None:
        self.account = account
        self.zone = zone
        self.delta = delta
        self.total_ns = 0
        self.minute = (b"", 0)  # the last date, and its time

    def take(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Add lines of data frames that have a stamp in seconds."""
        from hil.log.text.screen_pass import take_lines

        if self.total_ns > MAX_NS:
            return begin
        state = np.array([self.total_ns, 0, 0], np.int64)
        at = builder.fill(take_lines, buffer, begin, self.delta, state)
        self.total_ns = int(state[0])
        said = [(int(state[1]), self._say_relative), (int(state[2]), self._say_fd)]
        for row, say in sorted(said, key=lambda pair: pair[0]):
            if row:
                say()
        return at

    def _say_relative(self) -> None:
        how = "from frame to frame (candump -td), added up" if self.delta else "from the first frame on (candump -tz)"
        self.account.note(f"the log has no dates: its times count {how}")

    def _say_fd(self) -> None:
        self.account.note("bit rate switch and error state of CAN FD frames are not in the log (candump -x shows them)")

    def line(self, line: bytes, offset: int, builder: FrameBuilder) -> bool:
        """Add, pass over or reject one line."""
        text = _COLOUR.sub(b"", line) if b"\x1b" in line else line
        match = LINE.fullmatch(text)
        if match is not None and self._frame(match, builder):
            return True
        text = text.strip()
        if text.startswith(b"DROPCOUNT: dropped "):
            self.account.passed_over["dropped frames"] += 1
            self.account.note("candump says that it missed frames (DROPCOUNT)")
        elif match is None and line.startswith(b"\t") and text:
            self.account.passed_over["error text"] += 1
        elif text:
            builder.reject(offset, line.strip())
        return not text

    def _time(self, match: re.Match[bytes]) -> int | None:
        if match[1]:
            time_ns = int(match[1]) * 10**9 + int(match[2].ljust(9, b"0"))
            if int(match[1]) > MAX_SECONDS:
                return None
            if len(match[1]) < ABSOLUTE_DIGITS:
                self._say_relative()
                if self.delta:
                    self.total_ns = time_ns = self.total_ns + time_ns
            return time_ns
        if match[3]:
            if match[3] != self.minute[0]:
                try:
                    clock = datetime.strptime(match[3].decode(), "%Y-%m-%d %H:%M")
                    self.minute = match[3], wall_clock_ns(clock, self.zone)
                except (ValueError, OverflowError):
                    return None
            self.account.local_start = True
            return self.minute[1] + int(match[4]) * 10**9 + int(match[5].ljust(9, b"0"))
        self.account.note("the log has no times: all frames are at 0")
        return 0

    def _frame(self, match: re.Match[bytes], builder: FrameBuilder) -> bool:
        """Add a frame; False where it is none."""
        time_ns = self._time(match)
        can_id, wide = int(match[10], 16), len(match[10]) == 8
        length, rest = int(match[11] or b"8"), match[12] or b""
        flags = FrameFlag.SENT if match[7] == b"T" else FrameFlag(0)
        if match[11] and len(match[11]) == 2:
            flags |= FrameFlag.FD
            flags |= FrameFlag.BIT_RATE_SWITCH if match[8] == b"B" else FrameFlag(0)
            flags |= FrameFlag.ERROR_STATE if match[9] == b"E" else FrameFlag(0)
        if wide and can_id & ERROR_BIT:
            flags |= FrameFlag.ERROR
            can_id &= ~ERROR_BIT
        if rest.strip() == b"remote request":
            flags |= FrameFlag.REMOTE
            data: bytes | None = b""
        else:
            data = _data(rest, length)
        if time_ns is None or data is None:
            return False
        channel = match[6].decode("utf-8", "backslashreplace")
        added = builder.add(time_ns, channel, can_id, wide, data, flags, length)
        if added and flags & FrameFlag.FD and not match[7]:
            self._say_fd()
        return added


def _data(rest: bytes, length: int) -> bytes | None:
    """The bytes behind a length: hexadecimal or binary (-i), perhaps the last one first (-S); None for others."""
    words = rest.split(maxsplit=length) if length else [rest]
    if not words:
        return None
    swapped = length > 1 and b"`" in words[0]
    if swapped:
        words = rest.split(maxsplit=1)
        words = words[0].split(b"`")[::-1] + words[1:]
    held, behind = words[:length], b"".join(words[length:])
    if len(held) != length or not (not behind or behind.startswith((b"'", b"`", b"ERRORFRAME"))):
        return None
    if held and all(_BYTE.fullmatch(word) for word in held):
        return bytes.fromhex(b"".join(held).decode())
    if all(_BITS.fullmatch(word) for word in held):
        return bytes(int(word, 2) for word in held)
    return None
