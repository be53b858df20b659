"""Frame lengths: tables against bit by bit, published check values, bounds."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc.frame_length import FD_LENGTHS, FrameBits
from hil.bus.timed.frame_length import exact_bits, most_bits
from hil.bus.timed.wire import CRC15_POLYNOMIAL, WireFrame, arbitration_key, crc15, stuffed_part

PAGE = Path(__file__).parents[5] / "docs" / "bus-timing.md"


def bits_of(data: bytes) -> list[int]:
    return [byte >> k & 1 for byte in data for k in range(7, -1, -1)]


@st.composite
def classical(draw: st.DrawFn) -> WireFrame:
    extended = draw(st.booleans())
    can_id = draw(st.integers(0, (1 << (29 if extended else 11)) - 1))
    # long runs need more stuff bits than random bytes do
    data = bytes(
        draw(st.lists(st.sampled_from([0, 0xFF, 0x1F, 0x3C, 0x87, 0xE0, 0x42]) | st.integers(0, 255), max_size=8))
    )
    return WireFrame(can_id, data, extended, draw(st.booleans()))


@st.composite
def flexible(draw: st.DrawFn) -> WireFrame:
    one = draw(classical())
    n = draw(st.sampled_from(FD_LENGTHS))
    fill = draw(st.sampled_from([b"\0", b"\xff", b"\x1f\x83", b"\x55", b"\x3c\x3e"]))
    data = (draw(st.binary(max_size=n)) + fill * n)[:n]
    return WireFrame(one.can_id, data, one.extended, fd=True, bit_rate_switch=draw(st.booleans()))


def test_the_check_sequence_is_the_published_one() -> None:
    """CRC-15/CAN of the CRC catalogue: check value of "123456789"."""
    assert crc15(bits_of(b"123456789")) == 0x059E
    assert CRC15_POLYNOMIAL == 0x4599


@settings(max_examples=60, deadline=None)
@given(classical())
def test_tables_count_what_the_wire_carries(frame: WireFrame) -> None:
    assert exact_bits(frame) == FrameBits(len(stuffed_part(frame)) + 13)
    assert exact_bits(frame).nominal <= most_bits(frame).nominal


@settings(max_examples=60, deadline=None)
@given(flexible())
def test_flexible_frames_stuff_up_to_the_data_only(frame: WireFrame) -> None:
    """Behind the data: stuff count 4, check sequence 17 or 21, fixed stuff bits 6 or 7, delimiter, 12 more."""
    fixed = 4 + (17 + 6 if len(frame.data) <= 16 else 21 + 7) + 1 + 12
    exact = exact_bits(frame)
    assert sum(exact) == len(stuffed_part(frame)) + fixed
    assert (exact.data > 0) == frame.bit_rate_switch
    assert sum(exact) <= sum(most_bits(frame))
    assert exact.duration_ns(500_000, 2_000_000) <= most_bits(frame).duration_ns(500_000, 2_000_000)


@pytest.mark.parametrize("data", [b"", bytes(8), b"\xff" * 8])
@pytest.mark.parametrize("can_id", [0, 0x555, 0x7FF])
def test_no_run_of_six_is_sent(can_id: int, data: bytes) -> None:
    sent = "".join(str(bit) for bit, _ in stuffed_part(WireFrame(can_id, data)))
    assert "000000" not in sent
    assert "111111" not in sent


def test_lengths_of_the_bound() -> None:
    assert most_bits(WireFrame(1, bytes(8))) == (135, 0)
    assert most_bits(WireFrame(1, bytes(8), extended=True)) == (160, 0)
    assert most_bits(WireFrame(1, bytes(8), remote=True)) == (55, 0)
    assert sum(most_bits(WireFrame(1, bytes(64), fd=True))) == 17 + 5 + 512 + 133 + 4 + 21 + 7 + 1 + 12


def most_stuff_bits(n: int) -> int:
    """Most stuff bits of any base data frame of ``n`` bytes: exact search over check sequence and run of bits.

    For each value of the check sequence and each run of equal bits the most stuff bits that lead there: one step a
    bit, all choices at once; then the check sequence itself, which is given by then.
    """
    crc = np.arange(1 << 15)
    shifted = crc << 1 & 0x7FFF
    after = [np.where((crc >> 14) ^ bit == 1, shifted ^ CRC15_POLYNOMIAL, shifted) for bit in (0, 1)]
    most = np.full((2, 4, 1 << 15), -1000, np.int16)  # last bit, bits equal to it so far - 1, check sequence
    most[0, 0, 0] = 0  # start of frame: one dominant bit, check sequence 0

    def step(bit: int, now: np.ndarray, to: np.ndarray | None, into: np.ndarray) -> None:
        def take(target: np.ndarray, values: np.ndarray) -> None:
            if to is None:
                np.maximum(target, values, out=target)
            else:  # both choices of a bit are one-to-one on check sequences
                target[to] = np.maximum(target[to], values)

        take(into[bit, 0], now[1 - bit].max(axis=0))
        for run in range(3):
            take(into[bit, run + 1], now[bit, run])
        take(into[1 - bit, 0], now[bit, 3] + 1)

    code = [int(c) for c in f"{n:04b}"]
    for fixed in [None] * 11 + [0, 0, 0] + code + [None] * (8 * n):
        following = np.full_like(most, -1000)
        for bit in (0, 1) if fixed is None else (fixed,):
            step(bit, most, after[bit], following)
        most = following
    for k in range(14, -1, -1):
        following = np.full_like(most, -1000)
        for bit in (0, 1):
            chosen = np.where((crc >> k & 1) == bit, most, -1000)
            step(bit, chosen, None, following)
        most = following
    return int(most.max())


def test_the_bound_of_24_stuff_bits_is_never_reached() -> None:
    """Header and check sequence cannot all be stuffed at once: an exact search over every frame of 8 bytes."""
    most = most_stuff_bits(8)
    print(f"at most {most} of 24 stuff bits, {111 + most} of 135 bits")
    assert 20 <= most < 24


@pytest.mark.slow
def test_the_page_says_how_many_stuff_bits_there_are_at_most() -> None:
    rows = [
        line for line in PAGE.read_text().splitlines() if line.startswith(("| stuff bits at most", "| frame at most"))
    ]
    most = [most_stuff_bits(n) for n in range(9)]
    assert [[int(word) for word in row.split("|")[2:-1]] for row in rows] == [
        most,
        [47 + 8 * n + stuff_bits for n, stuff_bits in enumerate(most)],
    ]


def test_arbitration_is_by_bits() -> None:
    base, remote = WireFrame(0x123), WireFrame(0x123, remote=True)
    extended = WireFrame(0x123 << 18, extended=True)
    higher, lower = WireFrame((0x123 << 18) - 1, extended=True), WireFrame(0x124)
    order = [higher, base, remote, extended, extended._replace(remote=True), lower]
    keys = [arbitration_key(frame) for frame in order]
    assert keys == sorted(set(keys))


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        (WireFrame(0x800), "11 bits"),
        (WireFrame(1 << 29, extended=True), "29 bits"),
        (WireFrame(1, bytes(9)), "at most 8"),
        (WireFrame(1, bytes(9), fd=True), "12"),
        (WireFrame(1, bytes(65), fd=True), "at most 64"),
        (WireFrame(1, fd=True, remote=True), "no remote"),
        (WireFrame(1, bit_rate_switch=True), "no bit rate switch"),
    ],
)
def test_what_no_bus_carries_is_refused(frame: WireFrame, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        frame.check()
