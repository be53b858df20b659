"""BUSMASTER's log: sessions, each with a header between asterisks, and one line a frame."""

import re
from collections.abc import Iterator
from datetime import datetime, tzinfo

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.builder import FrameBuilder
from hil.log.frames import FD_CODES, FrameFlag, FrameTable
from hil.log.source import ReadOptions, Source
from hil.log.text.lines import read_lines
from hil.log.wall_clock import MAX_START_NS, wall_clock_ns

MAX_NS = 5_000_000_000_000_000_000  # of a stamp, for the compiled pass
DAY_NS = 86_400 * 10**9
TICK_NS = 100_000  # of the last number of a stamp
TYPES = {
    b"s": (False, FrameFlag(0)),
    b"x": (True, FrameFlag(0)),
    b"sr": (False, FrameFlag.REMOTE),
    b"xr": (True, FrameFlag.REMOTE),
    b"s-fd": (False, FrameFlag.FD),
    b"x-fd": (True, FrameFlag.FD),
}
MODES = {b"ABSOLUTE MODE": "absolute", b"RELATIVE MODE": "relative", b"SYSTEM MODE": "system"}

_START = re.compile(rb"START DATE AND TIME (\d{1,2}):(\d{1,2}):(\d{4}) (\d{1,2}):(\d{1,2}):(\d{1,2})(?::(\d{1,3}))?")
_STAMP = re.compile(rb"(\d{1,6}):(\d{1,2}):(\d{1,2}):(\d{1,4})")
_HEX = re.compile(rb"(?:0x)?[0-9A-F]{1,8}", re.IGNORECASE)
_DECIMAL = re.compile(rb"\d{1,10}")


def read_busmaster(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of a BUSMASTER log, stamps to 0.1 ms.

    The header's start is a wall clock, read in the zone of ``options``. Stamps are those of the wall clock too (system
    mode), or count from the start of their session (absolute mode), or from the line before (relative mode).
    Messages of J1939 that several frames carried, and LIN, are passed over.
    """
    return read_lines(source, account, BusmasterParser(account, options.timezone), options.fast)


class BusmasterParser:
    """Lines of a BUSMASTER log (see `hil.log.text.lines.LineParser`)."""

    def __init__(self, account: Account, zone: tzinfo) -> None:
        self.account = account
        self.zone = zone
        self.base = 16
        self.protocol = b"CAN"
        self.mode = "absolute"
        self.start_ns = 0
        self.midnight_ns = 0  # before the start
        self.last_ns = 0  # stamp of the last line
        self.files = False  # inside the list of databases
        self.numbers = np.full(10_000, -1, np.int32)  # channel by its number in the log

    def take(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Add lines of CAN frames."""
        from hil.log.text.busmaster_pass import take_lines

        if self.protocol != b"CAN" or abs(self.last_ns) > MAX_NS or abs(self.midnight_ns) > MAX_NS:
            return begin
        state = np.array([self.midnight_ns, self.last_ns], np.int64)
        mode = ("absolute", "relative", "system").index(self.mode)
        at = builder.fill(take_lines, buffer, begin, self.numbers, state, self.start_ns, mode, self.base)
        self.midnight_ns, self.last_ns = int(state[0]), int(state[1])
        if at > begin:
            self.files = False
        return at

    def line(self, line: bytes, offset: int, builder: FrameBuilder) -> bool:
        """Add, pass over or reject one line."""
        text = line.removeprefix(b"\xef\xbb\xbf" if offset == 0 else b"").strip()
        if not text:
            return True
        if text.startswith(b"***"):
            self._header(text.strip(b"*"))
            return text.endswith(b"***") and len(text) > 6
        words = text.split()
        stamp = _STAMP.fullmatch(words[0])
        if stamp is None:
            if not self.files:
                builder.reject(offset, text)
            return False
        self.files = False
        time_ns = self._time(stamp)
        if time_ns is not None and self.protocol == b"LIN":
            self.account.passed_over["LIN"] += 1
            return False
        if time_ns is not None:
            added = (
                self._j1939(words, time_ns, builder)
                if self.protocol == b"J1939"
                else self._can(words, time_ns, builder)
            )
            if added:
                return True
        builder.reject(offset, text)
        return False

    def _header(self, text: bytes) -> None:
        if text.startswith(b"PROTOCOL "):
            self.protocol = text[9:].strip()
        elif text in (b"HEX", b"DEC"):
            self.base = 16 if text == b"HEX" else 10
        elif text in MODES:
            self.mode = MODES[text]
        elif text.startswith(b"START DATABASE FILES"):
            self.files = True
        elif text.startswith(b"END"):
            self.files = False
        elif text.startswith(b"START DATE AND TIME"):
            self._session(_START.fullmatch(text))

    def _session(self, match: re.Match[bytes] | None) -> None:
        """Take the start of a session: day:month:year hour:minute:second:millisecond."""
        start_ns = MAX_START_NS + 1
        try:
            if match is not None:
                day, month, year, hour, minute, second, milli = (int(number or b"0") for number in match.groups())
                clock = datetime(year, month, day, hour, minute, second, milli * 1000)
                start_ns = wall_clock_ns(clock, self.zone)
                self.midnight_ns = wall_clock_ns(clock.replace(hour=0, minute=0, second=0, microsecond=0), self.zone)
        except (ValueError, OverflowError):
            start_ns = MAX_START_NS + 1
        if abs(start_ns) > MAX_START_NS:
            self.account.note("a start time in the header cannot be read: the stamps behind it count from 1970")
            start_ns = self.midnight_ns = 0
        else:
            self.account.local_start = True
            if self.account.start_ns is None:
                self.account.start_ns = start_ns
        self.start_ns = self.last_ns = start_ns

    def _time(self, stamp: re.Match[bytes]) -> int | None:
        hours, minutes, seconds, ticks = (int(number) for number in stamp.groups())
        if minutes > 59 or seconds > 59:
            return None
        time_ns = (hours * 3600 + minutes * 60 + seconds) * 10**9 + ticks * TICK_NS
        if self.mode == "system":
            time_ns += self.midnight_ns
            if time_ns < self.last_ns - DAY_NS // 2:  # midnight has passed
                self.midnight_ns += DAY_NS
                time_ns += DAY_NS
        else:
            time_ns += self.start_ns if self.mode == "absolute" else self.last_ns
        self.last_ns = time_ns
        return time_ns

    def _number(self, word: bytes) -> int | None:
        match = (_HEX if self.base == 16 else _DECIMAL).fullmatch(word)
        return int(word, self.base) if match else None

    def _bytes(self, words: list[bytes]) -> bytes | None:
        numbers = [self._number(word) for word in words[:65]]
        return bytes(n for n in numbers if n is not None) if all(n is not None and n < 256 for n in numbers) else None

    def _can(self, words: list[bytes], time_ns: int, builder: FrameBuilder) -> bool:
        """``time Rx 1 0x123 s 2 11 22``; False where it is no frame."""
        if len(words) < 5 or not (words[2].isdigit() and len(words[2]) <= 4):
            return False
        direction, kind = words[1].lower(), words[4].lower()
        channel, can_id = max(int(words[2]), 1) - 1, self._number(words[3])
        if direction not in (b"rx", b"tx") or can_id is None:
            return False
        sent = FrameFlag.SENT if direction == b"tx" else FrameFlag(0)
        if kind.startswith(b"err"):
            return self._add(builder, time_ns, channel, 0, False, b"", FrameFlag.ERROR | sent, 0)
        if kind not in TYPES or len(words) < 6 or not (words[5].isdigit() and len(words[5]) <= 2):
            return False
        wide, flags = TYPES[kind]
        length, data = int(words[5]), self._bytes(words[6:])
        if flags & FrameFlag.REMOTE:
            return length <= 15 and self._add(
                builder, time_ns, channel, can_id, wide, b"", flags | sent, min(length, 8)
            )
        if flags & FrameFlag.FD:
            lengths = {length} | ({FD_CODES[length]} if length < 16 else set())
        else:
            lengths = {min(length, 8)} if length < 16 else set()
        if data is None or len(data) not in lengths:
            return False
        return self._add(builder, time_ns, channel, can_id, wide, data, flags | sent, 0)

    def _add(
        self, builder: FrameBuilder, time_ns: int, channel: int, can_id: int, wide: bool, data: bytes,
        flags: FrameFlag, length: int,
    ) -> bool:  # fmt: skip
        name = f"can{channel}"
        if not builder.add(time_ns, name, can_id, wide, data, flags, length):
            return False
        self.numbers[channel + 1] = builder.channel(name)
        return True

    def _j1939(self, words: list[bytes], time_ns: int, builder: FrameBuilder) -> bool:
        """``time channel ID PGN type source destination priority Rx length data``; False where it is no frame."""
        if len(words) < 10 or not all(word.isdigit() and len(word) <= 4 for word in (words[1], words[9])):
            return False
        can_id, length, direction = self._number(words[2]), int(words[9]), words[8].lower()
        if can_id is None or direction not in (b"rx", b"tx"):
            return False
        if length > 8:
            self.account.passed_over["J1939 message of several frames"] += 1
            return True
        data = self._bytes(words[10:])
        flags = FrameFlag.SENT if direction == b"tx" else FrameFlag(0)
        return (
            data is not None
            and len(data) == length
            and self._add(builder, time_ns, max(int(words[1]), 1) - 1, can_id, True, data, flags, 0)
        )
