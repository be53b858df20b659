"""Files that appear whole or not at all."""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.log.frames import LogError


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
    check_folder(path)
    if path.exists():
        if any(other.exists() and path.samefile(other) for other in read):
            raise LogError(path, "is read by this command too; give another name for the output")
        if not overwrite:
            raise LogError(path, "exists already; use --force to replace it, or give another name")
    # The suffix stays: writers choose their format by it.
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise LogError(path, f"cannot be written: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)
