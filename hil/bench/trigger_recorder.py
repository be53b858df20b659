"""Keeps the last seconds in memory and writes them, with the next ones, when a condition begins to hold."""

import os
import re
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from hil.bench.candump_lines import CandumpLines, RecorderError, by_time
from hil.bench.recorder import FLUSH_PERIOD_NS, Source, append, create
from hil.bench.trigger import Hit, Trigger

RING_BYTES = 256 * 1024 * 1024
"""Most text that is kept: two full buses of 1 Mbit/s for 330 s at 8 bytes a frame (2 x 9,000 a second, 45 a line),
230 s of empty frames (2 x 21,000, 27 bytes)."""


class _Piece(NamedTuple):
    """What one flush took: the first and last stamp in it, ns, and its lines."""

    first_ns: int
    last_ns: int
    text: bytes


class TriggerRecorder:
    """Writes a numbered candump file for each trigger: ``FILE-1.log``, ``FILE-2.log``, ...

    A file begins ``before_ns`` ahead of its trigger, or where the recorder began, and ends ``after_ns`` behind it, each
    rounded up to a flush. A trigger meanwhile is counted, and is in that file; the next one behind its end gets a file
    of its own, again with what was before it.

    Parameters
    ----------
    path : names the files; none of them may exist.
    buses : what to listen to.
    trigger : the conditions.
    before_ns, after_ns : ns.
    say : takes what happens, one line at a time.
    epoch_ns : as of `CandumpLines`.
    ring_bytes : most text that is kept.
    most_files : files behind which no further one is begun, nor a trigger counted; None where there is no limit.

    Attributes
    ----------
    triggers : conditions that began to hold.
    files : files written, also the one being written.
    shortened_ns : of the files, the most that ``before_ns`` was cut short by ``ring_bytes``, ns.

    Raises
    ------
    RecorderError : a file is there already, or the folder is none that can be written to.
    """

    def __init__(
        self,
        path: Path,
        buses: Sequence[Source],
        trigger: Trigger,
        before_ns: int,
        after_ns: int,
        say: Callable[[str], None] = lambda _: None,
        epoch_ns: int | None = None,
        ring_bytes: int = RING_BYTES,
        most_files: int | None = None,
    ) -> None:
        self.lines = CandumpLines(epoch_ns)
        self.triggers = self.shortened_ns = 0
        self.files: list[Path] = []
        self._path = path
        self._buses = buses
        self._trigger = trigger
        self._before_ns, self._after_ns = before_ns, after_ns
        self._say = say
        self._ring: deque[_Piece] = deque()
        self._kept, self._most = 0, ring_bytes
        self._most_files = most_files
        self._dropped_ns: int | None = None  # stamp up to which the ring had no room
        self._file: int | None = None
        self._end_ns = 0
        if not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
            raise RecorderError(f"{path}: cannot be created (no folder {path.parent} that can be written to)")
        numbered = re.compile(re.escape(path.stem) + r"-\d+" + re.escape(path.suffix))
        there = sorted(one.name for one in path.parent.iterdir() if numbered.fullmatch(one.name))
        if there:
            raise RecorderError(
                f"{path.with_name(there[0])}: exists already; a recording never overwrites, name another file"
            )

    @property
    def done(self) -> bool:
        """Whether the last of ``most_files`` is written."""
        return self._file is None and len(self.files) == self._most_files

    def flush(self, now_ns: int) -> None:
        """Take what arrived until ``now_ns`` (monotonic), keep it, and write what is due.

        Raises
        ------
        RecorderError : a file cannot be written.
        """
        received = by_time([item for bus in self._buses for item in bus.receive(0.0)])
        if received:
            piece = _Piece(received[0].time_ns, received[-1].time_ns, self.lines.text(received))
            self._keep(piece)
            if self._file is not None and piece.first_ns <= self._end_ns:
                append(self._file, self.files[-1], piece.text)
            for hit in self._trigger.hear(received):
                if hit.time_ns > self._end_ns:
                    self._close()
                if self.done:
                    break
                self.triggers += 1
                if self._file is None:
                    self._open(hit)
        # what was stamped before the end may come one flush later
        if self._file is not None and now_ns > self._end_ns + FLUSH_PERIOD_NS:
            self._close()

    def _keep(self, piece: _Piece) -> None:
        self._ring.append(piece)
        self._kept += len(piece.text)
        while self._ring[0].last_ns < piece.first_ns - self._before_ns:
            self._kept -= len(self._ring.popleft().text)
        while self._kept > self._most and len(self._ring) > 1:
            gone = self._ring.popleft()
            self._kept -= len(gone.text)
            self._dropped_ns = gone.last_ns

    def _open(self, hit: Hit) -> None:
        number = len(self.files) + 1
        path = self._path.with_name(f"{self._path.stem}-{number}{self._path.suffix}")
        self._file = create(path)
        self.files.append(path)
        begin_ns = hit.time_ns - self._before_ns
        self._end_ns = hit.time_ns + self._after_ns
        pieces = [piece for piece in self._ring if piece.last_ns >= begin_ns]
        append(self._file, path, b"".join(piece.text for piece in pieces))
        if self._dropped_ns is not None and self._dropped_ns >= begin_ns:
            self.shortened_ns = max(self.shortened_ns, self._dropped_ns - begin_ns)
        ahead_s = max(0, hit.time_ns - pieces[0].first_ns) * 1e-9
        self._say(f"trigger {self.triggers}: {hit.text}; {path} begins {ahead_s:.2f} s before it")

    def _close(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def close(self, now_ns: int) -> None:
        """Write what is left and end the file that is being written, before its time where it is not over.

        Raises
        ------
        RecorderError : as of `flush`; or a link had failed and not come back.
        """
        self.flush(now_ns)
        if self._file is not None:
            missing_s = (self._end_ns - now_ns) * 1e-9
            self._close()
            if missing_s > 0:
                self._say(f"{self.files[-1]} ends {missing_s:.2f} s early: stopped")
        self.lines.check_links(self._path)
