"""Message <-> bytes: one pair of functions per message, generated from the database.

The generated source performs the arithmetic of cantools in the same order (scaled = raw * factor + offset, raw
rounded half to even), so that bytes and values agree bit for bit with cantools, the oracle of the tests; beside
it stand the conversion to SI, clamping to the signal's range and the SNA value.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from math import ceil, floor
from typing import Any

from cantools.database.can import Message as DbcMessage
from cantools.database.can import Signal as DbcSignal

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
    """

    name: str
    signal: str
    si_per_unit: float
    minimum: float
    maximum: float
    sna: int | None
    enum: type[IntEnum] | None


def payload_signals(message: DbcMessage) -> list[DbcSignal]:
    """Signals of a message in bit order, without counter and check value."""
    return [s for s in message.signals if s.name not in (CRC_SIGNAL, COUNTER_SIGNAL)]


def sna_of(signal: DbcSignal) -> int | None:
    """Raw value that the value table of a signal names SNA."""
    return next((int(raw) for raw, name in (signal.choices or {}).items() if str(name) == SNA), None)


def _raw_range(signal: DbcSignal) -> tuple[int, int]:
    if signal.is_signed:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


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
    low, high = sorted(raw * signal.scale + signal.offset for raw in _raw_range(signal))
    name = signal.name.lower() + (f"_{suffix}" if suffix else "")
    return Field(name, signal.name, si, max(signal.minimum, low), min(signal.maximum, high), sna_of(signal), enum)


def _shift(signal: DbcSignal, length_bytes: int) -> int:
    """Position of the least significant bit in the payload read as one integer of the signal's byte order."""
    if signal.byte_order == "little_endian":
        return signal.start
    return 8 * length_bytes - (8 * (signal.start // 8) + 7 - signal.start % 8) - signal.length


def _compile(source: str, name: str, namespace: dict[str, Any]) -> Callable[..., Any]:
    exec(compile(source, f"<codec {name}>", "exec"), namespace)  # noqa: S102 - our own generated arithmetic
    function: Callable[..., Any] = namespace[name]
    return function


def _number(value: float) -> str:
    return repr(int(value)) if isinstance(value, int) or float(value).is_integer() else repr(value)


def compile_encoder(message: DbcMessage, fields: list[Field]) -> Callable[[tuple[Any, ...]], bytearray]:
    """Encoder of one message: SI values in field order -> payload with counter and check value left 0.

    ``None`` and non-finite values become SNA; a signal without SNA refuses them with `CodecError`. Values outside
    the range are clamped to it.
    """
    signals = payload_signals(message)
    little = [f"v{i}" for i in range(len(fields))]
    namespace: dict[str, Any] = {}
    lines = ["def encode(values):", f" {', '.join(little)}{',' if len(fields) == 1 else ''} = values", " try:"]
    words: dict[str, list[str]] = {"little_endian": [], "big_endian": []}
    for i, (field, signal) in enumerate(zip(fields, signals, strict=True)):
        mask = (1 << signal.length) - 1
        scaled = f"v{i}" if field.si_per_unit == 1.0 else f"v{i} / {field.si_per_unit!r}"
        shifted = "x" if signal.offset == 0 else f"(x - {_number(signal.offset)})"
        raw = f"round({shifted})" if signal.scale == 1 else f"round({shifted} / {_number(signal.scale)})"
        signed = f" & {mask}" if signal.is_signed else ""
        namespace[f"odd{i}"] = _odd_value(message, field, signal)
        lines += [
            f"  x = {scaled}",
            f"  v{i} = {raw}{signed} if {_number(field.minimum)} <= x <= {_number(field.maximum)} else odd{i}(v{i})",
        ]
        shift = _shift(signal, message.length)
        words[signal.byte_order].append(f"v{i} << {shift}" if shift else f"v{i}")
    odd = ", ".join(f"odd{i}(w{i})" for i in range(len(fields)))
    names = ", ".join(f"w{i}" for i in range(len(fields)))
    comma = "," if len(fields) == 1 else ""
    lines += [" except TypeError:", f"  {names}{comma} = values", f"  {', '.join(little)}{comma} = {odd}{comma}"]
    word = " | ".join(words["little_endian"]) or "0"
    if words["big_endian"]:
        big = f"({' | '.join(words['big_endian'])}).to_bytes({message.length}, 'big')"
        word = f"{word} | int.from_bytes({big}, 'little')"
    lines.append(f" return bytearray(({word}).to_bytes({message.length}, 'little'))")
    return _compile("\n".join(lines), "encode", namespace)


def _odd_value(message: DbcMessage, field: Field, signal: DbcSignal) -> Callable[[float | None], int]:
    """Raw value of any value of a signal: SNA for what is none, the range's end for what is beyond."""
    mask = (1 << signal.length) - 1

    def raw(value: float | None) -> int:
        if value is None or not -1e300 < value < 1e300:
            if field.sna is None:
                raise CodecError(
                    f"{message.name}.{field.signal}: expected a finite number, got {value!r}; it has no SNA value"
                )
            return field.sna & mask
        x = min(max(value / field.si_per_unit, field.minimum), field.maximum)
        return round((x - signal.offset) / signal.scale) & mask

    return raw


def compile_decoder(message: DbcMessage, fields: list[Field], make: Callable[..., Any]) -> Callable[[bytes], Any]:
    """Decoder of one message: payload -> typed message; SNA and values out of range become ``None``."""
    signals = payload_signals(message)
    lines = ["def decode(data):", " little = int.from_bytes(data, 'little')"]
    if any(s.byte_order == "big_endian" for s in signals):
        lines.append(" big = int.from_bytes(data, 'big')")
    namespace: dict[str, Any] = {"make": make}
    for i, (field, signal) in enumerate(zip(fields, signals, strict=True)):
        word = "little" if signal.byte_order == "little_endian" else "big"
        shift = _shift(signal, message.length)
        moved = f"{word} >> {shift}" if shift else word
        raw = f"{moved} & {(1 << signal.length) - 1}"
        half = 1 << (signal.length - 1)
        lines.append(f" r = ({raw} ^ {half}) - {half}" if signal.is_signed else f" r = {raw}")
        if field.enum is not None:
            namespace[f"enum{i}"] = {int(member): member for member in field.enum}
            lines.append(f" v{i} = enum{i}.get(r)")
            continue
        value = "r" if signal.scale == 1 else f"r * {_number(signal.scale)}"
        value += "" if signal.offset == 0 else f" + {_number(signal.offset)}"
        if field.si_per_unit != 1.0:
            value = f"({value}) * {field.si_per_unit!r}" if signal.offset else f"{value} * {field.si_per_unit!r}"
        test = _raw_test(signal, field)
        lines.append(f" v{i} = {value}" + (f" if {test} else None" if test else ""))
    values = ", ".join(f"v{i}" for i in range(len(fields)))
    if isinstance(make, type) and issubclass(make, tuple):  # spares a NamedTuple its own Python-made __new__
        namespace["new"] = tuple.__new__
        lines.append(f" return new(make, ({values},))")
    else:
        lines.append(f" return make({values})")
    return _compile("\n".join(lines), "decode", namespace)


def _raw_test(signal: DbcSignal, field: Field) -> str:
    """Condition on the raw value ``r`` for a usable value; empty where every raw value is one."""
    lowest, highest = _raw_range(signal)
    slack = abs(signal.scale) * 1e-6  # the clamped end of a range must survive its own rounding
    ends = sorted((end - signal.offset) / signal.scale for end in (field.minimum - slack, field.maximum + slack))
    first, last = max(lowest, ceil(ends[0])), min(highest, floor(ends[1]))
    parts = [str(first), "<="] if first > lowest else []
    parts += ["r"] + (["<=", str(last)] if last < highest else [])
    test = [" ".join(parts)] if len(parts) > 1 else []
    if field.sna is not None and first <= field.sna <= last:
        test.append(f"r != {field.sna}")
    return " and ".join(test)
