"""How the passes over bytes are compiled: once, kept on disk, and the same source runs uncompiled for debugging.

Numba's cache looks at the age of one file only, so a pass and what it calls stand in one module, or what it calls is
imported from here.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numba.core import event

from dbc.compile_cache import cached
from hil.log.compiling import listeners

F = TypeVar("F", bound=Callable[..., Any])
Decorator = Callable[[F], F]

compiled = cast(Decorator[Any], cached)
"""For a pass that Python calls."""
inlined = cast(Decorator[Any], njit(error_model="numpy"))
"""For what such a pass calls; LLVM puts it in place (faster here than Numba's own ``inline="always"``, by a half)."""


class _Told(event.Listener):
    """Passes on that a compilation begins; what comes from the cache on disk is none."""

    def on_start(self, event: event.Event) -> None:
        for tell in listeners:
            tell()

    def on_end(self, event: event.Event) -> None:
        pass


cast(Any, event).register("numba:compile", _Told())

NO_DIGIT = 16
HEX = np.full(256, NO_DIGIT, np.uint8)
"""Value of a hexadecimal digit, by its byte; `NO_DIGIT` for all other bytes."""
for _value, _letter in enumerate(b"0123456789ABCDEF"):
    HEX[_letter] = _value
    HEX[ord(chr(_letter).lower())] = _value

NO_BYTE = 256
PAIRS = np.full(65_536, NO_BYTE, np.uint16)
"""Value of two hexadecimal digits, by the first byte and 256 times the second; `NO_BYTE` for all other pairs."""
_first, _second = np.meshgrid(np.arange(256), np.arange(256))
_both = (HEX[_first] < NO_DIGIT) & (HEX[_second] < NO_DIGIT)
PAIRS[(_first + 256 * _second)[_both]] = (16 * HEX[_first].astype(np.uint16) + HEX[_second])[_both]

_FIRST_NIBBLES, _SECOND_NIBBLES = np.uint64(0xF0F0F0F0F0F0F0F0), np.uint64(0x0F0F0F0F0F0F0F0F)
_DIGITS, _SIX = np.uint64(0x3030303030303030), np.uint64(0x0606060606060606)
_TENS, _THOUSANDS = np.uint64(0x00FF00FF00FF00FF), np.uint64(0x0000FFFF0000FFFF)
_EIGHT, _SIXTEEN, _HALF, _LOW = np.uint64(8), np.uint64(16), np.uint64(32), np.uint64(0xFFFFFFFF)
_TEN, _HUNDRED, _TEN_THOUSAND = np.uint64(10), np.uint64(100), np.uint64(10_000)


@inlined
def word(buffer, p):
    """Eight bytes as one number, the first one lowest: one load, where the compiler sees that no index is negative."""
    at = np.uint64(p)
    value = np.uint64(0)
    for k in range(8):
        value |= np.uint64(buffer[at + np.uint64(k)]) << np.uint64(8 * k)
    return value


@inlined
def are_digits(value):
    """Whether the eight bytes of a `word` are decimal digits."""
    if value & _FIRST_NIBBLES != _DIGITS:
        return False
    return (value + _SIX) & _FIRST_NIBBLES == _DIGITS


@inlined
def of_digits(value):
    """Value of eight decimal digits."""
    value &= _SECOND_NIBBLES
    value = (value * _TEN + (value >> _EIGHT)) & _TENS
    value = (value * _HUNDRED + (value >> _SIXTEEN)) & _THOUSANDS
    return np.int64((value * _TEN_THOUSAND + (value >> _HALF)) & _LOW)


@inlined
def byte_of(buffer, p):
    """Value of two hexadecimal digits; `NO_BYTE` and more for what is none."""
    at = np.uint64(p)
    return np.int64(PAIRS[np.int64(buffer[at]) | np.int64(buffer[at + np.uint64(1)]) << 8])


@inlined
def ends(byte):
    """Whether a byte ends a word: a blank, a tabulator, the end of the line."""
    return byte == 32 or byte == 10 or byte == 13 or byte == 9
