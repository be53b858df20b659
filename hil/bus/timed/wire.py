"""A frame as the wire carries it, bit for bit (ISO 11898-1:2015, 10.4)."""

from typing import NamedTuple

from dbc.frame_length import fd_length

CRC15_POLYNOMIAL = 0x4599
BASE_HEAD, EXTENDED_HEAD = 19, 39  # bits from start of frame to the end of the length code, without stuff bits


class WireFrame(NamedTuple):
    """Any frame of a CAN bus.

    Attributes
    ----------
    can_id : 11-bit identifier, or 29-bit where ``extended``.
    data : payload; of a CAN FD frame one of its lengths, else 0 to 8 bytes. A remote frame sends none of it: its
        length is the length asked for.
    remote : remote frame (classical only).
    fd, bit_rate_switch : CAN FD frame, with its data at the data bit rate; ESI is dominant.
    """

    can_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    fd: bool = False
    bit_rate_switch: bool = False

    def check(self) -> None:
        """Refuse (ValueError) what no bus can carry."""
        bits = 29 if self.extended else 11
        if not 0 <= self.can_id < 1 << bits:
            raise ValueError(f"identifier {self.can_id:#x}; expected {bits} bits")
        if self.fd and self.remote:
            raise ValueError(f"frame {self.can_id:#x}: CAN FD has no remote frames")
        if self.bit_rate_switch and not self.fd:
            raise ValueError(f"frame {self.can_id:#x}: a classical frame has no bit rate switch")
        n = len(self.data)
        if n > 8 and not self.fd:
            raise ValueError(f"frame {self.can_id:#x}: {n} data bytes; a classical frame carries at most 8")
        if self.fd and fd_length(n) != n:
            raise ValueError(f"frame {self.can_id:#x}: {n} data bytes; the next length of CAN FD is {fd_length(n)}")


def arbitration_key(frame: WireFrame) -> int:
    """Bits of the arbitration field as a number: the least wins, as dominant bits are 0.

    Behind the first eleven, a base frame has RTR and a dominant IDE, an extended one a recessive SRR and IDE: of equal
    beginnings the base data frame wins, then the base remote frame.
    """
    if frame.extended:
        base, rest = frame.can_id >> 18, frame.can_id & 0x3FFFF
        return base << 21 | 0b11 << 19 | rest << 1 | frame.remote
    return frame.can_id << 21 | frame.remote << 20


def length_code(frame: WireFrame) -> int:
    """Data length code (DLC)."""
    n = len(frame.data)
    return n if n <= 8 else {12: 9, 16: 10, 20: 11, 24: 12, 32: 13, 48: 14, 64: 15}[n]


def head_bits(frame: WireFrame) -> list[int]:
    """Bits from start of frame to the end of the length code."""
    if frame.extended:
        bits = [0, *_bits(frame.can_id >> 18, 11), 1, 1, *_bits(frame.can_id & 0x3FFFF, 18)]
    else:
        bits = [0, *_bits(frame.can_id, 11)]
    if frame.fd:  # RRS, (IDE,) FDF, res, BRS, ESI
        bits += [0, *([] if frame.extended else [0]), 1, 0, int(frame.bit_rate_switch), 0]
    else:  # RTR, IDE or r1, r0
        bits += [int(frame.remote), 0, 0]
    return bits + _bits(length_code(frame), 4)


def crc15(bits: list[int]) -> int:
    """Check sequence of a classical frame over the bits before it."""
    crc = 0
    for bit in bits:
        feedback = bit ^ crc >> 14
        crc = crc << 1 & 0x7FFF ^ (CRC15_POLYNOMIAL if feedback else 0)
    return crc


def stuffed_part(frame: WireFrame) -> list[tuple[int, bool]]:
    """Bits from start of frame to the end of the check sequence of a classical frame, of the data of a CAN FD frame.

    Returns
    -------
    Each bit with whether it is a stuff bit. Behind the last data bit of CAN FD comes a fixed stuff bit, never a
    dynamic one.
    """
    bits = head_bits(frame)
    if not frame.remote:
        bits += [bit for byte in frame.data for bit in _bits(byte, 8)]
    if not frame.fd:
        bits += _bits(crc15(bits), 15)
    sent: list[tuple[int, bool]] = []
    last, run = 1, 0
    for index, bit in enumerate(bits):
        run = run + 1 if bit == last else 1
        last = bit
        sent.append((bit, False))
        if run == 5 and not (frame.fd and index == len(bits) - 1):
            last, run = 1 - bit, 1
            sent.append((last, True))
    return sent


def _bits(value: int, count: int) -> list[int]:
    return [value >> k & 1 for k in range(count - 1, -1, -1)]
