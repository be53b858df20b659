"""One message as it comes: its signals' values, its cycle and its protection."""

import math
import struct
from collections.abc import Callable

from dbc.codec import SNA
from dbc.database import Message, Signal
from dbc.e2e import USABLE, Checker, Status

_FLOATS = {16: ">e", 32: ">f", 64: ">d"}
_SMOOTHING = 0.1  # weight of the newest interval in the mean cycle: some ten frames count
Value = float | int | None


class LiveMessage:
    """What is known of a message, by its frames so far.

    Parameters
    ----------
    bus : name of its bus.
    message : its description; None for an identifier that no database has.
    name : how it is called.

    Attributes
    ----------
    count : frames so far.
    cycle_ms : mean time between the last ones; None before the second.
    last_ns, data : stamp and payload of the last one.
    status : what the end-to-end check says of it; None where the message has no protection.
    """

    def __init__(self, bus: str, name: str, can_id: int, extended: bool, message: Message | None) -> None:
        self.bus, self.name, self.can_id, self.extended, self.message = bus, name, can_id, extended, message
        self.count = 0
        self.cycle_ms: float | None = None
        self.last_ns = 0
        self.data = b""
        self.status: Status | None = None
        self.checker: Checker | None = None
        if message is not None and message.e2e_data_id is not None and message.length >= 2:
            self.checker = Checker(message.e2e_data_id, message.length)
        self._read = _reader(message) if message is not None else None

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Its signals, in the order of `hear`'s values."""
        return () if self.message is None else self.message.signals

    @property
    def sound(self) -> bool:
        """Whether nothing speaks against the last frame."""
        return self.status is None or self.status in USABLE or self.status is Status.SYNC

    def hear(self, data: bytes, at_ns: int) -> list[Value] | None:
        """Take one frame.

        Returns
        -------
        Physical values of its signals in the units of the database, None for what is not available or not selected by
        the multiplexer; None in all where the frame is too short, fails its check, or nothing is known of it.
        """
        if self.count:
            interval_ms = max(0, at_ns - self.last_ns) * 1e-6
            before = self.cycle_ms
            self.cycle_ms = interval_ms if before is None else before + _SMOOTHING * (interval_ms - before)
        self.count += 1
        self.last_ns, self.data = at_ns, data
        if self.checker is not None:
            self.status = self.checker.check(data)
            if self.status is Status.WRONG_CRC:
                return None
        if self._read is None or self.message is None or len(data) < self.message.length:
            return None
        return self._read(data[: self.message.length])


def _reader(message: Message) -> Callable[[bytes], list[Value]]:
    """How to read the values of all signals out of a payload as long as the message."""
    bits = 8 * message.length
    plans = []
    index = {signal.name: place for place, signal in enumerate(message.signals)}
    for s in message.signals:
        shift = bits - s.first_bit - s.length if s.big_endian else s.first_bit
        unavailable = next((raw for raw, name in s.choices.items() if name == SNA), None)
        selector = index.get(s.multiplexer) if s.multiplexer is not None else None
        plans.append((s, shift, (1 << s.length) - 1, unavailable, selector))

    def read(payload: bytes) -> list[Value]:
        little, big = int.from_bytes(payload, "little"), int.from_bytes(payload, "big")
        raws = [(big if s.big_endian else little) >> shift & mask for s, shift, mask, _, _ in plans]
        return [
            _value(s, raw, unavailable) if _selected(place, raws) else None
            for place, ((s, _, _, unavailable, _), raw) in enumerate(zip(plans, raws, strict=True))
        ]

    def _selected(place: int, raws: list[int]) -> bool:
        signal, _, _, _, selector = plans[place]
        while selector is not None:
            if not any(first <= raws[selector] <= last for first, last in signal.mux_ranges):
                return False
            signal, _, _, _, selector = plans[selector]
        return True

    return read


def _value(signal: Signal, bits: int, unavailable: int | None) -> Value:
    raw: float
    if signal.is_float:
        raw = struct.unpack(_FLOATS[signal.length], bits.to_bytes(signal.length // 8, "big"))[0]
    else:
        raw = bits - (1 << signal.length) if signal.signed and bits >> (signal.length - 1) else bits
        if raw == unavailable:
            return None
    value = raw * signal.factor + signal.offset
    return value if math.isfinite(value) else None
