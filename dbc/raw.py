"""Signals as they lie in a payload: read and written bit by bit, whatever a typed message would make of them."""

from dataclasses import dataclass
from functools import cache

from dbc.codec import field_of, payload_signals
from dbc.contract import MessageSpec, contract, database_text
from dbc.e2e import protect
from dbc.frame import BusName
from dbc.lean_cantools import Database, cantools


@dataclass(frozen=True, slots=True)
class RawSignal:
    """Where a signal lies (little endian), and what its raw values mean: value = raw * factor + offset, SI.

    Attributes
    ----------
    name : in the DBC.  start, length : bits.  signed : two's complement.
    factor, offset : SI value of one raw step, and of raw 0.
    first, last : raw values of the range's ends.  sna : raw value that means not available, or None.
    """

    name: str
    start: int
    length: int
    signed: bool
    factor: float
    offset: float
    first: int
    last: int
    sna: int | None

    @property
    def lowest(self) -> int:
        """Least raw value that the bits can hold."""
        return -(1 << (self.length - 1)) if self.signed else 0

    @property
    def highest(self) -> int:
        """Greatest raw value that the bits can hold."""
        return (1 << (self.length - self.signed)) - 1

    def raw_of(self, value: float) -> int:
        """Raw value nearest to a value (SI), held to what the bits can hold and off the value that means none."""
        raw = min(max(round((value - self.offset) / self.factor), self.lowest), self.highest)
        if raw == self.sna:
            raw += 1 if raw == self.lowest else -1
        return raw

    def read(self, payload: bytes | bytearray) -> int:
        """Raw value in a payload."""
        raw = int.from_bytes(payload, "little") >> self.start & ((1 << self.length) - 1)
        return raw - (1 << self.length) if self.signed and raw >> (self.length - 1) else raw

    def write(self, payload: bytes | bytearray, raw: int) -> bytearray:
        """A payload with another raw value; its check value is as before."""
        mask = (1 << self.length) - 1
        word = int.from_bytes(payload, "little") & ~(mask << self.start) | (raw & mask) << self.start
        return bytearray(word.to_bytes(len(payload), "little"))


@cache
def raw_signals(bus: BusName) -> dict[str, tuple[RawSignal, ...]]:
    """Signals of each message of a bus in the order of its typed message, by the name of the message."""
    database = cantools.database.load_string(database_text(bus), database_format="dbc", strict=True)
    assert isinstance(database, Database)
    found: dict[str, tuple[RawSignal, ...]] = {}
    for message in database.messages:
        signals = []
        for signal in payload_signals(message):
            if signal.byte_order != "little_endian":
                raise ValueError(f"{message.name}.{signal.name}: expected a little-endian signal")
            field = field_of(signal)
            ends = sorted((end - signal.offset) / signal.scale for end in (field.minimum, field.maximum))
            si = field.si_per_unit
            signals.append(
                RawSignal(
                    signal.name, signal.start, signal.length, signal.is_signed, signal.scale * si, signal.offset * si,
                    round(ends[0]), round(ends[1]), field.sna,
                )
            )  # fmt: skip
        found[message.name] = tuple(signals)
    return found


@cache
def named_messages(bus: BusName) -> dict[str, MessageSpec]:
    """Messages of a bus by name."""
    return {spec.name: spec for spec in contract(bus).by_id.values()}


def protected_again(spec: MessageSpec, payload: bytes | bytearray, counter: int | None = None) -> bytes:
    """A payload with a valid check value, and another counter where one is given."""
    if spec.data_id is None:
        return bytes(payload)
    return protect(spec.data_id, bytearray(payload), payload[1] & 0x0F if counter is None else counter)
