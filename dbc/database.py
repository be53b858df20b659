"""Anybody's DBC as plain values for a decoder, with everything odd about it as warnings."""

import logging
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from dbc.lean_cantools import cantools
from dbc.supported_subset import SupportedText, supported_subset

MAX_TEXT_BYTES = 16 * 1024 * 1024


class DatabaseError(ValueError):
    """A file that is no usable DBC; the message says what was expected and what stands there."""


@dataclass(frozen=True, slots=True)
class Signal:
    """Where a signal lies in its message, and how its raw value becomes a physical one.

    Attributes
    ----------
    start, length : bits, in the DBC's own numbering (big endian: ``start`` is the most significant bit).
    factor, offset : physical = raw * factor + offset.
    minimum, maximum : stated physical range, None where there is none.
    choices : names of raw values.
    multiplexer : name of the signal that selects this one, None where it is always there.
    mux_ids : raw values of that signal with which this one is there.
    """

    name: str
    start: int
    length: int
    big_endian: bool
    signed: bool
    is_float: bool
    factor: float
    offset: float
    unit: str
    minimum: float | None
    maximum: float | None
    choices: dict[int, str]
    multiplexer: str | None
    mux_ids: frozenset[int]

    @property
    def first_bit(self) -> int:
        """Lowest bit of the payload in its own byte order: little endian counts from the least significant bit of
        byte 0, big endian from the most significant one."""
        return 8 * (self.start // 8) + 7 - self.start % 8 if self.big_endian else self.start

    @property
    def is_integer(self) -> bool:
        """Physical values are whole numbers."""
        return not self.is_float and float(self.factor).is_integer() and float(self.offset).is_integer()

    def bits(self) -> frozenset[int]:
        """Bits it covers, as byte * 8 + bit within the byte."""
        bits = range(self.first_bit, self.first_bit + self.length)
        return frozenset(8 * (b // 8) + 7 - b % 8 for b in bits) if self.big_endian else frozenset(bits)


@dataclass(frozen=True, slots=True)
class Message:
    """One message: identifier (without flag bits), length in bytes, signals by start bit."""

    name: str
    can_id: int
    extended: bool
    length: int
    signals: tuple[Signal, ...]


@dataclass(frozen=True, slots=True)
class Database:
    """Messages by (identifier, extended), and what was odd about the text."""

    source: str
    messages: dict[tuple[int, bool], Message]
    warnings: tuple[str, ...]


def parse_database(content: bytes | str, source: str = "database") -> Database:
    """Read a DBC; what is sound is loaded, what is not becomes a warning.

    Parameters
    ----------
    content : the file's bytes (UTF-8, else Windows-1252) or its text.
    source : what messages call it, usually the file's name.

    Raises
    ------
    DatabaseError
        When it is too large or holds no message.
    """
    if len(content) > MAX_TEXT_BYTES:
        raise DatabaseError(f"{source}: {len(content)} bytes; a DBC of at most {MAX_TEXT_BYTES} bytes is read")
    warnings: list[str] = []
    text = content if isinstance(content, str) else _decoded(content, warnings)
    if "\0" in text:
        raise DatabaseError(f"{source}: zero bytes in it, so it is no DBC text; give a Vector DBC file")
    supported = supported_subset(text)
    warnings += supported.warnings
    if not supported.blocks:
        shown = (text.lstrip()[:40].splitlines() or ["nothing"])[0]
        raise DatabaseError(f"{source}: no message in it; expected a Vector DBC with BO_ lines, got {shown!r}")
    messages: dict[tuple[int, bool], Message] = {}
    names: set[str] = set()
    for foreign in _load(supported, warnings):
        message = _message(foreign, names, warnings)
        key = message.can_id, message.extended
        if key in messages:
            other = messages[key].name
            warnings.append(f"identifier {key[0]:#x}: {other} and {message.name} share it; the last one is used")
            names.discard(other)
        messages[key] = message
        names.add(message.name)
        _overlaps(message, warnings)
    if not messages:
        raise DatabaseError(f"{source}: none of its {len(supported.blocks)} messages can be read: {warnings[-1]}")
    return Database(source, messages, tuple(warnings))


def _decoded(content: bytes, warnings: list[str]) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        try:
            return content.decode("cp1252")
        except UnicodeDecodeError as error:
            line = content.count(b"\n", 0, error.start) + 1
            warnings.append(f"line {line}: text is neither UTF-8 nor Windows-1252; odd letters are replaced")
            return content.decode("cp1252", errors="replace")


@contextmanager
def _quiet() -> Iterator[None]:
    # cantools logs duplicates that we report ourselves.
    logger = logging.getLogger("cantools")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)


def _load(supported: SupportedText, warnings: list[str]) -> list[Any]:
    """Messages as cantools reads them: the whole text, else message by message."""
    with _quiet():
        try:
            return list(_cantools(supported.text))
        except Exception as error:  # cantools raises whatever its parser trips over
            warnings.append(f"the text as a whole cannot be read ({_short(error)}); read message by message")
        messages: list[Any] = []
        for block in supported.blocks:
            try:
                messages += _cantools(supported.alone(block))
            except Exception as error:
                warnings.append(f"message {block.name}: {_short(error)}; left out")
        return messages


def _cantools(text: str) -> Any:
    database: Any = cantools.database.load_string(text, database_format="dbc", strict=False)
    return database.messages


def _short(error: Exception) -> str:
    return (str(error).splitlines() or [""])[0][:160] or type(error).__name__


def _message(foreign: Any, names: set[str], warnings: list[str]) -> Message:
    name = foreign.name
    if name in names:
        name = f"{name}_{foreign.frame_id:X}"
        warnings.append(f"message {foreign.name}: its name is used twice; {foreign.frame_id:#x} is called {name}")
    signals: dict[str, Signal] = {}
    for one in foreign.signals:
        where = f"signal {name}.{one.name}"
        if not all(math.isfinite(v) for v in (one.scale, one.offset)):
            warnings.append(f"{where}: factor {one.scale}, offset {one.offset}; left out")
            continue
        if one.name in signals:
            warnings.append(f"{where}: defined twice; the last one is used")
        signals[one.name] = _signal(one, where, warnings)
    sound = [s for s in signals.values() if _mux_exists(s, signals, name, warnings)]
    return Message(name, foreign.frame_id, foreign.is_extended_frame, foreign.length, tuple(sound))


def _signal(one: Any, where: str, warnings: list[str]) -> Signal:
    minimum, maximum = one.minimum, one.maximum
    if one.scale == 0:
        warnings.append(f"{where}: factor 0, so its value is always {one.offset}")
    if minimum is not None and maximum is not None and minimum > maximum:
        warnings.append(f"{where}: minimum {minimum} above maximum {maximum}; range not used")
        minimum = maximum = None
    return Signal(
        name=one.name,
        start=one.start,
        length=one.length,
        big_endian=one.byte_order == "big_endian",
        signed=one.is_signed and not one.is_float,
        is_float=one.is_float,
        factor=one.scale,
        offset=one.offset,
        unit=one.unit or "",
        minimum=minimum,
        maximum=maximum,
        choices={int(raw): str(text) for raw, text in (one.choices or {}).items()},
        multiplexer=one.multiplexer_signal,
        mux_ids=frozenset(one.multiplexer_ids or ()) if one.multiplexer_signal else frozenset(),
    )


def _mux_exists(signal: Signal, signals: dict[str, Signal], message: str, warnings: list[str]) -> bool:
    seen = {signal.name}
    parent = signal.multiplexer
    while parent is not None:
        if parent in seen or parent not in signals or signals[parent].is_float:
            warnings.append(f"signal {message}.{signal.name}: its multiplexer {parent} cannot select it; left out")
            return False
        seen.add(parent)
        parent = signals[parent].multiplexer
    return True


def _overlaps(message: Message, warnings: list[str]) -> None:
    """Report signals that share a bit in one frame; branches of one multiplexer exclude each other."""
    always: dict[int, str] = {}  # bit -> a signal that is always there
    branches: dict[int, dict[tuple[str, int], str]] = {}  # bit -> (multiplexer, value) -> a signal
    for signal in sorted(message.signals, key=lambda s: s.multiplexer is not None):
        keys = [(signal.multiplexer, mux_id) for mux_id in signal.mux_ids if signal.multiplexer]
        found: set[str] = set()
        for bit in signal.bits():
            if bit in always:
                found.add(always[bit])
            if signal.multiplexer is None:
                always[bit] = signal.name
                continue
            branch = branches.setdefault(bit, {})
            found.update(branch[key] for key in keys if key in branch)
            branch.update(dict.fromkeys(keys, signal.name))
        warnings.extend(f"signal {message.name}.{signal.name}: overlaps {message.name}.{n}" for n in sorted(found))
