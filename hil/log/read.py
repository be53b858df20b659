"""Opens a log of any known format."""

from collections.abc import Callable
from pathlib import Path

from hil.log.asc import read_asc
from hil.log.blf import read_blf
from hil.log.candump import read_candump
from hil.log.flat import read_csv, read_parquet
from hil.log.frames import LogError, Recording
from hil.log.mdf import read_mdf
from hil.log.trc import read_trc

READERS: dict[str, Callable[[Path], Recording]] = {
    ".log": read_candump,
    ".asc": read_asc,
    ".blf": read_blf,
    ".trc": read_trc,
    ".mf4": read_mdf,
    ".csv": read_csv,
    ".parquet": read_parquet,
}


def read_log(path: Path) -> Recording:
    """Read a log file; its suffix names the format, any unknown suffix is taken for candump's.

    Raises
    ------
    LogError
        When it cannot be opened, or holds nothing of its format: with the file and, where known, the byte offset.
    """
    try:
        recording = READERS.get(path.suffix.lower(), read_candump)(path)
    except OSError as error:
        raise LogError(path, f"cannot be opened: {error.strerror or error}; give a log file") from error
    if recording.rejected and not len(recording.frames) and recording.truncated_at is None:
        first = recording.first_rejected[0]
        formats = ", ".join(READERS)
        raise LogError(path, f"no {recording.format} log, got {first.text!r}; known suffixes: {formats}", first.offset)
    return recording
