"""How many bits a frame takes at most, whatever its identifier and data: with all stuff bits it may need.

A classical frame takes 47 + 8 n + floor((34 + 8 n - 1) / 4) bits, 67 and 54 with an extended identifier (Tindell
1994; Davis et al. 2007). A CAN FD frame has four bits of stuff count, a check sequence of 17 or 21 bits and 6 or 7
fixed stuff bits; bits are stuffed up to the end of the data only (ISO 11898-1:2015). Three bits of pause are counted
with every frame.
"""

from typing import NamedTuple

FD_LENGTHS: tuple[int, ...] = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Numbers of data bytes that a CAN FD frame can have."""

FD_TAIL = 12  # acknowledge, its delimiter, end of frame, pause: at the nominal bit rate


class FrameBits(NamedTuple):
    """Bits of a frame at the nominal bit rate, and those that a bit rate switch sends at the data bit rate."""

    nominal: int
    data: int = 0

    def duration_ns(self, bit_rate: int, data_bit_rate: int | None = None) -> int:
        """Time on the bus, ns, rounded up; without a data bit rate there is no switch."""
        fast_ns: int = -(-self.data * 1_000_000_000 // (data_bit_rate or bit_rate))
        slow_ns: int = -(-self.nominal * 1_000_000_000 // bit_rate)
        return slow_ns + fast_ns


def most_classical_bits(extended: bool, n: int) -> FrameBits:
    """Bits of a classical frame of ``n`` data bytes (a remote frame has none)."""
    stuffed = (54 if extended else 34) + 8 * n
    return FrameBits(stuffed + 13 + (stuffed - 1) // 4)


def most_fd_bits(extended: bool, n: int) -> FrameBits:
    """Bits of a CAN FD frame of ``n`` data bytes; BRS itself counts as nominal, the delimiter of the check sequence as
    data bits."""
    head = 36 if extended else 17
    data = 5 + 8 * n
    behind = 4 + (21 + 7 if n > 16 else 17 + 6) + 1
    in_head = (head - 1) // 4
    return FrameBits(head + in_head + FD_TAIL, data + (head + data - 1) // 4 - in_head + behind)


def fd_length(n: int) -> int:
    """Data bytes that a CAN FD frame has which is to carry ``n``; ValueError above 64."""
    for length in FD_LENGTHS:
        if length >= n:
            return length
    raise ValueError(f"{n} data bytes; a CAN FD frame carries at most 64")
