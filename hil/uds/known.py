"""What is known of an ECU by name, and values in words."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from hil.uds import names
from hil.uds.dtc import dtc_text

SHOWN_BYTES = 16
"""Bytes of a value without a known form that a line shows; the rest is counted."""


def hex_text(data: bytes) -> str:
    """Bytes in hexadecimal, at most `SHOWN_BYTES` of them."""
    more = f" ... ({len(data)} bytes)" if len(data) > SHOWN_BYTES else ""
    return data[:SHOWN_BYTES].hex(" ").upper() + more


def value_text(data: bytes) -> str:
    """Bytes as text in quotes where all are visible ASCII (three at least, zeros behind are padding), else as bytes."""
    text = data.rstrip(b"\0")
    if len(text) >= 3 and all(0x20 <= byte < 0x7F for byte in text):
        return f'"{text.decode("ascii")}"'
    return hex_text(data)


def named(table: Mapping[int, str], value: int) -> str:
    """Name of a value with the value where it has none."""
    return table.get(value, f"0x{value:02X}")


@dataclass(frozen=True, slots=True)
class Did:
    """A data identifier of a known ECU.

    Attributes
    ----------
    name : one word, as it is asked for.
    length : its bytes; None where they may be any number.
    value : what its bytes say, with unit.
    coded : bytes of a value as a person writes it; BrakebenchError where it is none.
    """

    name: str
    length: int | None = None
    value: Callable[[bytes], str] | None = None
    coded: Callable[[str], bytes] | None = None


@dataclass(frozen=True, slots=True)
class Names:
    """What is known of an ECU beyond the standard; nothing of a foreign one."""

    dids: Mapping[int, Did] = field(default_factory=dict)
    dtcs: Mapping[int, str] = field(default_factory=dict)
    routines: Mapping[int, Did] = field(default_factory=dict)
    records: Mapping[int, Did] = field(default_factory=dict)
    """Extended data records of a code, of one byte each."""
    periodic: Mapping[int, int] = field(default_factory=dict)
    """Data identifiers by the byte that stands for them in periodic messages."""

    def did_text(self, did: int) -> str:
        """Identifier with its name, where it has one."""
        name = self.dids[did].name if did in self.dids else names.DIDS.get(did, "")
        return f"0x{did:04X} {name}".rstrip()

    def dtc_text(self, number: int) -> str:
        """Code with its name, where it has one."""
        return f"{dtc_text(number)} {self.dtcs.get(number, '')}".rstrip()

    def routine_text(self, routine: int) -> str:
        """Routine identifier with its name, where it has one."""
        return f"0x{routine:04X} {self.routines[routine].name if routine in self.routines else ''}".rstrip()

    def routine_value(self, routine: int, data: bytes) -> str:
        """What a routine answers."""
        known = self.routines.get(routine)
        return known.value(data) if known is not None and known.value is not None and data else value_text(data)

    def periodic_text(self, data: bytes) -> str:
        """A periodic message: the byte of its data identifier, its value, padding."""
        did = self.periodic.get(data[0], 0xF200 | data[0])
        length = self.dids[did].length if did in self.dids else None
        value = data[1:] if length is None else data[1 : 1 + length]
        return f"periodic data, {self.did_text(did)} = {self.value_text(did, value)}"

    def extended_text(self, records: bytes) -> list[str]:
        """Extended data records of a code; only of an ECU whose records are known can they be told apart."""
        if len(records) % 2 == 0 and set(records[::2]) <= set(self.records):
            pairs = [(self.records[records[k]], records[k + 1 : k + 2]) for k in range(0, len(records), 2)]
            return [f"{one.name} {one.value(data) if one.value is not None else data[0]}" for one, data in pairs]
        return [f"record {records[0]} = {hex_text(records[1:])}"] if records else []

    def value_text(self, did: int, data: bytes) -> str:
        """Value of a data identifier: in its unit where that is known, as text where it is text, else its bytes."""
        known = self.dids.get(did)
        if known is not None and known.value is not None and known.length in (None, len(data)):
            return known.value(data)
        if did == 0xF186 and len(data) == 1:
            return named(names.SESSIONS, data[0])
        return value_text(data)


FOREIGN = Names()
