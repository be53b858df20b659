"""Signals of any database, written to and read from a payload.

Bits lie as in a DBC (Vector's numbering): little endian counts from the least significant bit of byte 0, big endian
from the most significant bit of byte 0 on.
"""

import math
import struct
import sys
from collections.abc import Mapping

from dbc.database import Message, Signal

Raw = int | float
_FLOATS = {16: ">e", 32: ">f", 64: ">d"}
_GREATEST = {16: 65504.0, 32: 3.4028234663852886e38, 64: sys.float_info.max}  # finite ones, IEEE 754


def _shift(signal: Signal, length: int) -> int:
    """How far its lowest bit lies above the lowest of the payload, read in the signal's own byte order."""
    return 8 * length - signal.first_bit - signal.length if signal.big_endian else signal.first_bit


def read(signal: Signal, payload: bytes) -> Raw:
    """Raw value of a signal in a payload."""
    word = int.from_bytes(payload, "big" if signal.big_endian else "little")
    bits = word >> _shift(signal, len(payload)) & ((1 << signal.length) - 1)
    if signal.is_float:
        value: float = struct.unpack(_FLOATS[signal.length], bits.to_bytes(signal.length // 8, "big"))[0]
        return value
    return bits - (1 << signal.length) if signal.signed and bits >> (signal.length - 1) else bits


def _bits(signal: Signal, raw: Raw) -> int:
    if signal.is_float:
        return int.from_bytes(struct.pack(_FLOATS[signal.length], raw), "big")
    return int(raw) & ((1 << signal.length) - 1)


def raw_range(signal: Signal) -> tuple[int, int]:
    """Least and greatest raw value that the bits of a signal that is no float can hold."""
    if signal.signed:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def raw_of(signal: Signal, value: float) -> Raw:
    """Raw value nearest to a physical one, held to what the bits can hold.

    Raises
    ------
    ValueError : the value is no number, or the signal's factor is 0.
    """
    if math.isnan(value) or signal.factor == 0:
        raise ValueError(f"{signal.name}: {value!r} has no raw value with factor {signal.factor:g}")
    exact = (value - signal.offset) / signal.factor
    if signal.is_float:
        greatest = _GREATEST[signal.length]
        return min(max(exact, -greatest), greatest)
    lowest, highest = raw_range(signal)
    return round(min(max(exact, lowest), highest))


def physical(signal: Signal, raw: Raw) -> float:
    """Physical value of a raw one."""
    return raw * signal.factor + signal.offset


def present(message: Message, signal: Signal, values: Mapping[str, Raw]) -> bool:
    """Whether a signal is in the payload that the raw ``values`` of the multiplexers select."""
    by_name = {one.name: one for one in message.signals}
    while signal.multiplexer is not None:
        selector = values.get(signal.multiplexer, 0)
        if not any(first <= selector <= last for first, last in signal.mux_ranges):
            return False
        signal = by_name[signal.multiplexer]
    return True


def selected(message: Message, signal: Signal, payload: bytes) -> bool:
    """Whether a signal is in a payload that came."""
    if signal.multiplexer is None:
        return True
    multiplexers = {one.multiplexer for one in message.signals}
    return present(message, signal, {s.name: read(s, payload) for s in message.signals if s.name in multiplexers})


def assemble(message: Message, values: Mapping[str, Raw]) -> bytearray:
    """Payload with these raw values; bits of no signal, and of signals without a value, are 0."""
    little = big = 0
    for signal in message.signals:
        if signal.name not in values or not present(message, signal, values):
            continue
        bits = _bits(signal, values[signal.name]) << _shift(signal, message.length)
        if signal.big_endian:
            big |= bits
        else:
            little |= bits
    payload = bytearray(little.to_bytes(message.length, "little"))
    for index, byte in enumerate(big.to_bytes(message.length, "big")):
        payload[index] |= byte
    return payload
