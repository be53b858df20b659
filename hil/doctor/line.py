"""One thing looked at."""

import os
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple


class Status(StrEnum):
    """How a thing stands."""

    OK = "ok"
    WARNING = "warning"  # there, but unwise
    MISSING = "missing"


class Line(NamedTuple):
    """One line of the result.

    Attributes
    ----------
    topic : what was looked at.
    status : how it stands.
    finding : what was found, and what follows from it.
    fix : the command that mends it, to be copied; empty where nothing is to be mended, or no command does it.
    """

    topic: str
    status: Status
    finding: str
    fix: str = ""


def guarded(topic: str, look: Callable[[], Sequence[Line]]) -> list[Line]:
    """Look; whatever goes wrong becomes a line: a machine that puzzles us is what this command is for."""
    try:
        return list(look())
    except Exception as error:
        return [Line(topic, Status.WARNING, f"could not look: {type(error).__name__}: {error}")]


def as_root(*commands: str) -> str:
    """Chain commands that need root."""
    prefix = "" if os.geteuid() == 0 else "sudo "
    return " && ".join(prefix + command for command in commands)


def write_as_root(text: str, path: str) -> str:
    """Command that writes a kernel setting."""
    return f"echo {text} | {as_root(f'tee {path}')}"


def read(path: Path) -> str:
    """Return a small file's text without its line end; empty where it cannot be read."""
    try:
        return path.read_text(errors="replace").strip()
    except OSError:
        return ""
