"""What a decoder needs to know of a database: messages, their signals, and what was odd about the file."""

from dataclasses import dataclass

MAX_WARNINGS = 1000
MAX_SHOWN = 60  # letters of a foreign name or text that a warning repeats


class DatabaseError(ValueError):
    """A file that is no usable database; the message says what was expected and what stands there."""


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
    mux_ranges : raw values of that signal with which this one is there, as (first, last), ascending and apart.
    comment : what the database says about it.
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
    multiplexer: str | None = None
    mux_ranges: tuple[tuple[int, int], ...] = ()
    comment: str = ""

    @property
    def first_bit(self) -> int:
        """Lowest bit of the payload in its own byte order: little endian counts from the least significant bit of
        byte 0, big endian from the most significant one."""
        return 8 * (self.start // 8) + 7 - self.start % 8 if self.big_endian else self.start

    @property
    def is_integer(self) -> bool:
        """Physical values are whole numbers."""
        return not self.is_float and float(self.factor).is_integer() and float(self.offset).is_integer()

    def mask(self) -> int:
        """Bits it covers, as the set bits of a number: bit 8 * byte + bit within the byte."""
        start, length = self.start, self.length
        if not self.big_endian:
            return ((1 << length) - 1) << start
        byte, top = start // 8, start % 8 + 1  # bits of the first byte from ``start`` downwards
        if length <= top:
            return ((1 << length) - 1) << (start - length + 1)
        whole, rest = divmod(length - top, 8)
        mask = (1 << top) - 1 | ((1 << 8 * whole) - 1) << 8
        return (mask | (0xFF & -(1 << 8 - rest)) << 8 * (whole + 1)) << 8 * byte


@dataclass(frozen=True, slots=True)
class Message:
    """One message, its signals by first bit.

    Attributes
    ----------
    can_id : identifier, without flag bits.
    length : bytes; above 64 it comes by a transport protocol.
    cycle_time_ms : stated period, ms; None where there is none.
    sender : node that sends it, "" where none is named.
    pgn_match : it stands for its J1939 parameter group, from any source address (and to any destination).
    e2e_data_id : AUTOSAR data identifier of its end-to-end protection, None without.
    is_fd : stated to be a CAN FD frame.
    comment : what the database says about it.
    """

    name: str
    can_id: int
    extended: bool
    length: int
    signals: tuple[Signal, ...]
    cycle_time_ms: float | None = None
    sender: str = ""
    pgn_match: bool = False
    e2e_data_id: int | None = None
    is_fd: bool = False
    comment: str = ""

    @property
    def pgn(self) -> int:
        """J1939 parameter group number of the identifier (SAE J1939-21): below PDU format 240 (PDU1) the low byte is
        a destination address and no part of it."""
        group = self.can_id >> 8 & 0x3FFFF
        return group if group >> 8 & 0xFF >= 240 else group & 0x3FF00


@dataclass(frozen=True, slots=True)
class Database:
    """Messages by (identifier, extended), what was odd about the file, and the bit rate of its bus, bit/s."""

    source: str
    messages: dict[tuple[int, bool], Message]
    warnings: tuple[str, ...]
    bit_rate: int | None = None


class Warnings:
    """Collects what was odd, with the place in the text, and keeps no more than `MAX_WARNINGS`."""

    def __init__(self, text: str = "") -> None:
        self._text = text
        self._found: list[tuple[int, str]] = []
        self._further = 0

    def add(self, position: int | None, warning: str) -> None:
        """Take note; ``position`` is an index into the text, None where there is no place to name."""
        if len(self._found) < MAX_WARNINGS:
            self._found.append((-1 if position is None else position, warning))
        else:
            self._further += 1

    def lines(self) -> tuple[str, ...]:
        """Return the warnings in the order of the text, each with its line, and how many there were beyond."""
        lines: list[str] = []
        line, counted = 1, 0
        for position, warning in sorted(self._found, key=lambda f: f[0]):
            if position < 0:
                lines.append(warning)
                continue
            line += self._text.count("\n", counted, position)
            counted = position
            lines.append(f"line {line}: {warning}")
        if self._further:
            lines.append(f"and {self._further} further warnings")
        return tuple(lines)


def shown(text: str) -> str:
    """Return a foreign text for a message: one line, of bounded length, without control characters."""
    if len(text) <= MAX_SHOWN and text.isprintable():
        return text
    cut = text[:MAX_SHOWN] + ("..." if len(text) > MAX_SHOWN else "")
    return "".join(c if c.isprintable() else "?" for c in cut)
