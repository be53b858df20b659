"""Frames as CSV rows: our own table, python-can's, and that of GVRET and SavvyCAN.

Columns of our own: ``time_s`` (s), ``channel`` (name), ``id`` (decimal), ``extended`` (0 or 1), ``flags`` (words of
`WORDS`, blank between them), ``length`` (data bytes; of a remote frame the requested number), ``data`` (hex).
"""

import base64
import csv
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from datetime import tzinfo
from pathlib import Path
from typing import IO, ClassVar

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.builder import FrameBuilder
from hil.log.frames import FrameFlag, FrameTable, LogError, LogFacts
from hil.log.source import ReadOptions, Source
from hil.log.text.line_writer import channel_bytes, write_rows
from hil.log.text.lines import read_lines

COLUMNS = "time_s,channel,id,extended,flags,length,data"
PYTHON_CAN_COLUMNS = "timestamp,arbitration_id,extended,remote,error,dlc,data"
GVRET_COLUMNS = ("time stamp,id,extended,dir,bus,len", "time stamp,id,extended,bus,len")  # then the data bytes
WORDS = {
    "remote": FrameFlag.REMOTE,
    "error": FrameFlag.ERROR,
    "fd": FrameFlag.FD,
    "brs": FrameFlag.BIT_RATE_SWITCH,
    "esi": FrameFlag.ERROR_STATE,
    "tx": FrameFlag.SENT,
}
BUSES = 256  # of GVRET
_BOM = b"\xef\xbb\xbf"

_STAMP = re.compile(r"([+-]?)([0-9]{1,17})(?:\.([0-9]{0,18}))?(?:[eE]([+-]?[0-9]{1,2}))?")
_TRUTH = {"0": False, "1": True, "false": False, "true": True}
_HEX_BYTES = re.compile(r"(?:[0-9A-Fa-f]{2}){0,64}")
_HEX_BYTE = re.compile(r"[0-9A-Fa-f]{1,2}")
_HEX_ID = re.compile(r"(?:0[xX])?([0-9A-Fa-f]{1,8})")
_BASE64 = re.compile(r"[0-9A-Za-z+/]*={0,2}")


def read_csv(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of our CSV; a row that is no frame is rejected. LogError for another header."""
    return read_lines(source, account, OwnRows(source.path, account), options.fast)


def read_python_can_csv(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of python-can's CSV, which knows one channel; else as `read_csv`."""
    return read_lines(source, account, PythonCanRows(source.path, account), options.fast)


def read_gvret(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of GVRET's CSV (SavvyCAN writes it too); bus n is channel can{n}; else as `read_csv`."""
    return read_lines(source, account, GvretRows(source.path, account), options.fast)


def nanoseconds(text: str, unit: int = 9) -> int | None:
    """Stamp as integer nanoseconds, rounded to the nearest; ``unit`` 9 for seconds, 3 for microseconds; None for none.

    Takes what programs print of a float too: ``1.5e-05``, seventeen digits.
    """
    match = _STAMP.fullmatch(text)
    if match is None:
        return None
    fraction = match[3] or ""
    value = int(match[2] + fraction)
    power = unit - len(fraction) + int(match[4] or 0)
    if power >= 0:
        value *= int(10**power)
    else:
        step = int(10**-power)
        value = (value + step // 2) // step
    return -value if match[1] == "-" else value


class CsvRows(ABC):
    """Rows under a header (see `hil.log.text.lines.LineParser`)."""

    columns: ClassVar[tuple[str, ...]]

    def __init__(self, path: Path, account: Account) -> None:
        self.path = path
        self.account = account
        self.header: str | None = None

    def take(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Add rows of the plain form."""
        return begin if self.header is None else self.fast(buffer, begin, builder)

    def line(self, line: bytes, offset: int, builder: FrameBuilder) -> bool:
        """Add one row; a row that is a frame has all its data bytes, so that nothing can be missing behind it."""
        if self.header is None:
            self.header = self._header(line)
            return True
        if not line.strip():
            return True
        text = line.rstrip(b"\r").decode("utf-8", "backslashreplace")
        if text.strip().lower() == self.header:
            self.account.passed_over["header line"] += 1
            return True
        whole = self.row(_cells(text), builder)
        if whole is None:
            builder.reject(offset, line.rstrip(b"\r"))
        return bool(whole)

    def _header(self, line: bytes) -> str:
        header = line.removeprefix(_BOM).decode("utf-8", "replace").strip().lower()
        if not any(self.fits(header, columns) for columns in self.columns):
            raise LogError(
                self.path, f"no table of frames: expected the columns {self.columns[0]}, got {header[:80]!r}", 0
            )
        return header

    def fits(self, header: str, columns: str) -> bool:
        """Whether a header (lower case) is that of ``columns``."""
        return header == columns

    @abstractmethod
    def fast(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Compiled: as `take`."""

    @abstractmethod
    def row(self, cells: list[str], builder: FrameBuilder) -> bool | None:
        """Add one row: whether it is surely whole; None where it is no frame."""


class OwnRows(CsvRows):
    """Our own rows."""

    columns = (COLUMNS,)

    def fast(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Compiled: as `take`."""
        from hil.log.text.csv_pass import take_rows

        return builder.fill(take_rows, buffer, begin)

    def row(self, cells: list[str], builder: FrameBuilder) -> bool | None:
        """Add one row."""
        if len(cells) != 7:
            return None
        channel = cells[1]
        stamp, _, can_id, wide, words, length, data = (cell.strip() for cell in cells)
        time_ns, extended = nanoseconds(stamp), _TRUTH.get(wide.lower())
        if time_ns is None or extended is None or not _HEX_BYTES.fullmatch(data):
            return None
        if not re.fullmatch(r"[0-9]{1,9}", can_id) or not re.fullmatch(r"[0-9]{1,2}", length):
            return None
        flags = FrameFlag(0)
        for word in words.split():
            if word not in WORDS:
                return None
            flags |= WORDS[word]
        if len(data) != (0 if flags & FrameFlag.REMOTE else 2 * int(length)):
            return None
        return builder.add(time_ns, channel, int(can_id), extended, bytes.fromhex(data), flags, int(length)) or None


class PythonCanRows(CsvRows):
    """Rows of python-can's CSVWriter, which keeps neither channel, CAN FD flags nor direction."""

    columns = (PYTHON_CAN_COLUMNS,)

    def fast(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Compiled: as `take`."""
        from hil.log.text.csv_pass import take_python_can

        if not len(builder.names):  # the careful way adds the channel, with the first frame
            return begin
        return builder.fill(take_python_can, buffer, begin)

    def row(self, cells: list[str], builder: FrameBuilder) -> bool | None:
        """Add one row."""
        if len(cells) != 7:
            return None
        stamp, name, *kind, dlc, letters = (cell.strip() for cell in cells)
        time_ns, can_id = nanoseconds(stamp), _HEX_ID.fullmatch(name)
        extended, remote, error = (_TRUTH.get(cell.lower()) for cell in kind)
        if time_ns is None or can_id is None or extended is None or remote is None or error is None:
            return None
        if not re.fullmatch(r"[0-9]{1,2}", dlc) or not _BASE64.fullmatch(letters) or len(letters) % 4:
            return None
        length, data = int(dlc), base64.b64decode(letters)
        if 9 <= length <= 15 and (remote or len(data) == 8):  # a classical frame's length code
            length = 8
        if remote:
            data = b""
        elif len(data) != length:
            return None
        flags = FrameFlag.REMOTE if remote else FrameFlag(0)
        flags |= FrameFlag.ERROR if error else FrameFlag(0)
        flags |= FrameFlag.FD if length > 8 else FrameFlag(0)
        return builder.add(time_ns, "can0", int(can_id[1], 16), extended, data, flags, length) or None


class GvretRows(CsvRows):
    """Rows of GVRET: stamps in microseconds, or in seconds where they have a decimal point."""

    columns = GVRET_COLUMNS

    def __init__(self, path: Path, account: Account) -> None:
        super().__init__(path, account)
        self._buses = np.full(BUSES, -1, np.int32)

    def fits(self, header: str, columns: str) -> bool:
        """Whether a header is GVRET's: more or fewer data bytes may be named."""
        return re.fullmatch(re.escape(columns) + r"(?:,d\d{1,2})*,?", header) is not None

    @property
    def _directed(self) -> bool:
        return ",dir," in (self.header or "")

    def fast(self, buffer: npt.NDArray[np.uint8], begin: int, builder: FrameBuilder) -> int:
        """Compiled: as `take`."""
        from hil.log.text.csv_pass import take_gvret

        return builder.fill(take_gvret, buffer, begin, self._directed, self._buses)

    def row(self, cells: list[str], builder: FrameBuilder) -> bool | None:
        """Add one row."""
        cells = [cell.strip() for cell in cells]
        direction = cells.pop(3).lower() if self._directed and len(cells) > 3 else "rx"
        if len(cells) < 5 or direction not in ("rx", "tx"):
            return None
        stamp, name, wide, bus, size, *data = cells
        time_ns, can_id = nanoseconds(stamp, 9 if "." in stamp else 3), _HEX_ID.fullmatch(name)
        extended = _TRUTH.get(wide.lower())
        if time_ns is None or can_id is None or extended is None:
            return None
        if not re.fullmatch(r"[0-9]{1,3}", bus) or int(bus) >= BUSES or not re.fullmatch(r"[0-9]{1,2}", size):
            return None
        length = int(size)
        payload, behind = data[:length], data[length:]
        if len(payload) < length or not all(_HEX_BYTE.fullmatch(cell) for cell in payload):
            return None
        if not all(cell == "" or _HEX_BYTE.fullmatch(cell) for cell in behind):
            return None
        channel = f"can{int(bus)}"
        flags = FrameFlag.SENT if direction == "tx" else FrameFlag(0)
        flags |= FrameFlag.FD if length > 8 else FrameFlag(0)
        octets = bytes(int(cell, 16) for cell in payload)
        if not builder.add(time_ns, channel, int(can_id[1], 16), extended, octets, flags, length):
            return None
        self._buses[int(bus)] = builder.channel(channel)
        return bool(behind) or not payload or len(payload[-1]) == 2


def _cells(line: str) -> list[str]:
    try:
        return next(csv.reader([line], strict=True), [])
    except csv.Error:  # a carriage return in the middle, a quote that does not end
        return []


def write_csv(file: IO[bytes], tables: Iterable[FrameTable], facts: LogFacts, zone: tzinfo) -> None:
    """Write our CSV; stamps have nine digits."""
    from hil.log.text.line_pass import csv_rows

    file.write(COLUMNS.encode() + b"\n")
    for table in tables:
        names, starts = channel_bytes([_quoted(name) for name in table.channels])
        write_rows(file, csv_rows, table, names, starts, name_bytes=int(np.diff(starts).max(initial=0)))


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',"') else name
