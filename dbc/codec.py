"""Message <-> bytes: one pair of functions per message, generated from the database.

The generated source performs the arithmetic of cantools in the same order (scaled = raw * factor + offset, raw
rounded half to even), so that bytes and values agree bit for bit with cantools, the oracle of the tests; beside
it stand the conversion to SI, clamping to the signal's range and the SNA value.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
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
    lines = ["def encode(values):", " little = big = 0"]
    names = ", ".join(f"v{i}" for i in range(len(fields)))
    lines.append(f" {names}{',' if len(fields) == 1 else ''} = values")
    for i, (field, signal) in enumerate(zip(fields, payload_signals(message), strict=True)):
        mask = (1 << signal.length) - 1
        absent = f"refuse({field.signal!r}, v{i})" if field.sna is None else str(field.sna)
        scaled = f"v{i}" if field.si_per_unit == 1.0 else f"v{i} / {field.si_per_unit!r}"
        lines += [
            f" if v{i} is None or not -1e300 < v{i} < 1e300: r = {absent}",
            " else:",
            f"  x = {scaled}",
            f"  if x < {_number(field.minimum)}: x = {_number(field.minimum)}",
            f"  elif x > {_number(field.maximum)}: x = {_number(field.maximum)}",
            f"  r = round((x - {_number(signal.offset)}) / {_number(signal.scale)})",
        ]
        word = "little" if signal.byte_order == "little_endian" else "big"
        lines.append(f" {word} |= (r & {mask}) << {_shift(signal, message.length)}")
    lines.append(f" return bytearray((little).to_bytes({message.length}, 'little'))")
    if any(s.byte_order == "big_endian" for s in payload_signals(message)):
        lines[-1] = (
            f" word = little | int.from_bytes(big.to_bytes({message.length}, 'big'), 'little')\n"
            f" return bytearray(word.to_bytes({message.length}, 'little'))"
        )

    def refuse(signal_name: str, value: float | None) -> int:
        raise CodecError(f"{message.name}.{signal_name}: expected a finite number, got {value!r}; it has no SNA value")

    return _compile("\n".join(lines), "encode", {"refuse": refuse})


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
        lines.append(f" r = ({word} >> {shift}) & {(1 << signal.length) - 1}")
        if signal.is_signed:
            lines.append(f" if r >= {1 << (signal.length - 1)}: r -= {1 << signal.length}")
        if field.enum is not None:
            namespace[f"enum{i}"] = {int(member): member for member in field.enum}
            lines.append(f" v{i} = enum{i}.get(r)")
            continue
        plain = signal.scale == 1 and signal.offset == 0
        lines.append(" x = r" if plain else f" x = r * {_number(signal.scale)} + {_number(signal.offset)}")
        si = "" if field.si_per_unit == 1.0 else f" * {field.si_per_unit!r}"
        slack = abs(signal.scale) * 1e-6  # the clamped end of a range must survive its own rounding
        low, high = field.minimum - slack, field.maximum + slack
        absent = "" if field.sna is None else f"r == {field.sna} or "
        lines.append(f" v{i} = None if {absent}not {_number(low)} <= x <= {_number(high)} else x{si}")
    lines.append(f" return make({', '.join(f'v{i}' for i in range(len(fields)))})")
    return _compile("\n".join(lines), "decode", namespace)
