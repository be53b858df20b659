"""Opens a log of any known format."""

from pathlib import Path

from hil.log.candump import read_candump
from hil.log.frames import LogError, Recording


def read_log(path: Path) -> Recording:
    """Read a log file.

    Raises
    ------
    LogError
        When it cannot be opened, or is no log.
    """
    try:
        recording = read_candump(path)
    except OSError as error:
        raise LogError(path, f"cannot be opened: {error.strerror or error}") from error
    return recording
