"""How long a frame takes the bus: its bits, with all stuff bits it may need.

A classical frame takes 47 + 8 n + floor((34 + 8 n - 1) / 4) bits, 67 and 54 with an extended identifier (Tindell
1994; Davis et al. 2007). A CAN FD frame has four bits of stuff count, a check sequence of 17 or 21 bits and 6 or 7
fixed stuff bits; bits are stuffed up to the end of the data only (ISO 11898-1:2015). Three bits of pause are counted
with every frame.
"""

import numpy as np
import numpy.typing as npt

from hil.log.frames import FrameFlag

KINDS = 8  # extended * 4 + 0 data, 1 remote, 2 CAN FD, 3 CAN FD with a second bit rate
_END = 12  # acknowledge, its delimiter, end of frame, pause


def _classical(extended: bool, n: int) -> int:
    stuffed = (54 if extended else 34) + 8 * n
    return stuffed + 13 + (stuffed - 1) // 4


def _flexible(extended: bool, n: int) -> tuple[int, int]:
    head = 36 if extended else 17
    data = 5 + 8 * n
    behind = 4 + (21 + 7 if n > 16 else 17 + 6) + 1
    in_head = (head - 1) // 4
    return head + in_head + _END, data + (head + data - 1) // 4 - in_head + behind


def _table() -> npt.NDArray[np.int64]:
    bits = np.zeros((KINDS, 65, 2), np.int64)
    for extended in (False, True):
        for n in range(65):
            first = 4 * extended
            slow, fast = _flexible(extended, n)
            bits[first, n] = _classical(extended, min(n, 8)), 0
            bits[first + 1, n] = _classical(extended, 0), 0
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
