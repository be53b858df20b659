"""The formats of logs: how each is told by its content, read and written, and what it can hold."""

import importlib
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import tzinfo
from pathlib import Path
from typing import IO

from dbc.database import DatabaseError, sniff_database
from hil.log.account import Account
from hil.log.frames import FrameTable, LogError, LogFacts
from hil.log.source import ReadOptions, Source

Reader = Callable[[Source, Account, ReadOptions], Iterator[FrameTable]]
"""Yields the frames of a log in tables of bounded size that share one channel numbering.

Start time, rejected pieces and the like go to the account. Raises LogError for what is no such log.
"""
Writer = Callable[[IO[bytes], Iterable[FrameTable], LogFacts, tzinfo], None]
"""Writes frames to a file open for reading and writing; the facts are those of all tables together."""


@dataclass(frozen=True, slots=True)
class Format:
    """One format.

    Attributes
    ----------
    name, module : as it is called; ``hil.log.<module>`` has ``read_<name>`` and, where `writable`, ``write_<name>``.
    suffixes : of its files; the first one names it when a log is written.
    told_by : score of the first bytes of a file; the format with the highest score above 0 is the file's.
    resolution_ns : stamps are kept to this.
    channel_names : channels have names, not just numbers.
    error_content : class and data of error frames are kept.
    errors, fd, sent : error frames, CAN FD frames, and whether a frame was sent or received, are kept.
    start_time : the start time is kept beside the stamps.
    before_start : stamps before the start (or before 1970, where there is none) are kept.
    """

    name: str
    module: str
    suffixes: tuple[str, ...]
    told_by: Callable[[bytes], int]
    writable: bool = True
    resolution_ns: int = 1
    channel_names: bool = False
    errors: bool = True
    error_content: bool = True
    fd: bool = True
    sent: bool = True
    start_time: bool = True
    before_start: bool = True

    def read(self, source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
        """Read a log of this format; see `Reader`."""
        reader: Reader = getattr(self._module(), f"read_{self.name}")
        return reader(source, account, options)

    def write(self, file: IO[bytes], tables: Iterable[FrameTable], facts: LogFacts, zone: tzinfo) -> None:
        """Write a log of this format; see `Writer`."""
        writer: Writer = getattr(self._module(), f"write_{self.name}")
        writer(file, tables, facts, zone)

    def _module(self) -> object:
        return importlib.import_module(f"hil.log.{self.module}")


BINARY = 1_000_000  # score of a signature


def _begins(*signatures: bytes) -> Callable[[bytes], int]:
    return lambda head: BINARY * head.startswith(signatures)


def _lines(pattern: bytes, weight: int = 1) -> Callable[[bytes], int]:
    line = re.compile(rb"^[ \t]*(?:" + pattern + rb")", re.MULTILINE | re.IGNORECASE)
    return lambda head: weight * sum(1 for _ in line.finditer(head))


def _first_line(pattern: bytes) -> Callable[[bytes], int]:
    line = re.compile(rb"(?:\xef\xbb\xbf)?(?:" + pattern + rb")", re.IGNORECASE)
    return lambda head: 10_000 * (line.match(head) is not None)


_CANDUMP = rb"\(\d{1,10}(?:\.\d{1,9})?\)\s+\S+\s+[0-9A-F]+#"
_SCREEN = (
    rb"(?:\(\d[\d.: -]*\)[ \t]+)?\S+[ \t]+(?:[RT]X[ \t]+\S+[ \t]+\S+[ \t]+)?[0-9A-F]{3,8}[ \t]+"
    rb"(?:\[\d{1,2}\]|\{[9A-F]\})[ \t\r\n]"
)
_ASC = rb"\d+\.\d+\s+(?:CANFD\s+)?\d+\s+\S|date\s+\w|base\s+(?:hex|dec)|begin triggerblock"
_TRC = rb";\$(?:FILEVERSION|STARTTIME|COLUMNS)=|;.*\.trc\b|\d+\)?\s+\d+(?:\.\d+)?\s+\S+\s+\S+\s+"
_PCAP = (b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d")
_CSV = rb"time_s,channel,id,extended,flags,length,data"
_PYTHON_CAN = rb"timestamp,arbitration_id,extended,remote,error,dlc,data"
_GVRET = rb"Time Stamp,ID,Extended,(?:Dir,)?Bus,LEN"

FORMATS = (
    Format(
        "candump", "text.candump", (".log",), _lines(_CANDUMP), channel_names=True, start_time=False, before_start=False
    ),
    Format("candump_screen", "text.candump_screen", (), _lines(_SCREEN), writable=False),
    Format("asc", "text.asc", (".asc",), _lines(_ASC, 2), error_content=False),
    Format("blf", "blf.blf", (".blf",), _begins(b"LOGG")),
    Format("trc", "text.trc", (".trc",), _lines(_TRC), resolution_ns=1000, error_content=False),
    Format("mf4", "mf4.mf4", (".mf4", ".mdf"), _begins(b"MDF ", b"UnFinMF ")),
    Format("csv", "text.csv_tables", (".csv",), _first_line(_CSV), channel_names=True, start_time=False),
    Format("python_can_csv", "text.csv_tables", (), _first_line(_PYTHON_CAN), writable=False),
    Format("gvret", "text.csv_tables", (), _first_line(_GVRET), writable=False),
    Format("busmaster", "text.busmaster", (), _first_line(rb"\*{3}\s*BUSMASTER"), writable=False),
    Format("pcap", "capture.pcap", (".pcap",), _begins(*_PCAP), writable=False),
    Format("pcapng", "capture.pcap", (".pcapng",), _begins(b"\x0a\x0d\x0d\x0a"), channel_names=True, start_time=False),
    Format("parquet", "foreign.parquet", (".parquet",), _begins(b"PAR1"), channel_names=True),
)
BY_NAME = {form.name: form for form in FORMATS}
WRITABLE = {suffix: form for form in FORMATS if form.writable for suffix in form.suffixes}
"""Formats that can be written, by suffix."""


def format_of(source: Source) -> Format:
    """Tell the format of a log by its first bytes.

    Raises
    ------
    LogError
        When they are those of no known format.
    """
    head = source.head()
    if not head:
        problem = "gzip file that cannot be unpacked" if source.packed else "empty: no log in it"
        raise LogError(source.path, f"{problem}; give a log file")
    form = told(head)
    if form is None and (kind := _database_kind(head)):
        raise LogError(source.path, f"is a database ({kind.upper()}), no log; give a log, and this with --dbc")
    if form is None:
        names = ", ".join(f.name for f in FORMATS)
        raise LogError(source.path, f"no log of a known format, its first bytes are {head[:24]!r}; known are {names}")
    return form


def _database_kind(head: bytes) -> str:
    try:
        return sniff_database(head)
    except DatabaseError:
        return ""


def told(head: bytes) -> Format | None:
    """Format of a log that begins so; None where it is none of the known ones."""
    scores = [form.told_by(head) for form in FORMATS]
    return FORMATS[scores.index(max(scores))] if max(scores) else None


def writable(path: Path) -> Format:
    """Format that a log is written in, by its suffix.

    Raises
    ------
    LogError
        For a suffix of none.
    """
    form = WRITABLE.get(path.suffix.lower())
    if form is None:
        got = f"suffix {path.suffix!r} names no format" if path.suffix else "no suffix names its format"
        raise LogError(path, f"{got} that is written; known are {', '.join(WRITABLE)}")
    return form
