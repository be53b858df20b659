"""How long a frame takes the bus: its bits, with all stuff bits it may need (`dbc.frame_length`), as a table."""

import numpy as np
import numpy.typing as npt

from dbc.frame_length import most_classical_bits, most_fd_bits
from hil.log.frames import FrameFlag

KINDS = 8  # extended * 4 + 0 data, 1 remote, 2 CAN FD, 3 CAN FD with a second bit rate


def _table() -> npt.NDArray[np.int64]:
    bits = np.zeros((KINDS, 65, 2), np.int64)
    for extended in (False, True):
        for n in range(65):
            first = 4 * extended
            slow, fast = most_fd_bits(extended, n)
            bits[first, n] = most_classical_bits(extended, min(n, 8))
            bits[first + 1, n] = most_classical_bits(extended, 0)
            bits[first + 2, n] = slow + fast, 0
            bits[first + 3, n] = slow, fast
    return bits


BITS = _table()
"""Bits by kind and data bytes, int64 (8, 65, 2): at the bit rate, at the data bit rate."""


def kinds(extended: npt.NDArray[np.bool_], flags: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """First index of `BITS` of each frame."""
    switched = (flags & FrameFlag.BIT_RATE_SWITCH) != 0
    form = np.where(flags & FrameFlag.REMOTE, 1, np.where(flags & FrameFlag.FD, 2 + switched, 0))
    return np.asarray(4 * extended.astype(np.int64) + form, np.int64)
