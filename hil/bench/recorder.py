"""The recorder: a process of its own that appends every frame of both buses to one candump file."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from dbc.frame import Received
from hil.bench.candump_lines import CandumpLines, RecorderError, by_time

__all__ = ["FLUSH_PERIOD_NS", "Recorder", "RecorderError", "Source", "append", "create"]

FLUSH_PERIOD_NS = 20_000_000


class Source(Protocol):
    """What a recorder listens to."""

    def receive(self, timeout_s: float) -> list[Received]:
        """Return what arrived since the last call."""
        ...


def create(path: Path) -> int:
    """Create a file to append to, and return its descriptor.

    Raises
    ------
    RecorderError : it exists, or cannot be created.
    """
    try:
        return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
    except FileExistsError as error:
        raise RecorderError(f"{path}: exists already; a recording never overwrites, name another file") from error
    except OSError as error:
        raise RecorderError(f"{path}: cannot be created ({error.strerror})") from error


def append(file: int, path: Path, text: bytes) -> None:
    """Append a text whole.

    Raises
    ------
    RecorderError : the disk does not take it.
    """
    try:
        while text:
            text = text[os.write(file, text) :]
    except OSError as error:
        raise RecorderError(f"{path}: recording is INCOMPLETE ({error.strerror})") from error


class Recorder:
    """Appends frames to a candump log; what was received 20 ms before a kill is in the file.

    Lines of one flush are in order of time; more in `CandumpLines`.

    Parameters
    ----------
    path : file to create; never overwritten.
    buses : what to listen to.
    epoch_ns : time of day of monotonic time 0; None takes this machine's.
    """

    def __init__(self, path: Path, buses: Sequence[Source], epoch_ns: int | None = None) -> None:
        self.path = path
        self.lines = CandumpLines(epoch_ns)
        self._buses = buses
        self._file = create(path)

    def flush(self) -> None:
        """Take what arrived and append it."""
        received = [item for bus in self._buses for item in bus.receive(0.0)]
        if received:
            append(self._file, self.path, self.lines.text(by_time(received)))

    def close(self) -> None:
        """Write what is left and close the file.

        Raises
        ------
        RecorderError
            A link had failed and not come back, so that the file is not what was on the bus.
        """
        self.flush()
        os.close(self._file)
        self.lines.check_links(self.path)
