"""The fence around foreign readers: each runs in a process of its own with limits of memory and time.

A library written elsewhere may hang, crash or take all memory on a damaged file. Behind the fence that is one
`LogError`. Nothing but bytes comes back, never a pickle.
"""

import os
import signal
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from hil.log.account import printable
from hil.log.frames import LogError
from hil.rt.clock import WallClock
from hil.rt.process import Piped

ENTRY = ("-P", "-m", "hil.log.foreign.fenced")  # -P: nothing is imported from the current folder
START_S = 60  # for the imports before the limits are set
BYTES = 256 * 1024 * 1024
SECONDS = 5
MEGABYTE = 1_000_000
_MAX_PIECE = 256 * 1024 * 1024
_ROOT = str(Path(__file__).parents[2])
_ADVICE = "the file may be damaged; write it anew with the program it comes from"


@dataclass(frozen=True, slots=True)
class Limits:
    """What a reader may take beyond what it has when its libraries are loaded.

    Attributes
    ----------
    more_bytes : memory (address space).
    seconds : processor time, and time spent waiting for it.
    """

    more_bytes: int = BYTES
    seconds: float = SECONDS

    @classmethod
    def for_size(cls, size: int) -> Self:
        """Limits for a file of ``size`` bytes: the same up to 1 MB, above that they grow with it."""
        share = max(1.0, size / MEGABYTE)
        return cls(int(BYTES * share), SECONDS * share)


def fenced_bytes(
    function: str, path: Path, what: str, limits: Limits | None = None, descriptor: int | None = None
) -> Iterator[bytes]:
    """Yield the pieces that a function of `hil.log.foreign.fenced.FUNCTIONS` yields for a file.

    Parameters
    ----------
    function : ``MODULE:FUNCTION``.
    path : the file; given to the function and named in errors.
    what : the reader's name in errors ("Parquet reader").
    limits : those for the file's size where None.
    descriptor : an open file that the function reads in the path's stead.

    Raises
    ------
    LogError
        When the reader refuses the file, crashes or goes beyond a limit.
    """
    if limits is None:
        limits = Limits.for_size(path.stat().st_size if descriptor is None else os.fstat(descriptor).st_size)
    read = str(path.absolute()) if descriptor is None else f"/proc/self/fd/{descriptor}"
    command = [sys.executable, *ENTRY, function, read, str(limits.more_bytes), str(int(limits.seconds) + 1)]
    found = os.environ.get("PYTHONPATH")
    environment = {
        "PYTHONPATH": _ROOT + (os.pathsep + found if found else ""),
        "MALLOC_ARENA_MAX": "1",  # the address space is limited: no arena for each thread
        "OMP_NUM_THREADS": "1",
        "ARROW_DEFAULT_MEMORY_POOL": "system",
    }
    pipe = _Pipe(Piped(command, environment, () if descriptor is None else (descriptor,)), START_S)
    try:
        while True:
            kind, content = pipe.message()
            if kind == b"D":
                yield content
            elif kind == b"R":
                pipe.left_s = limits.seconds
            elif kind == b"Z":
                return
            elif kind == b"E":
                raise LogError(path, _text(content))
            elif kind == b"X":
                raise LogError(path, f"the {what} cannot read it ({_text(content)}); {_ADVICE}")
            else:
                break
    finally:
        code = pipe.process.close()
    mebibytes = limits.more_bytes // 1024**2
    too_slow = f"the {what} took longer than {limits.seconds:g} s; {_ADVICE}"
    if kind == b"M":
        raise LogError(path, f"the {what} wanted more than {mebibytes} MiB; {_ADVICE}")
    if kind == b"late" or code == -signal.SIGXCPU:
        raise LogError(path, too_slow)
    how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    raise LogError(path, f"the {what} crashed ({how}, limit {mebibytes} MiB); {_ADVICE}")


def _text(content: bytes) -> str:
    return printable(content.decode("utf-8", "replace"))


class _Pipe:
    """Messages of a fenced process; time counts only while we wait for it."""

    def __init__(self, process: Piped, left_s: float) -> None:
        self.process = process
        self.left_s = left_s
        self._clock = WallClock()
        self._held = bytearray()

    def message(self) -> tuple[bytes, bytes]:
        """Kind and content; kind "late" when the time is up, "broken" when the process ended without a word."""
        problem = self._filled(5)
        if problem:
            return problem, b""
        (length,) = struct.unpack_from(">I", self._held, 1)
        if length > _MAX_PIECE:
            return b"broken", b""
        problem = self._filled(5 + length)
        if problem:
            return problem, b""
        kind, content = bytes(self._held[:1]), bytes(self._held[5 : 5 + length])
        del self._held[: 5 + length]
        return kind, content

    def _filled(self, size: int) -> bytes:
        """Wait for bytes; the problem where they do not come."""
        while len(self._held) < size:
            begin_ns = self._clock.now_ns()
            piece = self.process.read(1 << 20, self.left_s)
            self.left_s -= (self._clock.now_ns() - begin_ns) * 1e-9
            if piece is None:
                return b"late"
            if not piece:
                return b"broken"
            self._held += piece
        return b""
