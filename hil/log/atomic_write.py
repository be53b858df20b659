"""Files that appear whole or not at all."""

import os
import signal
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import NoReturn

from hil.log.frames import LogError

STEM_BYTES = 180  # of the name that stays in a temporary one; a file system takes 255


def check_folder(path: Path) -> None:
    """Refuse a file to write whose folder is none.

    Raises
    ------
    LogError
        When there is no such folder.
    """
    if not path.parent.is_dir():
        raise LogError(path, f"cannot be written: there is no folder {path.parent}; create it, or give another name")


@contextmanager
def atomic_write(path: Path, overwrite: bool = False, read: Iterable[Path] = ()) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; put it in place when the block ends without an error.

    Parameters
    ----------
    overwrite : an existing file may be replaced.
    read : files that are read meanwhile and are never replaced, under whatever name or link.

    Raises
    ------
    LogError
        When ``path`` exists and may not be replaced, has no folder, or cannot be written.
    """
    if path.is_symlink():
        path = Path(os.path.realpath(path))  # the link stays, and leads to what is written
    check_folder(path)
    if path.exists():
        if any(other.exists() and path.samefile(other) for other in read):
            raise LogError(path, "is read by this command too; give another name for the output")
        if not overwrite:
            raise LogError(path, "exists already; use --force to replace it, or give another name")
    # The suffix stays: writers choose their format by it.
    temporary = path.with_name(f"{temporary_stem(path.stem)}{path.suffix}")
    with orderly_end():
        try:
            yield temporary
            temporary.replace(path)
        except OSError as error:
            raise LogError(path, f"cannot be written: {error.strerror or error}") from error
        finally:
            with suppress(OSError):  # it was never there
                temporary.unlink()


def temporary_stem(stem: str) -> str:
    """Name of what is being written, while it is."""
    return f".{os.fsdecode(os.fsencode(stem)[:STEM_BYTES])}.{os.getpid()}.part"


@contextmanager
def orderly_end() -> Iterator[None]:
    """Have SIGTERM end this process by an exception, so that temporary files go, where it would end it at once."""
    ours = threading.current_thread() is threading.main_thread()
    ours = ours and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    if ours:
        signal.signal(signal.SIGTERM, _end)
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _end(number: int, _: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)
