"""Diagnostic trouble codes as people write them (SAE J2012, ISO 15031-6), and the bits of their status."""

import re

from hil.errors import BrakebenchError
from hil.uds.names import STATUS_BITS

ALL_CODES = 0xFFFFFF
_LETTERS = "PCBU"  # powertrain, chassis, body, network: bits 23 and 22
_WRITTEN = re.compile(r"([PCBU])([0-3])([0-9A-F]{3})(?:-?([0-9A-F]{2}))?", re.IGNORECASE)


def dtc_text(number: int) -> str:
    """Return a code of three bytes as ``C1001-1F``: letter, four digits, failure type byte.

    >>> dtc_text(0x510087)
    'C1100-87'
    """
    code = number >> 8 & 0xFFFF
    return f"{_LETTERS[code >> 14]}{code >> 12 & 3:X}{code & 0xFFF:03X}-{number & 0xFF:02X}"


def dtc_number(text: str) -> int:
    """Return a code of three bytes from ``C1001-1F`` (``C1001``: failure type 0) or a number such as 0x50011F.

    Raises
    ------
    BrakebenchError : neither of both.
    """
    match = _WRITTEN.fullmatch(text.strip())
    if match is not None:
        letter, digit, rest, kind = match.groups()
        code = _LETTERS.index(letter.upper()) << 14 | int(digit) << 12 | int(rest, 16)
        return code << 8 | int(kind or "0", 16)
    try:
        number = int(text, 0)
    except ValueError:
        number = -1
    if not 0 <= number <= ALL_CODES:
        raise BrakebenchError(f"{text!r} is no trouble code; give C1001-00 or a number of three bytes, 0x500100")
    return number


def obd_text(number: int) -> str:
    """Return a code of two bytes, as OBD services give them."""
    return dtc_text(number << 8).removesuffix("-00")


def status_text(status: int) -> str:
    """Return the bits of a status byte in words; ``none`` where none is set."""
    return ", ".join(words for bit, words in enumerate(STATUS_BITS) if status >> bit & 1) or "none"
