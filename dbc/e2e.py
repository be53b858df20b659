"""End-to-end protection: alive counter, check value, data id.

One definition for sender, checker and log decoder: AUTOSAR E2E profile 1, variant 1A (AUTOSAR CP, Specification of
SW-C End-to-End Communication Protection Library). The first byte is a CRC-8 (polynomial 0x1D, start and final XOR 0)
over the 16-bit data id, low byte first, and every other byte of the payload; a counter 0..14 sits in the low nibble of
the second byte. Status names follow AUTOSAR, which calls the first valid frame INITIAL where `Status` has SYNC. It
protects against faults, not against an attacker.

Recordings exist whose check values were made with start and final XOR 0xFF (CRC-8 SAE J1850): the *legacy* value.
"""

from enum import StrEnum

PROFILE = "AUTOSAR profile 1A"
"""The DBC attribute E2EProfile of a message that is protected as here."""

COUNTER_MODULUS = 15  # counts 0..14; 15 never occurs on the wire
LEGACY = 0xFF
"""Start and final XOR of the legacy check value; those of the profile are 0."""


def _table(polynomial: int) -> tuple[int, ...]:
    table = []
    for value in range(256):
        for _ in range(8):
            value = (value << 1) ^ polynomial if value & 0x80 else value << 1
        table.append(value & 0xFF)
    return tuple(table)


CRC_TABLE = _table(0x1D)
"""CRC-8 of one byte."""


def crc8(data: bytes, start: int = 0) -> int:
    """CRC-8 of ``data``: polynomial 0x1D, ``start``, no final XOR; b"123456789" gives 0x37."""
    crc = start
    for byte in data:
        crc = CRC_TABLE[crc ^ byte]
    return crc


def start_value(data_id: int, legacy: bool = False) -> int:
    """CRC over the data id: where the payload's begins."""
    return crc8(bytes((data_id & 0xFF, data_id >> 8)), LEGACY if legacy else 0)


def check_value(data_id: int, payload: bytes | bytearray, legacy: bool = False) -> int:
    """Check value of a payload whose first byte is left out (it holds the check value itself)."""
    return _continued(start_value(data_id, legacy), payload) ^ (LEGACY if legacy else 0)


def legacy_difference(length: int) -> int:
    """What the legacy check value of a payload of ``length`` bytes differs by (XOR) from the profile's.

    The CRC is linear: the difference depends on nothing but the length, and is 0 for none below 254.
    """
    return crc8(bytes(length + 1), LEGACY) ^ LEGACY


def _continued(crc: int, payload: bytes | bytearray) -> int:
    t = CRC_TABLE
    if len(payload) == 8:  # most are; without the loop it takes two thirds of the time
        _, a, b, c, d, e, f, g = payload
        return t[t[t[t[t[t[t[crc ^ a] ^ b] ^ c] ^ d] ^ e] ^ f] ^ g]
    for byte in payload[1:]:
        crc = t[crc ^ byte]
    return crc


def protect(data_id: int, payload: bytearray, counter: int) -> bytes:
    """Write ``counter`` and the check value into ``payload`` and return it as bytes."""
    payload[1] = (payload[1] & 0xF0) | (counter % COUNTER_MODULUS)
    payload[0] = check_value(data_id, payload)
    return bytes(payload)


class Status(StrEnum):
    """Result of checking one reception (names as in AUTOSAR SWS_E2ELibrary)."""

    OK = "OK"
    OK_SOME_LOST = "OK_SOME_LOST"
    SYNC = "SYNC"  # valid, but the sequence is not established (first frame, or after a break)
    REPEATED = "REPEATED"
    WRONG_SEQUENCE = "WRONG_SEQUENCE"
    WRONG_CRC = "WRONG_CRC"  # wrong check value, counter 15 or wrong length
    NO_NEW_DATA = "NO_NEW_DATA"


_OK = Status.OK  # found faster than the enum's attribute: the way of nearly every frame
USABLE = frozenset({Status.OK, Status.OK_SOME_LOST})


class Checker:
    """Checks the sequence of one message.

    Parameters
    ----------
    data_id : 16-bit data id of the message.
    length : payload length, bytes.
    max_lost : frames that may be missing in a row and still leave the next one usable.
    sync_frames : consecutive frames needed after a break before data is used again.
    """

    def __init__(self, data_id: int, length: int, max_lost: int = 2, sync_frames: int = 1) -> None:
        self._start = start_value(data_id)
        self.length = length
        self.max_lost = max_lost
        self.sync_frames = sync_frames
        self.counter: int | None = None
        self.lost = 0
        self.corrupt = 0
        self._to_sync = 0

    @property
    def in_sequence(self) -> bool:
        """Whether a payload with the next counter is usable."""
        return self.counter is not None and self._to_sync == 0

    def check(self, payload: bytes) -> Status:
        """Check one received payload and remember its counter.

        Only ``OK`` and ``OK_SOME_LOST`` (see ``USABLE``) may be used as fresh data. A shift by a multiple of 15
        frames cannot be seen by a counter 0..14; the receiver's time-out has to.
        """
        counter = COUNTER_MODULUS if len(payload) != self.length else payload[1] & 0x0F
        if counter >= COUNTER_MODULUS or payload[0] != _continued(self._start, payload):
            self.corrupt += 1
            return Status.WRONG_CRC
        if self.counter is None:
            self.counter = counter
            self._to_sync = self.sync_frames
            return Status.SYNC
        delta = (counter - self.counter) % COUNTER_MODULUS
        if delta == 0:
            return Status.REPEATED
        self.counter = counter
        self.lost += delta - 1
        if delta > self.max_lost + 1:
            self._to_sync = self.sync_frames
            return Status.WRONG_SEQUENCE
        if self._to_sync > 0:
            self._to_sync -= 1
            if self._to_sync > 0:
                return Status.SYNC
        return _OK if delta == 1 else Status.OK_SOME_LOST
