"""How the passes over bytes are compiled: once, kept on disk, and the same source runs uncompiled for debugging.

Numba's cache looks at the age of one file only, so a pass and what it calls stand in one module, or what it calls is
imported from here.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit

F = TypeVar("F", bound=Callable[..., Any])
Decorator = Callable[[F], F]

compiled = cast(Decorator[Any], njit(cache=True, nogil=True, error_model="numpy"))
"""For a pass that Python calls."""
inlined = cast(Decorator[Any], njit(inline="always", error_model="numpy"))
"""For what such a pass calls."""

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
