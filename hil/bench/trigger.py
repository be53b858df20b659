"""Conditions on live traffic: when do they begin to hold?

    CONDITION   TERM [and TERM ...]
    TERM        MESSAGE.SIGNAL OPERATOR VALUE     the signal's last value; OPERATOR is == != < <= > >= or &
                MESSAGE, or an identifier         such a frame has just come: 0x7E8

VALUE is a number in the database's own unit, or the name that the database gives a value; ``&`` asks whether any of its
bits is set. A signal that has not come yet, or is not available (SNA), makes its term false.
"""

import math
import operator
import re
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from typing import NamedTuple, TypeVar

import numpy as np

from dbc.database import Message, Signal
from dbc.frame import BusName, Frame, LinkEvent, Received
from hil.bench.wire_timing import table_of
from hil.errors import BrakebenchError
from hil.log.signals.databases import Databases

_OPERATORS: dict[str, Callable[[float, float], bool]] = {
    "==": operator.eq, "!=": operator.ne, "<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt,
    "&": lambda a, b: bool(int(a) & int(b)),
}  # fmt: skip
_TERM = re.compile(r"\s*([^\s=!<>&]+)\s*(?:(==|!=|<=|>=|<|>|&)\s*(\S+))?\s*")
_T = TypeVar("_T")
_AND = re.compile(r"\s+and\s+", re.IGNORECASE)


class ConditionError(BrakebenchError):
    """A condition that cannot be understood."""


class Hit(NamedTuple):
    """A condition began to hold: when, by the stamp of the frame, ns; which, and the values that made it hold."""

    time_ns: int
    text: str


class _Term(NamedTuple):
    """One comparison, or (``signal`` None) the coming of a frame.

    Attributes
    ----------
    message : name, "" for any identifier.  can_id, extended : of it, where ``message`` is empty.
    step : raw step of the signal; values within half of it are equal.
    """

    text: str
    message: str
    can_id: int
    extended: bool
    signal: str | None
    compare: str
    value: float
    step: float

    def holds(self, value: float) -> bool:
        """Whether a value of the signal fulfils it."""
        if math.isnan(value):
            return False
        if abs(value - self.value) < 0.5 * self.step:
            value = self.value
        return _OPERATORS[self.compare](value, self.value)


class Trigger:
    """Finds when conditions begin to hold: each one again only after it has not held meanwhile.

    Parameters
    ----------
    conditions : any of them triggers.
    databases : by bus (``vehicle``, ``bench``).

    Raises
    ------
    ConditionError : one is malformed, or names what the databases do not have.
    """

    def __init__(self, conditions: Sequence[str], databases: Databases) -> None:
        self._databases = databases
        self._conditions = [[_term(text, databases) for text in _AND.split(c.strip())] for c in conditions]
        self._texts = [" ".join(c.split()) for c in conditions]
        terms = [term for condition in self._conditions for term in condition]
        self._messages = {term.message for term in terms if term.message}
        self._ids = {(term.can_id, term.extended) for term in terms if not term.message}
        self._values = {_name(term): math.nan for term in terms if term.signal is not None}
        self._decoder = databases.decoder(set(self._values)) if self._values else None
        self._held = [False] * len(self._conditions)
        self._message_of: dict[tuple[BusName, int, bool], str | None] = {}

    def hear(self, received: Sequence[Received]) -> list[Hit]:
        """Take what came, in order of time, and return what began to hold."""
        frames: list[Frame] = []
        names: list[str] = []
        for item in received:
            if isinstance(item, LinkEvent):
                continue
            key = (item.bus, item.can_id, item.extended)
            if key not in self._message_of:
                message = self._databases.message(*key)
                self._message_of[key] = message.name if message and message.name in self._messages else None
            name = self._message_of[key]
            if name is not None or key[1:] in self._ids:
                frames.append(item)
                names.append(name or "")
        return self._follow(frames, names) if frames else []

    def _follow(self, frames: list[Frame], names: list[str]) -> list[Hit]:
        values: dict[str, dict[int, float]] = {}
        if self._decoder is not None:
            log = self._decoder.add(table_of(frames))
            for name, column in log.columns.items():
                numbers = np.asarray(column.values, np.float64).tolist()
                values[name] = dict(zip(column.rows.tolist(), numbers, strict=True))
        hits = []
        for row, (frame, name) in enumerate(zip(frames, names, strict=True)):
            for signal in self._values:
                if signal.partition(".")[0] == name:
                    self._values[signal] = values.get(signal, {}).get(row, math.nan)
            for index, terms in enumerate(self._conditions):
                holds = all(self._true(term, frame, name) for term in terms)
                if holds and not self._held[index]:
                    hits.append(Hit(frame.time_ns, self._words(index)))
                # the coming of a frame is over at once, so the next one triggers again
                self._held[index] = holds and all(term.signal is not None for term in terms)
        return hits

    def _true(self, term: _Term, frame: Frame, name: str) -> bool:
        if term.signal is not None:
            return term.holds(self._values[_name(term)])
        return name == term.message if term.message else (frame.can_id, frame.extended) == (term.can_id, term.extended)

    def _words(self, index: int) -> str:
        seen = {_name(term): self._values[_name(term)] for term in self._conditions[index] if term.signal is not None}
        shown = ", ".join(f"{name} is {value:g}" for name, value in seen.items())
        return self._texts[index] + (f" ({shown})" if shown else "")


def _name(term: _Term) -> str:
    return f"{term.message}.{term.signal}"


def _term(text: str, databases: Databases) -> _Term:
    match = _TERM.fullmatch(text)
    if match is None:
        raise ConditionError(
            f"condition {text!r}: expected MESSAGE.SIGNAL OPERATOR VALUE (BRAKE_STATUS.MODE == SAFE_STOP), MESSAGE or "
            "an identifier (0x7E8); OPERATOR is ==, !=, <, <=, >, >= or &"
        )
    what, compare, value = match.groups()
    if re.fullmatch(r"0[xX][0-9a-fA-F]{1,8}", what):
        if compare:
            raise ConditionError(
                f"condition {text!r}: an identifier has no value; compare MESSAGE.SIGNAL, or see it come"
            )
        can_id = int(what, 16)
        if can_id >= 1 << 29:
            raise ConditionError(f"condition {text!r}: an identifier has at most 29 bits")
        return _Term(text, "", can_id, can_id > 0x7FF, None, "", math.nan, 0.0)
    name, _, signal_name = what.partition(".")
    messages = {message.name: message for message in databases.messages()}
    message = _found(name, messages, text, "message")
    if not signal_name:
        if compare:
            raise ConditionError(f"condition {text!r}: compares a message; name a signal, {_some(message)}")
        return _Term(text, message.name, 0, False, None, "", math.nan, 0.0)
    signal = _found(signal_name, {signal.name: signal for signal in message.signals}, text, f"signal of {message.name}")
    if not compare:
        raise ConditionError(
            f"condition {text!r}: expected an operator and a value, as {message.name}.{signal.name} != 0"
        )
    step = 0.0 if signal.is_float else abs(signal.factor)
    wanted = _value(value, signal, text)
    if compare == "&" and not (signal.is_integer and wanted.is_integer()):
        raise ConditionError(f"condition {text!r}: & asks for bits, and one of the two is no whole number")
    return _Term(text, message.name, 0, False, signal.name, compare, wanted, step)


def _found(name: str, known: dict[str, _T], text: str, what: str) -> _T:
    by_lower = {one.lower(): one for one in known}
    if name in known or name.lower() in by_lower:
        return known[name if name in known else by_lower[name.lower()]]
    near = get_close_matches(name.upper(), sorted(known), 3) or sorted(known)[:5]
    raise ConditionError(f"condition {text!r}: no {what} is called {name!r}; did you mean {', '.join(near)}?")


def _value(text: str, signal: Signal, condition: str) -> float:
    for raw, name in signal.choices.items():
        if name.lower() == text.lower():
            return float(raw * signal.factor + signal.offset)
    try:
        return float(int(text, 16)) if text.lower().startswith("0x") else float(text)
    except ValueError:
        names = ", ".join(list(signal.choices.values())[:8])
        raise ConditionError(
            f"condition {condition!r}: expected a number{f' or one of {names}' if names else ''}, got {text!r}"
        ) from None


def _some(message: Message) -> str:
    return " or ".join(f"{message.name}.{signal.name}" for signal in message.signals[:3])
