"""PEAK's text format (TRC), versions 1.0 to 2.1: every line becomes a frame, is passed over, or is rejected."""

import re
from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, datetime, timedelta, tzinfo
from decimal import Decimal
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

# Column letters as in the header of version 2: number, offset in ms, type, bus, id, direction, reserved, data length
# in bytes (l) or length code (L), data.
COLUMNS = {"1.0": "NOILD", "1.1": "NOdILD", "1.2": "NOBdILD", "1.3": "NOBdIRLD"}
TYPES = {
    b"DT": FrameFlag(0),
    b"RR": FrameFlag.REMOTE,
    b"FD": FrameFlag.FD,
    b"FB": FrameFlag.FD | FrameFlag.BIT_RATE_SWITCH,
    b"FE": FrameFlag.FD | FrameFlag.ERROR_STATE,
    b"BI": FrameFlag.FD | FrameFlag.BIT_RATE_SWITCH | FrameFlag.ERROR_STATE,
}
STATES = {b"ST": "hardware status", b"EC": "error counters", b"EV": "event", b"WARNG": "warning"}
DAY_US = 86_400_000_000
EPOCH_DAY = 25_569  # 1970-01-01, counted from 1899-12-30

_OFFSET = re.compile(rb"(-?)(\d{1,15})(?:\.(\d{1,6}))?")
_DAYS = re.compile(r"-?\d{1,7}(?:\.\d{1,30})?")
_CLOCK = re.compile(r";\s*Start time:\s*(\d{1,2})\.(\d{1,2})\.(\d{4}) (\d{1,2}):(\d{2}):(\d{2})(?:\.(\d{1,3}))?")
_ID = re.compile(rb"[0-9A-Fa-f]{1,8}")
_BYTES = re.compile(rb"(?:[0-9A-Fa-f]{2}(?: [0-9A-Fa-f]{2}){0,63})?")


def read_trc(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of a TRC log.

    Stamps count from the wall clock in the header, in the zone of ``options``. An error frame (type ER of version 2,
    Error of 1.1 to 1.3) has neither class nor data; lines of status, warnings and the ERROR lines of version 1.0 are
    passed over.
    """
    return read_lines(source, account, TrcParser(account, options.timezone), options.fast)


class TrcParser:
    """Lines of a TRC log (see `hil.log.text.lines.LineParser`)."""

    def __init__(self, account: Account, zone: tzinfo) -> None:
        self.account = account
        self.zone = zone
        self.start_ns = 0
        self.stated = False  # by $STARTTIME, which is finer than the start time in words
        self.numbers = np.full(1000, -1, np.int32)  # channel by its bus number
        self._choose(COLUMNS["1.0"])

    def _choose(self, letters: str) -> None:
        self.columns = letters
        self.letters = np.frombuffer(letters.encode(), np.uint8)
        # what the compiled pass knows; it needs the data last, and each column once
        self.plain = set(letters) <= set("NOTBIdRlLD") and len(set(letters)) == len(letters) and letters[-1:] == "D"
        self.plain = self.plain and {"O", "I"} <= set(letters) and ("l" in letters) != ("L" in letters)

    def take(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Add lines of frames."""
        from hil.log.text.trc_pass import take_lines

        if not self.plain:
            return begin
        return builder.fill(take_lines, buffer, begin, self.letters, self.numbers, self.start_ns)

    def line(self, line: bytes, offset: int, builder: FrameBuilder) -> bool:
        """Add, pass over or reject one line; only a frame is surely whole without a line end."""
        text = line.removeprefix(b"\xef\xbb\xbf" if offset == 0 else b"").strip()
        if not text:
            return True
        if text.startswith(b";"):
            self._header(text.decode("cp1252", "replace"))
            return False
        words = text.split(maxsplit=max(len(self.columns) - 1, 0))
        cells = dict(zip(self.columns, words, strict=False))
        kind = cells.get("T", cells.get("d", b"")).upper()
        state = STATES.get(kind)
        if state is None and "T" not in cells:  # version 1
            state = "hardware status" if cells.get("I", b"").upper() == b"FFFFFFFF" else state
            state = "error" if "d" not in cells and cells.get("D", b"").startswith(b"ERROR") else state
        if state is not None:
            self.account.passed_over[state] += 1
            return False
        if self._frame(builder, cells, kind in (b"ER", b"ERROR")):
            return True
        builder.reject(offset, text)
        return False

    def _header(self, text: str) -> None:
        key, _, value = text.partition("=")
        if key == ";$FILEVERSION":
            self._choose(COLUMNS.get(value.strip(), COLUMNS["1.0"]))
        elif key == ";$COLUMNS":
            self._choose("".join(name.strip()[:1] or "?" for name in value.split(",")[:40]))
        elif key == ";$STARTTIME":
            self.stated = self._start(lambda: _of_days(value.strip()))
        elif not self.stated and (match := _CLOCK.match(text)):
            self._start(lambda: _of_words(match))

    def _start(self, clock: Callable[[], datetime]) -> bool:
        """Take a start time, where it is one."""
        try:
            start_ns = wall_clock_ns(clock(), self.zone)
        except (ValueError, OverflowError):
            start_ns = MAX_START_NS + 1
        if abs(start_ns) > MAX_START_NS:
            self.account.note("a start time in the header cannot be read: without another one, stamps count from 1970")
            return False
        self.start_ns = start_ns
        self.account.start_ns, self.account.local_start = start_ns, True
        return True

    def _frame(self, builder: FrameBuilder, cells: dict[str, bytes], error: bool) -> bool:
        """Add a frame; False where it is none."""
        stamp = _OFFSET.fullmatch(cells.get("O", b""))
        flags = TYPES.get(cells.get("T", b"DT"))
        direction, bus, number = cells.get("d", b"Rx"), cells.get("B", b"1"), cells.get("N", b"0")
        bus = b"1" if bus == b"-" else bus
        if stamp is None or not (bus.isdigit() and len(bus) <= 3) or not number[:1].isdigit():
            return False
        offset_ns = int(stamp[2]) * 10**6 + int((stamp[3] or b"").ljust(6, b"0"))
        time_ns = self.start_ns + (-offset_ns if stamp[1] else offset_ns)
        sent = FrameFlag.SENT if direction == b"Tx" else FrameFlag(0)
        if error:
            return self._add(builder, time_ns, int(bus), 0, False, b"", FrameFlag.ERROR | sent, 0)
        identifier, coded = cells.get("I", b""), "L" in cells
        length_text, data_text = cells.get("L" if coded else "l", b""), cells.get("D", b"")
        if flags is None or direction not in (b"Rx", b"Tx") or not _ID.fullmatch(identifier):
            return False
        if not (length_text.isdigit() and len(length_text) <= 3):
            return False
        length = int(length_text)
        if flags & FrameFlag.FD:
            if coded:
                if length > 15:
                    return False
                length = FD_CODES[length]
        elif length > 15:
            return False
        else:
            length = min(length, 8)
        if data_text == b"RTR" and not flags & FrameFlag.FD:
            flags, data_text = FrameFlag.REMOTE, b""
        if not _BYTES.fullmatch(data_text):
            return False
        data = bytes.fromhex(data_text.decode())
        if len(data) != (0 if flags & FrameFlag.REMOTE else length):
            return False
        return self._add(
            builder, time_ns, int(bus), int(identifier, 16), len(identifier) > 4, data, flags | sent, length
        )

    def _add(
        self, builder: FrameBuilder, time_ns: int, bus: int, can_id: int, wide: bool, data: bytes, flags: FrameFlag,
        length: int,
    ) -> bool:  # fmt: skip
        name = f"can{max(bus, 1) - 1}"
        if not builder.add(time_ns, name, can_id, wide, data, flags, length):
            return False
        self.numbers[bus] = builder.channel(name)
        return True


def _of_days(days: str) -> datetime:
    """Wall clock from days since 1899-12-30, to the microsecond."""
    if not _DAYS.fullmatch(days):
        raise ValueError(days[:40])
    return datetime(1899, 12, 30) + timedelta(microseconds=round(Decimal(days) * DAY_US))


def _of_words(match: re.Match[str]) -> datetime:
    day, month, year, hour, minute, second = (int(match[k]) for k in range(1, 7))
    return datetime(year, month, day, hour, minute, second, int((match[7] or "").ljust(6, "0")))


def write_trc(file: IO[bytes], tables: Iterable[FrameTable], facts: LogFacts, zone: tzinfo) -> None:
    """Write a TRC log, version 2.1: start to the millisecond, stamps to the microsecond.

    An error frame becomes a line of type ER, whose data say no more than "another error".
    """
    from hil.log.text.line_pass import trc_rows

    start_ns = header_start_ns(facts, zone, 10**6)
    clock = wall_clock_of(start_ns, zone)
    days = Decimal(wall_clock_ns(clock, UTC) // 10**6) / (DAY_US // 1000) + EPOCH_DAY
    head = f""";$FILEVERSION=2.1
;$STARTTIME={days:.15f}
;$COLUMNS=N,O,T,B,I,d,R,l,D
;
;   Start time: {clock:%d.%m.}{clock.year:04d} {clock:%H:%M:%S}.{clock.microsecond // 1000:03d}.0
;-------------------------------------------------------------------------------
;   Message   Time    Type    ID     Rx/Tx
;   Number    Offset  |  Bus  [hex]  |  Reserved
;   |         [ms]    |  |    |      |  |  Data Length
;   |         |       |  |    |      |  |  |    Data [hex] ...
;   |         |       |  |    |      |  |  |    |
;---+-- ------+------ +- +- --+----- +- +- +--- +- -- -- -- -- -- -- --
"""
    file.write(head.replace("\n", "\r\n").encode())
    before = 0
    for table, numbers in numbered(tables, facts):
        write_rows(file, trc_rows, table, numbers, start_ns, before)
        before += len(table)
