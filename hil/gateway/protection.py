"""Counters and check values of other makers' messages.

Layouts and polynomials after AUTOSAR FO, E2E Protocol Specification (profiles 1, 2, 5 and 11), and for the sum after
opendbc's Toyota check sum (MIT licence, comma.ai). Header fields lie together, ``offset`` bytes into the payload.
Profiles 1 and 11 and our own messages share one CRC, `dbc.e2e`.
"""

import binascii
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from dbc.e2e import crc8

_MAX_LOST = 2
"""Frames that may be missing in a row and still leave the next one usable, as of `dbc.e2e.Checker`."""


def _table(polynomial: int) -> tuple[int, ...]:
    table = []
    for value in range(256):
        for _ in range(8):
            value = (value << 1) ^ polynomial if value & 0x80 else value << 1
        table.append(value & 0xFF)
    return tuple(table)


_H2F = _table(0x2F)


def crc8_h2f(data: bytes) -> int:
    """CRC-8 of profile 2: polynomial 0x2F, start and final XOR 0xFF; b"123456789" gives 0xDF."""
    crc = 0xFF
    for byte in data:
        crc = _H2F[crc ^ byte]
    return crc ^ 0xFF


class Protection(Protocol):
    """How a message is protected.

    Attributes
    ----------
    modulus : the counter counts 0 to ``modulus - 1``; 0 where the protection has none.
    shortest : bytes that a payload needs at least.
    """

    @property
    def modulus(self) -> int:
        """One more than the greatest counter."""
        ...

    @property
    def shortest(self) -> int:
        """Bytes that a payload needs at least."""
        ...

    def protect(self, payload: bytearray, counter: int) -> None:
        """Write counter and check value."""
        ...

    def sound(self, payload: bytes) -> bool:
        """Whether the check value, and what else is fixed, is right."""
        ...

    def counter(self, payload: bytes) -> int:
        """Counter of a payload."""
        ...


def _sound(protection: Protection, payload: bytes) -> bool:
    again = bytearray(payload)
    protection.protect(again, protection.counter(payload))
    return again == payload and protection.counter(payload) < max(protection.modulus, 1)


def _both(data_id: int, counter: int) -> bytes:
    return data_id.to_bytes(2, "little")


def _alternating(data_id: int, counter: int) -> bytes:
    return bytes([data_id >> 8 if counter % 2 else data_id & 0xFF])


def _low(data_id: int, counter: int) -> bytes:
    return bytes([data_id & 0xFF])


def _nibble(data_id: int, counter: int) -> bytes:
    return bytes([data_id & 0xFF, 0])


DATA_ID_MODES: dict[str, Callable[[int, int], bytes]] = {
    "both": _both, "alternating": _alternating, "low": _low, "nibble": _nibble,
}  # fmt: skip
"""What of the data id goes into the check value of profile 1 (1A both, 1B alternating, 1C nibble); 11 has two."""
PROFILE_11_MODES = ("both", "nibble")


@dataclass(frozen=True, slots=True)
class Profile1:
    """Profiles 1 and 11: CRC-8 0x1D in the first byte of the header, counter 0..14 in the low nibble of the second.

    With the mode ``nibble`` the high nibble of the second byte holds bits 8 to 11 of the data id.
    """

    data_id: int
    mode: str = "both"
    offset: int = 0
    modulus: int = 15

    @property
    def shortest(self) -> int:
        """Bytes that a payload needs at least."""
        return self.offset + 2

    def protect(self, payload: bytearray, counter: int) -> None:
        """Write counter and check value."""
        at = self.offset
        high = (self.data_id >> 8 & 0x0F) << 4 if self.mode == "nibble" else payload[at + 1] & 0xF0
        payload[at + 1] = high | counter
        rest = bytes(payload[:at] + payload[at + 1 :])
        payload[at] = crc8(DATA_ID_MODES[self.mode](self.data_id, counter) + rest)

    def sound(self, payload: bytes) -> bool:
        """Whether check value and, in its mode, the nibble are right."""
        return _sound(self, payload)

    def counter(self, payload: bytes) -> int:
        """Counter of a payload."""
        return payload[self.offset + 1] & 0x0F


@dataclass(frozen=True, slots=True)
class Profile2:
    """Profile 2: CRC-8 0x2F in byte 0, counter 0..15 in the low nibble of byte 1, one of 16 data ids by the counter."""

    data_ids: bytes
    modulus: int = 16
    shortest: int = 2

    def protect(self, payload: bytearray, counter: int) -> None:
        """Write counter and check value."""
        payload[1] = payload[1] & 0xF0 | counter
        payload[0] = crc8_h2f(bytes(payload[1:]) + self.data_ids[counter : counter + 1])

    def sound(self, payload: bytes) -> bool:
        """Whether the check value is right."""
        return _sound(self, payload)

    def counter(self, payload: bytes) -> int:
        """Counter of a payload."""
        return payload[1] & 0x0F


@dataclass(frozen=True, slots=True)
class Profile5:
    """Profile 5: CRC-16 0x1021 (start 0xFFFF), low byte first, and a counter 0..255 behind it."""

    data_id: int
    offset: int = 0
    modulus: int = 256

    @property
    def shortest(self) -> int:
        """Bytes that a payload needs at least."""
        return self.offset + 3

    def protect(self, payload: bytearray, counter: int) -> None:
        """Write counter and check value."""
        at = self.offset
        payload[at + 2] = counter
        covered = bytes(payload[:at] + payload[at + 2 :]) + self.data_id.to_bytes(2, "little")
        payload[at : at + 2] = binascii.crc_hqx(covered, 0xFFFF).to_bytes(2, "little")

    def sound(self, payload: bytes) -> bool:
        """Whether the check value is right."""
        return _sound(self, payload)

    def counter(self, payload: bytes) -> int:
        """Counter of a payload."""
        return payload[self.offset + 2]


@dataclass(frozen=True, slots=True)
class ToyotaSum:
    """Last byte: sum of length, bytes of the identifier and all bytes before it, modulo 256; no counter."""

    can_id: int
    modulus: int = 0
    shortest: int = 1

    def protect(self, payload: bytearray, counter: int) -> None:
        """Write the check value."""
        payload[-1] = (len(payload) + sum(self.can_id.to_bytes(4, "little")) + sum(payload[:-1])) & 0xFF

    def sound(self, payload: bytes) -> bool:
        """Whether the check value is right."""
        return _sound(self, payload)

    def counter(self, payload: bytes) -> int:
        """None: always 0."""
        return 0


class Sequence:
    """Whether a counter that came makes its frame usable: as `dbc.e2e.Checker` does, with any modulus.

    The first frame, and the first after too many lost ones, only begins a sequence; a repeated counter is never fresh.
    """

    def __init__(self, modulus: int) -> None:
        self._modulus = modulus
        self._last: int | None = None

    def usable(self, counter: int) -> bool:
        """Take the counter of a sound frame."""
        before, self._last = self._last, counter
        return before is not None and 1 <= (counter - before) % self._modulus <= _MAX_LOST + 1
