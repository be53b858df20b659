"""What is taken of a log: channels, a span of time, messages, signals."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime, tzinfo
from decimal import Decimal, InvalidOperation
from fnmatch import fnmatchcase

import numpy as np

from hil.errors import BrakebenchError
from hil.log.frames import FrameTable
from hil.log.signals.databases import Databases
from hil.log.wall_clock import wall_clock_ns

MOST_NS = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Moment:
    """A time: ns since 1970, or since the first frame of the log (``relative``)."""

    time_ns: int
    relative: bool

    @classmethod
    def parse(cls, text: str, zone: tzinfo) -> "Moment":
        """Read seconds since the first frame, or an ISO date and time (of ``zone`` where it names none).

        Raises
        ------
        BrakebenchError
            For anything else.
        """
        try:
            seconds = Decimal(text)
            if abs(seconds) < 9_000_000_000:
                return cls(int(seconds * 1_000_000_000), True)
        except InvalidOperation:
            pass
        try:
            stamp = datetime.fromisoformat(text)
            time_ns = wall_clock_ns(stamp.replace(tzinfo=None), stamp.tzinfo or zone)
        except (ValueError, OverflowError):
            raise BrakebenchError(
                f"{text!r} is no time; give seconds from the first frame (12.5) or a date and time (2024-05-01T12:00)"
            ) from None
        return cls(time_ns, False)


@dataclass(frozen=True, slots=True)
class Choice:
    """Part of a log; an empty tuple and None choose all.

    Attributes
    ----------
    channels : by name.
    begin, end : both included.
    messages : patterns of message names.
    signals : patterns of ``MESSAGE.SIGNAL``, or of the signal's name alone where they have no dot.
    """

    channels: tuple[str, ...] = ()
    begin: Moment | None = None
    end: Moment | None = None
    messages: tuple[str, ...] = ()
    signals: tuple[str, ...] = ()

    @property
    def of_frames(self) -> bool:
        """Frames are left out."""
        return bool(self.channels) or self.begin is not None or self.end is not None

    def frames(self, tables: Iterable[FrameTable]) -> Iterator[FrameTable]:
        """Yield the chosen frames; the first frame of all, chosen or not, is where relative times begin."""
        first_ns: int | None = None
        for table in tables:
            if not len(table) or not self.of_frames:
                yield table
                continue
            if first_ns is None:
                first_ns = int(table.time_ns[0])
            mask = np.ones(len(table), np.bool_)
            if self.channels:
                known = np.array([name in self.channels for name in table.channels], np.bool_)
                mask &= known[table.channel]
            if self.begin is not None:
                mask &= table.time_ns >= _bounded(self.begin, first_ns)
            if self.end is not None:
                mask &= table.time_ns <= _bounded(self.end, first_ns)
            yield table if mask.all() else table.take(mask)

    def wanted(self, databases: Databases) -> list[str] | None:
        """Names ("MESSAGE.SIGNAL") of the chosen signals; None for all.

        Raises
        ------
        BrakebenchError
            For a pattern that matches nothing of the databases.
        """
        if not self.messages and not self.signals:
            return None
        names = [(message.name, signal.name) for message in databases.messages() for signal in message.signals]
        found: dict[str, None] = {}
        for pattern in self.signals or ("*",):
            matched = [name for name in names if matches(*name, pattern)]
            if not matched:
                raise BrakebenchError(f"no signal of the database is called {pattern!r}{_known(names, 1)}")
            found |= dict.fromkeys(f"{m}.{s}" for m, s in matched if not self.messages or self._of_message(m))
        for pattern in self.messages:
            if not any(fnmatchcase(message, pattern) for message, _ in names):
                raise BrakebenchError(f"no message of the database is called {pattern!r}{_known(names, 0)}")
        return list(found)

    def _of_message(self, message: str) -> bool:
        return any(fnmatchcase(message, pattern) for pattern in self.messages)


def _bounded(moment: Moment, first_ns: int) -> int:
    return max(-MOST_NS, min(MOST_NS, moment.time_ns + (first_ns if moment.relative else 0)))


def matches(message: str, signal: str, pattern: str) -> bool:
    """Tell whether a pattern means a signal: ``MESSAGE.SIGNAL``, or the signal alone where it has no dot."""
    return fnmatchcase(f"{message}.{signal}" if "." in pattern else signal, pattern)


def _known(names: list[tuple[str, str]], place: int) -> str:
    shown = [name[0] if place == 0 else ".".join(name) for name in dict.fromkeys(names)]
    shown = list(dict.fromkeys(shown))
    if not shown:
        return "; it has none"
    return f"; it has {', '.join(shown[:8])}{f' and {len(shown) - 8} more' if len(shown) > 8 else ''}"
