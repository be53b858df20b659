"""A DBC's statements as messages and what is said of them, however they are written.

A signal needs its name, ``start|length@order`` and sign; what else is missing takes its default. What is there but
cannot be read (a factor, an order that is none) leaves the signal out, for a wrong value is worse than none.
"""

import re

from dbc.database_checks import message_problem
from dbc.database_values import Warnings, shown
from dbc.dbc_details import Details
from dbc.dbc_scan import MessageText, Scanner, SignalText, Statement

_HEAD = re.compile(r"SG_\s*+([^\s:\"]++)(?:\s++([^\s:\"]++))?+\s*+:")
_BITS = re.compile(r"\s*+([0-9]{1,6})\s*+\|\s*+([0-9]{1,6})\s*+@\s*+([0-9]++)\s*+([-+])", re.ASCII)
_FACTOR = re.compile(r"\s*+\(([^()\[\]\"]*+)\)")
_RANGE = re.compile(r"\s*+\[([^\[\]\"|]*+)\|([^\[\]\"|]*+)\]")
_MESSAGE = re.compile(r"BO_\s++([0-9]{1,20})\s++([^\s:\"]++)\s*+:\s*+([0-9]{1,9})(?:\s++(\S++))?", re.ASCII)
_MARKER = re.compile(r"M|m[0-9]{1,20}M?", re.ASCII)


class Draft:
    """A message and its signals as they stand in the text; ``problem`` says why it cannot be used."""

    __slots__ = ("extended", "key", "length", "problem", "signals", "text")

    def __init__(self, text: MessageText) -> None:
        self.text = text
        self.key = int(text.key)
        self.extended = bool(self.key & 0x8000_0000)
        self.signals: list[SignalText] = []
        self.length = int(text.length)
        self.problem = message_problem(self.can_id, self.extended, self.length)

    @property
    def can_id(self) -> int:
        """Identifier without the flag of an extended one."""
        return self.key & ~0x8000_0000


class DbcText:
    """What stands in one text: ``drafts`` in its order, and ``details``; what is odd goes to ``warnings``."""

    def __init__(self, text: str, warnings: Warnings) -> None:
        self._warnings = warnings
        self.details = Details(warnings)
        self.drafts: list[Draft] = []
        signals: list[SignalText] | None = None  # of the message that is being read
        for statement in Scanner(text, warnings).statements():
            if isinstance(statement, SignalText):
                self._put(statement, signals)
            elif isinstance(statement, MessageText) or statement.keyword == "BO_":
                message = statement if isinstance(statement, MessageText) else self._odd_message(statement)
                signals = None
                if message is not None:
                    self.drafts.append(Draft(message))
                    signals = self.drafts[-1].signals
            elif statement.keyword == "SG_":
                signal = self._odd_signal(statement)
                if signal is not None:
                    self._put(signal, signals)
            else:
                self.details.take(statement)

    def _put(self, signal: SignalText, signals: list[SignalText] | None) -> None:
        if signals is not None:
            signals.append(signal)
            return
        said = f"signal {shown(signal.name)}: stands in no message that can be read; left out"
        self._warnings.add(signal.position, said)

    def _odd_message(self, statement: Statement) -> MessageText | None:
        found = _MESSAGE.match(statement.skeleton)
        if not found:
            begin = shown(" ".join(statement.skeleton.split()))
            self._warnings.add(statement.position, f"{begin!r}: expected BO_ IDENTIFIER NAME: LENGTH SENDER; left out")
            return None
        return MessageText(statement.position, found[1], found[2], found[3], found[4] or "")

    def _odd_signal(self, statement: Statement) -> SignalText | None:
        """Read a signal that is not written as usual: all that is needed may still stand there."""
        text, where = statement.skeleton, statement.position
        head = _HEAD.match(text)
        bits = _BITS.match(text, head.end()) if head else None
        if head is None or bits is None or bits[3] not in ("0", "1"):
            expected = "expected SG_ NAME : START|LENGTH@ORDER SIGN, ORDER 0 or 1 and SIGN + or -"
            self._warnings.add(where, f"{shown(' '.join(text.split()))!r}: {expected}; signal left out")
            return None
        name, marker = head[1], head[2]
        if marker is not None and not _MARKER.fullmatch(marker):
            if marker == "m":
                self._warnings.add(where, f"signal {shown(name)}: 'm' without a value is read as 'M', a multiplexer")
                marker = "M"
            elif marker[0] in "mM":
                self._warnings.add(where, f"signal {shown(name)}: {shown(marker)!r} is no multiplexer mark; left out")
                return None
            else:
                self._warnings.add(where, f"signal {shown(name)}: {shown(marker)!r} behind its name is not used")
                marker = None
        missing: list[str] = []
        end, factor, offset = bits.end(), "1", "0"
        if found := _FACTOR.match(text, end):
            end = found.end()
            factor, comma, offset = (part.strip() for part in found[1].partition(","))
            if not comma:
                missing.append("offset 0")
                offset = "0"
        elif text.find("(", end, end + 10) < 0:
            missing.append("factor 1, offset 0")
        else:
            factor = " ".join(text[end : end + 20].split())
        minimum = maximum = "0"
        if found := _RANGE.match(text, end):
            minimum, maximum = found[1].strip(), found[2].strip()
        else:
            missing.append("no range")
        unit = statement.strings[0] if statement.strings else ""
        if not statement.strings:
            missing.append("no unit")
        if missing:
            self._warnings.add(where, f"signal {shown(name)}: not all stated; read with {', '.join(missing)}")
        return SignalText(
            where, name, marker, bits[1], bits[2], bits[3], bits[4], factor, offset, minimum, maximum, unit
        )
