"""Exact length of a frame, with the stuff bits and the check sequence that its own bits ask for.

A byte at a time, by tables: what eight bits add to the check sequence, how many stuff bits they need, and in which run
of equal bits they end. `hil.bus.timed.wire.stuffed_part` says the same bit by bit.
"""

from collections.abc import Callable
from functools import lru_cache

from dbc.frame_length import FD_TAIL, FrameBits, most_classical_bits, most_fd_bits
from hil.bus.timed.wire import CRC15_POLYNOMIAL, WireFrame, crc15, head_bits

Length = Callable[[WireFrame], FrameBits]
"""Gives the bits of a frame on the bus, with the three bits of pause behind it."""

PAUSE = 3  # intermission, bits
_CLASSICAL_END = 13  # delimiter of the check sequence, acknowledge, its delimiter, end of frame, pause
_STATES = 8  # value of the last bit * 4 + bits equal to it so far - 1
_IDLE = 4  # a recessive bit: the start of frame begins a run of its own


def _stuffing(state: int, bits: list[int]) -> tuple[int, int]:
    """Stuff bits that ``bits`` need behind a state, and the state they leave."""
    last, run = divmod(state, 4)
    run += 1
    stuffed = 0
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            last, run = 1 - bit, 1
            stuffed += 1
    return stuffed, last * 4 + run - 1


def _stuff_table(count: int) -> list[list[int]]:
    """By state and the value of ``count`` bits: stuff bits * 8 + next state."""
    table = []
    for state in range(_STATES):
        row = []
        for value in range(1 << count):
            stuffed, after = _stuffing(state, [value >> k & 1 for k in range(count - 1, -1, -1)])
            row.append(stuffed * _STATES + after)
        table.append(row)
    return table


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        crc = byte << 7
        for _ in range(8):
            crc = crc << 1 & 0x7FFF ^ (CRC15_POLYNOMIAL if crc & 0x4000 else 0)
        table.append(crc)
    return table


_CRC = _crc_table()
_STUFF_8 = _stuff_table(8)
_STUFF_7 = _stuff_table(7)


@lru_cache(maxsize=4096)
def _classical_head(can_id: int, extended: bool, remote: bool, n: int) -> tuple[int, int, int, int]:
    """Check sequence, state and stuff bits behind the length code; all other bits of the frame but data."""
    bits = head_bits(WireFrame(can_id, bytes(n), extended, remote))
    stuffed, state = _stuffing(_IDLE, bits)
    return crc15(bits), state, stuffed, len(bits) + 15 + _CLASSICAL_END


@lru_cache(maxsize=4096)
def _fd_head(frame: WireFrame) -> tuple[int, int, int, int]:
    """State behind the length code; stuff bits before and behind the switch; nominal bits without stuff bits."""
    bits = head_bits(frame)
    switch = len(bits) - 5  # behind BRS come ESI and the length code
    before, state = _stuffing(_IDLE, bits[: switch - 1])
    behind, state = _stuffing(state, bits[switch - 1 :])
    return state, before, behind, switch + FD_TAIL


def exact_bits(frame: WireFrame) -> FrameBits:
    """Bits of a frame on the bus, exactly, with the three bits of pause behind it."""
    data = frame.data
    if frame.fd:
        return _exact_fd_bits(frame)
    crc, state, stuffed, bits = _classical_head(frame.can_id, frame.extended, frame.remote, len(data))
    if not frame.remote:
        bits += 8 * len(data)
        for byte in data:
            crc = (crc << 8 & 0x7FFF) ^ _CRC[crc >> 7 ^ byte]
            packed = _STUFF_8[state][byte]
            state = packed & 7
            stuffed += packed >> 3
    packed = _STUFF_8[state][crc >> 7]
    return FrameBits(bits + stuffed + (packed >> 3) + (_STUFF_7[packed & 7][crc & 0x7F] >> 3))


def _exact_fd_bits(frame: WireFrame) -> FrameBits:
    data = frame.data
    state, before, behind, nominal = _fd_head(frame._replace(data=bytes(len(data))))
    for byte in data:
        packed = _STUFF_8[state][byte]
        state = packed & 7
        behind += packed >> 3
    last = data[-1] & 1 if data else head_bits(frame)[-1]
    if state == 4 * (1 - last):  # a stuff bit behind the last bit, where a fixed one stands instead
        behind -= 1
    check = 4 + (21 + 7 if len(data) > 16 else 17 + 6) + 1
    return _switched(frame, FrameBits(nominal + before, 5 + 8 * len(data) + behind + check))


def most_bits(frame: WireFrame) -> FrameBits:
    """Bits that a frame of this kind and length takes at most."""
    n = len(frame.data)
    if frame.fd:
        return _switched(frame, most_fd_bits(frame.extended, n))
    return most_classical_bits(frame.extended, 0 if frame.remote else n)


def _switched(frame: WireFrame, bits: FrameBits) -> FrameBits:
    return bits if frame.bit_rate_switch else FrameBits(bits.nominal + bits.data)
