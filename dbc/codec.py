"""Message <-> bytes: one pair of functions per message, generated from the database.

The generated source performs the arithmetic of cantools in the same order (scaled = raw * factor + offset, raw
rounded half to even), so that bytes and values agree bit for bit with cantools, the oracle of the tests; beside
it stand the conversion to SI, clamping to the signal's range, the SNA value, and the end-to-end protection of what is
sent. Bits are moved by bitstruct, as in cantools.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from math import ceil, floor
from operator import or_
from typing import Any

import bitstruct.c as bitstruct

from dbc import e2e
from dbc.lean_cantools import DbcMessage, DbcSignal

CRC_SIGNAL = "CRC"
COUNTER_SIGNAL = "ALIVE_COUNTER"
SNA = "SNA"

# unit in the DBC -> (suffix of the field name, SI value of one unit)
SI_UNITS: dict[str, tuple[str, float]] = {
    "": ("", 1.0),
    "%": ("", 0.01),
    "rad": ("rad", 1.0),
    "rad/s": ("rad_s", 1.0),
    "m": ("m", 1.0),
    "m/s": ("mps", 1.0),
    "m/s^2": ("mps2", 1.0),
    "bar": ("pa", 1e5),
    "N": ("n", 1.0),
    "Nm": ("nm", 1.0),
    "A": ("a", 1.0),
    "kW": ("w", 1e3),
    "J": ("j", 1.0),
    "K": ("k", 1.0),
    "us": ("s", 1e-6),
}


class CodecError(ValueError):
    """A value or a database entry that cannot go on the wire."""


@dataclass(frozen=True, slots=True)
class Field:
    """One signal as a field of a typed message.

    Attributes
    ----------
    name : field name, SI unit appended.  signal : signal name in the DBC.
    si_per_unit : SI value of one unit of the DBC.
    minimum, maximum : range in the DBC's unit that the raw value can hold too.
    sna : raw value that means signal not available, or None.
    enum : type of the value where the signal is a choice.
    start, length, signed, little_endian, factor, offset : as in the DBC.
    """

    name: str
    signal: str
    si_per_unit: float
    minimum: float
    maximum: float
    sna: int | None
    enum: type[IntEnum] | None
    start: int
    length: int
    signed: bool
    little_endian: bool
    factor: float
    offset: float


def payload_signals(message: DbcMessage) -> list[DbcSignal]:
    """Signals of a message in bit order, without counter and check value."""
    return [s for s in message.signals if s.name not in (CRC_SIGNAL, COUNTER_SIGNAL)]


def sna_of(signal: DbcSignal) -> int | None:
    """Raw value that the value table of a signal names SNA."""
    return next((int(raw) for raw, name in (signal.choices or {}).items() if str(name) == SNA), None)


def _raw_range(length: int, signed: bool) -> tuple[int, int]:
    if signed:
        return -(1 << (length - 1)), (1 << (length - 1)) - 1
    return 0, (1 << length) - 1


def field_of(signal: DbcSignal, enum: type[IntEnum] | None = None) -> Field:
    """Field of one signal; refuses what the wire cannot hold (unit unknown, no range, zero factor)."""
    unit = signal.unit or ""
    if unit not in SI_UNITS:
        raise CodecError(
            f"signal {signal.name}: unit {unit!r} has no SI conversion; expected one of {sorted(SI_UNITS)}"
        )
    if signal.minimum is None or signal.maximum is None or not signal.minimum < signal.maximum or not signal.scale:
        raise CodecError(f"signal {signal.name}: needs a range [min|max] with min < max and a factor other than 0")
    suffix, si = SI_UNITS[unit]
    low, high = sorted(raw * signal.scale + signal.offset for raw in _raw_range(signal.length, signal.is_signed))
    name = signal.name.lower() + (f"_{suffix}" if suffix else "")
    return Field(
        name=name,
        signal=signal.name,
        si_per_unit=si,
        minimum=max(signal.minimum, low),
        maximum=min(signal.maximum, high),
        sna=sna_of(signal),
        enum=enum,
        start=signal.start,
        length=signal.length,
        signed=signal.is_signed,
        little_endian=signal.byte_order == "little_endian",
        factor=float(signal.scale),
        offset=float(signal.offset),
    )


def _position(signal: DbcSignal, length_bytes: int) -> int:
    """First bit of a signal, counted from the most significant one; little-endian payloads are reversed for that."""
    if signal.byte_order == "little_endian":
        return 8 * length_bytes - signal.start - signal.length
    return 8 * (signal.start // 8) + 7 - signal.start % 8


class _Word:
    """All signals of one byte order: how bitstruct packs them, and the names of their values in its order."""

    def __init__(self, message: DbcMessage, byte_order: str, names: dict[str, str]) -> None:
        mine = [s for s in message.signals if s.byte_order == byte_order and s.name in names]
        mine.sort(key=lambda signal: _position(signal, message.length))
        self.names = [names[signal.name] for signal in mine]
        self.turn = "[reversed]" if byte_order == "little_endian" else ""
        layout, end = "", 0
        for signal in mine:
            gap = _position(signal, message.length) - end
            layout += (f"p{gap}" if gap else "") + f"{'s' if signal.is_signed else 'u'}{signal.length}"
            end += gap + signal.length
        gap = 8 * message.length - end
        self.layout = bitstruct.compile(layout + (f"p{gap}" if gap else ""))


def _words(message: DbcMessage, names: dict[str, str]) -> dict[str, _Word]:
    """Its words by name: mostly one, two where a message mixes byte orders."""
    both = {"little": _Word(message, "little_endian", names), "big": _Word(message, "big_endian", names)}
    return {name: word for name, word in both.items() if word.names}


def _compile(source: str, name: str, namespace: dict[str, Any]) -> Callable[..., Any]:
    namespace["reversed"] = slice(None, None, -1)
    exec(compile(source, f"<codec {name}>", "exec"), namespace)  # noqa: S102 - our own generated arithmetic
    function: Callable[..., Any] = namespace[name]
    return function


def _number(value: float, like: DbcSignal) -> str:
    """A constant of the type that the values of a signal have: arithmetic and comparison of one type are faster."""
    whole = all(float(number).is_integer() for number in (value, like.scale, like.offset))
    return repr(int(value) if whole else float(value))


def _listed(names: list[str]) -> str:
    return ", ".join(names) + ("," if len(names) == 1 else "")


def compile_encoder(message: DbcMessage, fields: list[Field], data_id: int | None = None) -> Callable[..., bytes]:
    """Encoder of one message: SI values in field order, and the alive counter (0 by default) -> payload.

    The payload is protected with ``data_id`` and the counter; None leaves both out. ``None`` and non-finite values
    become SNA; a signal without SNA refuses them with `CodecError`. Values outside the range are clamped to it.
    """
    signals = payload_signals(message)
    values = [f"v{i}" for i in range(len(fields))]
    names = dict(zip([s.name for s in signals], values, strict=True))
    namespace: dict[str, Any] = {"odd": [_odd_value(message, f, s) for f, s in zip(fields, signals, strict=True)]}
    lines = ["def encode(values, counter=0):", f" {_listed(values)} = values", " try:"]
    for i, (field, signal) in enumerate(zip(fields, signals, strict=True)):
        raw = f"v{i}" if signal.offset == 0 else f"(v{i} - {float(signal.offset)!r})"
        raw = raw if signal.scale == 1 else f"({raw} / {float(signal.scale)!r})"
        lines += [f"  v{i} /= {field.si_per_unit!r}"] if field.si_per_unit != 1.0 else []
        inside = f"{_number(field.minimum, signal)} <= v{i} <= {_number(field.maximum, signal)}"
        lines.append(f"  v{i} = {raw}.__round__() if {inside} else odd[{i}](values[{i}])")
    lines += [" except TypeError:", f"  {_listed(values)} = [raw(value) for raw, value in zip(odd, values)]"]
    words = _words(message, names if data_id is None else names | {COUNTER_SIGNAL: "counter"})
    namespace |= {f"pack_{name}": word.layout.pack for name, word in words.items()} | {"or_": or_}
    packed = [f"pack_{name}({', '.join(word.names)}){word.turn}" for name, word in words.items()]
    lines.append(f" data = {packed[0]}" if len(packed) == 1 else f" data = bytes(map(or_, {', '.join(packed)}))")
    if data_id is not None:
        octets = [f"b{i}" for i in range(1, message.length)]
        crc = str(e2e.start_value(data_id))
        for octet in octets:
            crc = f"t[{crc} ^ {octet}]"
        namespace |= {"t": e2e.CRC_TABLE, "check": [bytes([crc]) for crc in range(256)]}
        lines += [f" _, {', '.join(octets)} = data", f" data = check[{crc}] + data[1:]"]
    return _compile("\n".join([*lines, " return data"]), "encode", namespace)


def _odd_value(message: DbcMessage, field: Field, signal: DbcSignal) -> Callable[[float | None], int]:
    """Raw value of any value of a signal: SNA for what is none, the range's end for what is beyond."""

    def raw(value: float | None) -> int:
        if value is None or not -1e300 < value < 1e300:
            if field.sna is None:
                raise CodecError(
                    f"{message.name}.{field.signal}: expected a finite number, got {value!r}; it has no SNA value"
                )
            return field.sna
        x = min(max(value / field.si_per_unit, field.minimum), field.maximum)
        return round((x - signal.offset) / signal.scale)

    return raw


def compile_decoder(message: DbcMessage, fields: list[Field], make: Callable[..., Any]) -> Callable[[bytes], Any]:
    """Decoder of one message: payload -> typed message; SNA and values out of range become ``None``."""
    signals = payload_signals(message)
    words = _words(message, {signal.name: f"v{i}" for i, signal in enumerate(signals)})
    namespace: dict[str, Any] = {f"unpack_{name}": word.layout.unpack for name, word in words.items()} | {"make": make}
    lines = ["def decode(data):"]
    lines += [f" {_listed(word.names)} = unpack_{name}(data{word.turn})" for name, word in words.items()]
    for i, (field, signal) in enumerate(zip(fields, signals, strict=True)):
        if field.enum is not None:
            namespace[f"enum{i}"] = {int(member): member for member in field.enum}
            lines.append(f" v{i} = enum{i}.get(v{i})")
            continue
        value = f"v{i}" if signal.scale == 1 else f"v{i} * {_number(signal.scale, signal)}"
        value += "" if signal.offset == 0 else f" + {_number(signal.offset, signal)}"
        if field.si_per_unit != 1.0:
            value = f"({value}) * {field.si_per_unit!r}" if signal.offset else f"{value} * {field.si_per_unit!r}"
        test = _raw_test(f"v{i}", field)
        if test or value != f"v{i}":
            lines.append(f" v{i} = {value}" + (f" if {test} else None" if test else ""))
    values = ", ".join(f"v{i}" for i in range(len(fields)))
    if isinstance(make, type) and issubclass(make, tuple):  # spares a NamedTuple its own Python-made __new__
        namespace["new"] = tuple.__new__
        lines.append(f" return new(make, ({values},))")
    else:
        lines.append(f" return make({values})")
    return _compile("\n".join(lines), "decode", namespace)


def usable_raw(field: Field) -> tuple[int, int]:
    """First and last raw value within the range of a field; SNA may be one of them."""
    lowest, highest = _raw_range(field.length, field.signed)
    slack = abs(field.factor) * 1e-6  # the clamped end of a range must survive its own rounding
    ends = sorted((end - field.offset) / field.factor for end in (field.minimum - slack, field.maximum + slack))
    return max(lowest, ceil(ends[0])), min(highest, floor(ends[1]))


def _raw_test(raw: str, field: Field) -> str:
    """Condition on the raw value, by name, for a usable value; empty where every raw value is one."""
    lowest, highest = _raw_range(field.length, field.signed)
    first, last = usable_raw(field)
    parts = [str(first), "<="] if first > lowest else []
    parts += [raw] + (["<=", str(last)] if last < highest else [])
    test = [" ".join(parts)] if len(parts) > 1 else []
    if field.sna is not None and first <= field.sna <= last:
        test.append(f"{raw} != {field.sna}")
    return " and ".join(test)
