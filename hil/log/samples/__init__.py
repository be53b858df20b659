"""Logs that come with brakebench; a command takes one as ``sample:NAME`` in the place of a file."""

import difflib
from pathlib import Path

from hil.errors import BrakebenchError

SAMPLES = Path(__file__).parent
PREFIX = "sample:"
_SUFFIX = ".log.gz"


def sample_names() -> list[str]:
    """Names of the logs."""
    return sorted(path.name.removesuffix(_SUFFIX) for path in SAMPLES.glob(f"*{_SUFFIX}"))


def log_path(text: str) -> Path:
    """Path of a log, by path or as ``sample:NAME``.

    Raises
    ------
    BrakebenchError : there is no sample of that name.
    """
    if not text.startswith(PREFIX):
        return Path(text)
    name, names = text.removeprefix(PREFIX), sample_names()
    if name not in names:
        near = difflib.get_close_matches(name, names, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(names)}"
        raise BrakebenchError(f"no sample {name!r}; {hint}")
    return SAMPLES / f"{name}{_SUFFIX}"
