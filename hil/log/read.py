"""Opens a log of any known format: frames and signals as columns."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Self

from dbc.database import Database
from hil.log.account import Account
from hil.log.builder import ROWS, recording_of
from hil.log.formats import BY_NAME, format_of, told
from hil.log.frames import FrameTable, LogError, Recording
from hil.log.signals.decode import DecodedLog, decode_log
from hil.log.source import DEFAULT, ReadOptions, Source

Progress = Callable[[float], None]
"""Told the share of the log that has been read, 0 to 1, table by table."""


class Log:
    """One log. ``tables`` reads it piece by piece in bounded memory, ``frames`` and ``signals`` as a whole.

    Parameters
    ----------
    path : the file; ``-`` is standard input. A file packed with gzip is unpacked on the way.
    form : name of the format; None tells it by the content.
    options : how it is read.
    limit_bytes : most bytes that are read; None reads all.

    Attributes
    ----------
    account : what the last reading noticed beside the frames.

    Raises
    ------
    LogError
        When it cannot be opened, or its format is none of the known ones; no format has the name ``form``.
    """

    def __init__(
        self,
        path: Path | str,
        form: str | None = None,
        options: ReadOptions = DEFAULT,
        limit_bytes: int | None = None,
    ) -> None:
        self.source = Source(path, limit_bytes)
        self.path = self.source.path
        self.options = options
        self.account = Account()
        try:
            if form is not None and form not in BY_NAME:
                raise LogError(self.path, f"no format is called {form!r}; known are {', '.join(BY_NAME)}")
            self.format = format_of(self.source) if form is None else BY_NAME[form]
        except BaseException:
            self.source.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.source.close()

    def tables(self, progress: Progress | None = None) -> Iterator[FrameTable]:
        """Yield the frames from the begin on, in tables that share one channel numbering; `account` begins anew."""
        self.account = Account()
        self.source.rewind(self.account)
        for table in self.format.read(self.source, self.account, self.options):
            if progress is not None:
                progress(self.source.done)
            yield table
        if self.account.local_start:
            self.account.note(f"start time taken as {self.options.timezone} (the log names no zone)")

    def line_of(self, frame: int) -> int | None:
        """Line (from 1) of a text log that holds a frame, counted from 0; None in a log that has no lines."""
        account = Account(wanted_frame=frame)
        self.source.rewind(account)
        seen = 0
        for table in self.format.read(self.source, account, self.options):
            seen += len(table)
            if account.wanted_end is not None or seen > frame + ROWS:
                break
        if account.wanted_end is None:
            return None
        self.source.rewind(Account())
        left, lines, last = account.wanted_end, 0, b""
        while left and (part := self.source.read(min(left, 1 << 20))):
            left, lines, last = left - len(part), lines + part.count(b"\n"), part
        return lines if last.endswith(b"\n") else lines + 1

    def recording(self) -> Recording:
        """All frames, with the account."""
        return recording_of(self.path, self.format.name, list(self.tables()), self.account)

    def frames(self) -> FrameTable:
        """All frames."""
        return self.recording().frames

    def signals(self, databases: Database | Mapping[str, Database] | None = None) -> DecodedLog:
        """All signals; ``databases`` as in `hil.log.signals.decode.decode_log`."""
        return decode_log(self.recording(), databases)


def open_log(
    path: Path | str,
    form: str | None = None,
    options: ReadOptions = DEFAULT,
    limit_bytes: int | None = None,
) -> Log:
    """Open a log; parameters and errors as of `Log`.

    >>> with open_log("drive.blf") as log:  # doctest: +SKIP
    ...     frames = log.frames().to_arrow()
    ...     time_s, speed = log.signals(parse_database(Path("car.dbc").read_bytes())).series("WHEELS.FL")
    """
    return Log(path, form, options, limit_bytes)


def log_format(path: Path) -> str | None:
    """Name of the format of a log of frames, None for a file that is no log.

    Raises
    ------
    LogError
        When it cannot be opened.
    """
    with Source(path) as source:
        form = told(source.head())
    return None if form is None else form.name


def read_log(path: Path, form: str | None = None) -> Recording:
    """Read a whole log.

    Raises
    ------
    LogError
        When it cannot be opened, or holds nothing of its format.
    """
    with open_log(path, form) as log:
        return log.recording()
