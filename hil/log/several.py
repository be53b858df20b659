"""Several logs read as one: in the order of their stamps, channels told by name."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.frames import FrameTable, LogError
from hil.log.read import Log, Progress, open_log
from hil.log.source import DEFAULT, ReadOptions

UNDATED_NS = 1_000_000_000 * 1_000_000_000  # stamps below (before September 2001) count from some start, not from 1970


@dataclass(slots=True)
class Part:
    """One of the logs.

    Attributes
    ----------
    path, format : the file and its format.
    size : bytes, for the progress.
    first_ns : stamp of its first frame; None without a frame, and for a log alone.
    account : what its last reading noticed.
    frames : how many it held.
    """

    path: Path
    format: str
    size: int
    first_ns: int | None
    account: Account
    frames: int = 0


class Logs:
    """Logs as one. Logs that overlap in time are merged by their stamps, within each log the order stays.

    Parameters
    ----------
    paths : one or more files, ``-`` for standard input.
    options, limit_bytes : as of `hil.log.read.Log`, for each of them.

    Attributes
    ----------
    parts : the logs, by their first stamp.
    notes : what concerns them together.
    channels : names that the last reading met.
    first_ns : stamp of the first frame, where times relative to the log begin; 0 before a reading and without a frame.
    last_ns : greatest stamp.

    Raises
    ------
    LogError
        When one of them cannot be opened, or its format is none of the known ones.
    """

    def __init__(self, paths: Sequence[Path], options: ReadOptions = DEFAULT, limit_bytes: int | None = None) -> None:
        self.options = options
        self.limit_bytes = limit_bytes
        self.notes: list[str] = []
        self.channels: tuple[str, ...] = ()
        self.first_ns = self.last_ns = 0
        self._kept: dict[Path, Log] = {}  # a pipe can be opened only once; one log alone need not be again
        _check_distinct(paths)
        try:
            self.parts = [self._look(path, len(paths) == 1) for path in paths]
        except BaseException:
            self.close()
            raise
        self.parts.sort(key=lambda part: (part.first_ns is None, part.first_ns or 0))
        undated = [part for part in self.parts if part.first_ns is not None and part.first_ns < UNDATED_NS]
        if len(self.parts) > 1 and undated:
            self.notes.append(f"{undated[0].path}: its stamps have no date; the logs are taken as of one clock")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close what is open."""
        for log in self._kept.values():
            log.source.close()

    @property
    def whole(self) -> bool:
        """Nothing of any log was rejected or is missing."""
        return all(part.account.whole for part in self.parts)

    def _look(self, path: Path, alone: bool) -> Part:
        log = open_log(path, options=self.options, limit_bytes=self.limit_bytes)
        keep = alone or log.source.once
        if keep:
            self._kept[path] = log
        try:
            stamps = (int(table.time_ns[0]) for table in log.tables() if len(table))
            first = None if alone else next(stamps, None)
            return Part(path, log.format.name, log.source.size, first, log.account)
        finally:
            if not keep:
                log.source.close()

    def tables(self, progress: Progress | None = None) -> Iterator[FrameTable]:
        """Yield the frames of all logs from the begin on; the tables share one channel numbering."""
        numbers: dict[str, int] = {}
        total = max(1, sum(part.size for part in self.parts))
        done = [0.0] * len(self.parts)

        def told(place: int) -> Progress | None:
            def tell(share: float) -> None:
                done[place] = share * self.parts[place].size
                if progress is not None:
                    progress(sum(done) / total)

            return None if progress is None else tell

        waiting = [
            _Reading(self._tables(part, told(place)), part, numbers) for place, part in enumerate(self.parts)
        ]  # fmt: skip
        active: list[_Reading] = []
        begun = False
        while waiting or active:
            if not active:
                active.append(waiting.pop(0))
            active = [one for one in active if one.held()]
            until = min((one.until for one in active), default=None)
            while waiting and until is not None and (first := waiting[0].part.first_ns) is not None and first <= until:
                active.append(waiting.pop(0))
                if not active[-1].held():
                    active.pop()
                else:
                    until = min(until, active[-1].until)
            if until is not None:
                table = _merged([one.take(until) for one in active], tuple(numbers))
                if not begun:
                    begun, self.first_ns = True, int(table.time_ns[0])
                    self.last_ns = self.first_ns
                self.last_ns = max(self.last_ns, int(table.time_ns.max()))
                yield table
        self.channels = tuple(numbers)
        yield FrameTable.empty(channels=self.channels)

    def line_of(self, frame: int) -> int | None:
        """Line of a frame, as `hil.log.read.Log.line_of`; None where several logs are read."""
        if len(self.parts) > 1:
            return None
        path = self.parts[0].path
        kept = self._kept.get(path)
        if kept is not None:
            return kept.line_of(frame)
        with open_log(path, options=self.options, limit_bytes=self.limit_bytes) as log:
            return log.line_of(frame)

    def _tables(self, part: Part, progress: Progress | None) -> Iterator[FrameTable]:
        kept = self._kept.get(part.path)
        log = kept or open_log(part.path, options=self.options, limit_bytes=self.limit_bytes)
        part.frames = 0
        try:
            for table in log.tables(progress):
                part.frames += len(table)
                yield table
        finally:
            part.account = log.account
            if kept is None:
                log.source.close()


def _check_distinct(paths: Sequence[Path]) -> None:
    """Refuse a log that is given twice, under whatever name or link: its frames would count twice."""
    known: dict[Path, Path] = {}
    for path in paths:
        whole = path.resolve()
        if whole in known:
            other = "" if str(known[whole]) == str(path) else f", as {known[whole]} too"
            raise LogError(path, f"is given twice{other}; name every log once")
        known[whole] = path


class _Reading:
    """One log being merged: the table at hand, its channels renumbered."""

    def __init__(self, tables: Iterator[FrameTable], part: Part, numbers: dict[str, int]) -> None:
        self.part = part
        self._tables = tables
        self._numbers = numbers
        self._table = FrameTable.empty()
        self._reached: npt.NDArray[np.int64] = np.zeros(0, np.int64)  # greatest stamp up to each row

    @property
    def until(self) -> int:
        """Greatest stamp of the table at hand."""
        return int(self._reached[-1])

    def held(self) -> bool:
        """Have a row at hand; False at the end of the log."""
        while not len(self._table):
            table = next(self._tables, None)
            if table is None:
                return False
            for name in table.channels:
                self._numbers.setdefault(name, len(self._numbers))
            new = np.array([self._numbers[name] for name in table.channels], np.int32)
            if not np.array_equal(new, np.arange(len(new))):
                table.channel[:] = new[table.channel]
            self._table = table
            if len(table):
                last = self._reached[-1:] if len(self._reached) else table.time_ns[:1]
                self._reached = np.maximum.accumulate(np.maximum(table.time_ns, last))
        return True

    def take(self, until: int) -> tuple[FrameTable, npt.NDArray[np.int64]]:
        """Take the rows up to a stamp, with what they are merged by."""
        n = int(np.searchsorted(self._reached, until, "right"))
        taken, reached = self._table.take(slice(0, n)), self._reached[:n]
        self._table = self._table.take(slice(n, None))
        self._reached = self._reached[n:] if len(self._table) else reached[-1:]
        return taken, reached


def _merged(pieces: list[tuple[FrameTable, npt.NDArray[np.int64]]], channels: tuple[str, ...]) -> FrameTable:
    pieces = [piece for piece in pieces if len(piece[0])]
    if len(pieces) == 1:
        return replace(pieces[0][0], channels=channels)
    table = FrameTable.joined([piece[0] for piece in pieces], channels)
    if not pieces:
        return table
    return table.take(np.argsort(np.concatenate([piece[1] for piece in pieces]), kind="stable"))
