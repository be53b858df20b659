"""What the bench says when it cannot go on, and how every command judges: verdicts and exit codes."""

from collections.abc import Collection, Iterable
from difflib import get_close_matches
from enum import StrEnum

INTERRUPTED_EXIT_CODE = 130
"""Ctrl-C: 128 + SIGINT, as a shell reports it. The verdict of an interrupted run is *incomplete*."""


class Verdict(StrEnum):
    """How a command judges, the same in every command, in JSON, in reports and in pytest; the worst one last."""

    PASSED = "passed"
    FAILED = "failed"  # what was tested did not do what was asked
    INCONCLUSIVE = "inconclusive"  # it ran to its end, but under conditions that allow no judgement
    INCOMPLETE = "incomplete"  # interrupted, or a recording or a file that was asked for is missing
    BROKEN = "broken"  # a node or the bench fell over, or never came to life

    @property
    def exit_code(self) -> int:
        """What the command line returns; 2 is wrong use or input, before anything was started."""
        return _EXIT_CODES[self]

    @property
    def rank(self) -> int:
        """0 for passed, larger for worse."""
        return _ORDER.index(self)


_ORDER = tuple(Verdict)
_EXIT_CODES = {
    Verdict.PASSED: 0,
    Verdict.FAILED: 1,
    Verdict.BROKEN: 3,
    Verdict.INCONCLUSIVE: 4,
    Verdict.INCOMPLETE: 5,
}


class BrakebenchError(Exception):
    """An error a person can act on: the message says what, where, expected, got, and what to do.

    Attributes
    ----------
    exit_code : what the command line returns: 2 wrong use or input, or the exit code of a `Verdict`.
    """

    exit_code = 2


def in_words(error: BaseException) -> str:
    """What a system error says, without its number and the file, which the message names; others as they are."""
    if isinstance(error, UnicodeDecodeError):
        return f"no text in UTF-8 (byte {error.start} is 0x{error.object[error.start]:02x})"
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)


_MOST_KNOWN = 40  # keys that a message lists


def unknown_keys(found: Iterable[str], known: Collection[str]) -> str | None:
    """Say which keys of a file nobody knows, what may have been meant, and what is known; None where all are known."""
    odd = [key for key in found if key not in known]
    if not odd:
        return None
    near = get_close_matches(odd[0], known, 1)
    meant = f"; did you mean {near[0]!r}?" if near else ""
    listed = sorted(known) if isinstance(known, set) else list(known)
    shown = f"{', '.join(listed[:_MOST_KNOWN]) or 'none'}"
    more = f" and {len(listed) - _MOST_KNOWN} more" if len(listed) > _MOST_KNOWN else ""
    return f"unknown key {', '.join(map(repr, odd))}; known here: {shown}{more}{meant}"
