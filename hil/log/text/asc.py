"""Vector's text format (ASC): every line becomes a frame, is passed over as no frame, or is counted as rejected."""

import re
from collections.abc import Iterable, Iterator
from datetime import datetime, tzinfo
from typing import IO

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.builder import FrameBuilder
from hil.log.frames import FD_CODES, FrameFlag, FrameTable, LogFacts
from hil.log.source import ReadOptions, Source
from hil.log.text.line_writer import header_start_ns, write_rows
from hil.log.text.lines import read_lines
from hil.log.wall_clock import MAX_START_NS, wall_clock_ns, wall_clock_of
from hil.log.write import numbered

MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
GERMAN = {"mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12}
MONTH_NUMBERS = {name.lower(): k + 1 for k, name in enumerate(MONTHS)} | GERMAN
BOM = b"\xef\xbb\xbf"
MAX_NS = 4_000_000_000_000_000_000  # of the compiled pass
WIDE_BIT = 0x8000_0000  # of an identifier in a database
ASC_REMOTE, ASC_FD = 0x10, 0x1000  # in the flags of a CANFD line

_STAMP = re.compile(rb"(-?)(\d{1,10})(?:\.(\d{1,9}))?")
_BASE = re.compile(rb"base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.IGNORECASE)
_DATE = re.compile(rb"(date|begin\s+triggerblock)\s+(\S.*)", re.IGNORECASE)
_CLOCK = re.compile(
    r"\w+\.?\s+(\w+)\.?\s+(\d{1,2})\.?\s+(\d{1,2}):(\d{2}):(\d{2})(?:[.,:](\d{1,9}))?\s*([ap]m)?\s+(\d{4})",
    re.IGNORECASE,
)
_FRAME_LIKE = re.compile(rb"\s[RT]x\s")
_DIRECTION = re.compile(rb"[RT]x", re.IGNORECASE)
_EVENT = re.compile(rb"[A-Za-z_%/]")  # a name, an environment variable, a comment
# An event of a channel that is no frame: "1  Statistic: ...", "1  J1939TP ...".
_NO_FRAME = re.compile(rb"Statistic|Overload|CAN\b|Start\b|J1939TP|SV:|Log\b|Status|\w{1,40}:", re.IGNORECASE)
_BYTE = {16: re.compile(rb"[0-9A-F]{1,2}", re.IGNORECASE), 10: re.compile(rb"\d{1,3}")}
_ID = {16: re.compile(rb"([0-9A-F]{1,8})(x?)", re.IGNORECASE), 10: re.compile(rb"(\d{1,10})(x?)", re.IGNORECASE)}
_LENGTH_CODE = re.compile(rb"[0-9A-F]|1[0-5]", re.IGNORECASE)
_FLAGS = re.compile(rb"[0-9A-F]{1,8}", re.IGNORECASE)


def read_asc(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of an ASC log.

    Stamps count from the wall clock of the ``date`` line (or of the trigger block at whose begin the measurement
    started), in the zone of ``options``. Requests to send inside the tool (TxRq) and events are passed over.
    """
    return read_lines(source, account, AscParser(account, options.timezone), options.fast)


class AscParser:
    """Lines of an ASC log (see `hil.log.text.lines.LineParser`)."""

    def __init__(self, account: Account, zone: tzinfo) -> None:
        self.account = account
        self.zone = zone
        self.base = 16
        self.relative = False
        self.start_ns = 0
        self.last_ns = 0  # of the last line, from the start
        self.dated = False
        self.trigger_ns: int | None = None
        self.numbers = np.full(10_000, -1, np.int32)  # channel by its number in the log

    def take(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Add lines of the plain forms."""
        from hil.log.text.asc_pass import take_lines

        if abs(self.last_ns) > MAX_NS:
            return begin
        state = np.array([self.last_ns, 0], np.int64)
        at = builder.fill(take_lines, buffer, begin, self.numbers, state, self.start_ns, self.relative, self.base)
        self.last_ns = int(state[0])
        if state[1]:
            self.account.passed_over["TxRq"] += int(state[1])
        return at

    def line(self, line: bytes, offset: int, builder: FrameBuilder) -> bool:
        """Add, pass over or reject one line."""
        words = line.removeprefix(BOM if offset == 0 else b"").split()
        if not words:
            return True
        stamp = _STAMP.fullmatch(words[0])
        if stamp is None:
            return self._header(b" ".join(words), offset)
        stamp_ns = int(stamp[2]) * 10**9 + int((stamp[3] or b"").ljust(9, b"0"))
        self.last_ns = (self.last_ns if self.relative else 0) + (-stamp_ns if stamp[1] else stamp_ns)
        whole = self._event(words, builder)
        if whole is None:
            builder.reject(offset, line.strip())
        return bool(whole)

    def _header(self, line: bytes, offset: int) -> bool:
        if match := _BASE.match(line):
            self.base = 10 if match[1].lower() == b"dec" else 16
            self.relative = (match[2] or b"").lower() == b"relative"
        elif match := _DATE.match(line):
            self._date(match[1].lower() == b"date", match[2])
        elif not line.startswith(b"//") and (not line[:1].isalpha() or _FRAME_LIKE.search(line)):
            self.account.reject(offset, line)
        return line.lower() == b"end triggerblock"

    def _date(self, of_header: bool, text: bytes) -> None:
        """Take a start time: that of the header counts, or else that of the first trigger block."""
        time_ns = _clock_ns(text, self.zone)
        if time_ns is None:
            self.account.note("a start time cannot be read (expected one like Wed Jan 15 12:00:00.000 2025)")
            return
        if not of_header:
            self.trigger_ns = time_ns
        if of_header or not self.dated:
            self._start(time_ns)

    def _start(self, time_ns: int) -> None:
        self.dated, self.start_ns = True, time_ns
        self.account.start_ns, self.account.local_start = time_ns, True

    def _event(self, words: list[bytes], builder: FrameBuilder) -> bool | None:
        """Take what stands behind a stamp; whether it is surely whole, None where it is rejected."""
        if len(words) < 2:
            return None
        fd = words[1].upper() == b"CANFD"
        number = words[2 if fd and len(words) > 2 else 1]
        if not (number.isdigit() and len(number) <= 4):
            if fd or words[1].upper() == b"CANXL" or not _EVENT.match(words[1]):
                return None
            measured = words[1].lower() == b"start" and words[3:4] and words[3].lower() in (b"measurement", b"messung")
            if measured and self.trigger_ns is not None and self.trigger_ns != self.start_ns:
                start_ns = self.trigger_ns - self.last_ns  # the measurement began with the trigger block
                if abs(start_ns) <= MAX_START_NS:
                    self._start(start_ns)
            self.account.passed_over["event"] += 1
            return False
        rest = words[3:] if fd else words[2:]
        if not fd and rest and _NO_FRAME.match(rest[0]):
            self.account.passed_over["event"] += 1
            return False
        sent = False
        if rest and (fd or (rest[1:2] and rest[1].lower() == b"errorframe")) and _DIRECTION.fullmatch(rest[0]):
            sent = rest[0][:1] in b"Tt"
            rest = rest[1:]
        elif fd:
            if rest and rest[0].lower() == b"txrq":
                self.account.passed_over["TxRq"] += 1
                return False
            return None
        flags = FrameFlag.SENT if sent else FrameFlag(0)
        channel = max(int(number), 1) - 1
        if rest and rest[0].lower() == b"errorframe":
            added = self._add(builder, channel, 0, False, b"", flags | FrameFlag.ERROR, 0)
            return True if added else None
        return self._fd(rest, channel, flags, builder) if fd else self._classical(rest, channel, builder)

    def _add(
        self, builder: FrameBuilder, channel: int, can_id: int, wide: bool, data: bytes, flags: FrameFlag, length: int
    ) -> bool:
        name = f"can{channel}"
        if not builder.add(self.start_ns + self.last_ns, name, can_id, wide, data, flags, length):
            return False
        self.numbers[channel + 1] = builder.channel(name)
        if not channel:
            self.numbers[0] = self.numbers[1]
        return True

    def _classical(self, words: list[bytes], channel: int, builder: FrameBuilder) -> bool | None:
        """``ID Rx d 8 11 22 ...``, ``ID Rx r 8``."""
        if len(words) < 3:
            return None
        identifier, direction, kind = self._identifier(words), words[1].lower(), words[2].lower()
        if identifier is None or direction not in (b"rx", b"tx", b"txrq") or kind not in (b"d", b"r"):
            return None
        if direction == b"txrq":
            self.account.passed_over["TxRq"] += 1
            return False
        coded = len(words) > 3 and _LENGTH_CODE.fullmatch(words[3]) is not None
        flags = FrameFlag.SENT if direction == b"tx" else FrameFlag(0)
        can_id, wide = identifier
        if kind == b"r":
            if len(words) > 3 and not coded and words[3].lower() != b"length":
                return None
            length = min(int(words[3], 16 if len(words[3]) == 1 else 10), 8) if coded else 0
            added = self._add(builder, channel, can_id, wide, b"", flags | FrameFlag.REMOTE, length)
            return self._ends_whole(words, len(words) > 3) if added else None
        if not coded:
            return None
        code = int(words[3], 16 if len(words[3]) == 1 else 10)
        held = self._bytes(words[4:])
        if code > 8 and len(held) == FD_CODES[code]:  # as mdf2asc writes CAN FD frames
            flags |= FrameFlag.FD
        elif len(held) != min(code, 8):
            return None
        if not self._add(builder, channel, can_id, wide, held, flags, 0):
            return None
        behind = code == 0 or len(words) > 4 + len(held) or (self.base == 16 and len(words[-1]) == 2)
        return self._ends_whole(words, behind)

    def _identifier(self, words: list[bytes]) -> tuple[int, bool] | None:
        """Number, and whether it has 29 bits; where the message's name stands instead, the one behind ``ID =``."""
        match = _ID[self.base].fullmatch(words[0])
        if match is not None:
            return int(match[1], self.base), bool(match[2])
        behind = words.index(b"ID") if b"ID" in words else len(words)
        if words[behind + 1 : behind + 2] != [b"="]:
            return None
        match = _ID[10].fullmatch(b"".join(words[behind + 2 : behind + 3]))
        if match is None:
            return None
        number = int(match[1])
        return number & ~WIDE_BIT, bool(match[2]) or bool(number & WIDE_BIT)

    def _ends_whole(self, words: list[bytes], behind: bool) -> bool:
        """Whether nothing can be missing behind a frame; the number of a message that is named stands last."""
        return behind and _ID[self.base].fullmatch(words[0]) is not None

    def _bytes(self, words: list[bytes]) -> bytes:
        """The bytes at the begin of the words."""
        pattern = _BYTE[self.base]
        held = bytearray()
        for word in words:
            if not pattern.fullmatch(word) or len(held) > 64 or int(word, self.base) > 255:
                break
            held.append(int(word, self.base))
        return bytes(held)

    def _fd(self, words: list[bytes], channel: int, flags: FrameFlag, builder: FrameBuilder) -> bool | None:
        """``ID (name) BRS ESI code length data duration bits flags ...``."""
        if len(words) < 5:
            return None
        identifier = _ID[self.base].fullmatch(words[0])
        at = 1 if _fd_words(words[1:5]) else 2
        if identifier is None or not _fd_words(words[at : at + 4]):
            return None
        length = int(words[at + 3])
        end = at + 4 + length
        held = self._bytes(words[at + 4 : end])
        if len(held) != length:
            return None
        behind = words[end:]
        asc_flags = 0 if len(behind) > 2 else ASC_FD
        if len(behind) > 2:
            if not _FLAGS.fullmatch(behind[2]):
                return None
            asc_flags = int(behind[2], 16)
        if asc_flags & ASC_REMOTE:
            if length:
                return None
            flags |= FrameFlag.REMOTE
            length = min(int(words[at + 2], 16), 8)
        elif asc_flags & ASC_FD or length > 8 or b"1" in words[at : at + 2]:
            flags |= FrameFlag.FD
            flags |= FrameFlag.BIT_RATE_SWITCH if words[at] == b"1" else FrameFlag(0)
            flags |= FrameFlag.ERROR_STATE if words[at + 1] == b"1" else FrameFlag(0)
        added = self._add(builder, channel, int(identifier[1], self.base), bool(identifier[2]), held, flags, length)
        return len(behind) > 3 if added else None


def _fd_words(words: list[bytes]) -> bool:
    """Whether words are BRS, ESI, length code, length."""
    return (
        len(words) == 4
        and words[0] in (b"0", b"1")
        and words[1] in (b"0", b"1")
        and len(words[2]) == 1
        and _LENGTH_CODE.fullmatch(words[2]) is not None
        and words[3].isdigit()
        and len(words[3]) <= 2
    )


def _clock_ns(text: bytes, zone: tzinfo) -> int | None:
    """Time of a date as CANoe writes it, English or German, 12 or 24 hours, with or without a fraction of a second."""
    try:
        decoded = text.decode()
    except UnicodeDecodeError:
        decoded = text.decode("cp1252", "replace")
    match = _CLOCK.match(decoded)
    if match is None:
        return None
    month = MONTH_NUMBERS.get(match[1].lower()[:3])
    hour, half = int(match[3]), (match[7] or "").lower()
    if half and 1 <= hour <= 12:
        hour = hour % 12 + (12 if half == "pm" else 0)
    try:
        clock = datetime(int(match[8]), month or 0, int(match[2]), hour, int(match[4]), int(match[5]))
        start_ns = wall_clock_ns(clock, zone, int((match[6] or "").ljust(9, "0")))
    except (ValueError, OverflowError):
        return None
    return start_ns if abs(start_ns) <= MAX_START_NS else None


def write_asc(file: IO[bytes], tables: Iterable[FrameTable], facts: LogFacts, zone: tzinfo) -> None:
    """Write an ASC log: start to the millisecond, stamps with six digits, or nine where the log is finer.

    ASC keeps neither class nor data of an error frame. An error frame that was sent is written as CANFD line, which
    has a direction for it.
    """
    from hil.log.text.line_pass import asc_rows

    start_ns = header_start_ns(facts, zone, 10**6)
    clock = wall_clock_of(start_ns, zone)
    date = f"{DAYS[clock.weekday()]} {MONTHS[clock.month - 1]} {clock:%d %H:%M:%S}.{clock.microsecond // 1000:03d} "
    date += f"{clock.year:04d}"
    file.write(f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n".encode())
    file.write(f"Begin Triggerblock {date}\n   0.000000 Start of measurement\n".encode())
    for table, numbers in numbered(tables, facts):
        write_rows(file, asc_rows, table, numbers, start_ns, facts.finer_than_us)
    file.write(b"End TriggerBlock\n")
