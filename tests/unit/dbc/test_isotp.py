"""ISO-TP: both directions against can-isotp, and every branch of the state machine in virtual time."""

from collections import deque

import isotp
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc import isotp as ours
from dbc.isotp import FlowStatus, Link, LinkError, flow_control, parse, segment, st_min_ns
from dbc.isotp_log import Reassembler

MS = 1_000_000
LENGTHS = (1, 6, 7, 8, 9, 13, 14, 20, 62, 63, 64, 100, 4095, 4096, 5000)


def other_end(**parameters):
    """can-isotp's stack between two queues; it sends no flow control that asks to wait for its clock."""
    to_them, from_them = deque(), deque()
    address = isotp.Address(isotp.AddressingMode.Normal_11bits, rxid=1, txid=2)
    stack = isotp.TransportLayerLogic(
        rxfn=lambda timeout: isotp.CanMessage(1, data=to_them.popleft()) if to_them else None,
        txfn=lambda message: from_them.append(bytes(message.data)),
        address=address,
        error_handler=pytest.fail,
        params={"blocking_send": False, "max_frame_size": 100_000, **parameters},
    )
    return stack, to_them, from_them


def exchange(link, stack, to_them, from_them, until):
    for tick in range(5000):
        to_them.extend(link.frames(tick * MS))
        stack.process()
        while from_them:
            message = link.take(tick * MS, from_them.popleft())
            if message is not None:
                return message
        if until(stack):
            return bytes(stack.recv())
    raise AssertionError("nothing came")


@pytest.mark.parametrize("frame_bytes", [8, 64])
@pytest.mark.parametrize("block_size", [0, 3])
def test_messages_of_every_length_reach_can_isotp_and_come_back(frame_bytes, block_size):
    link = Link(frame_bytes=frame_bytes, block_size=block_size, most_bytes=100_000)
    stack, to_them, from_them = other_end(
        tx_data_length=frame_bytes, blocksize=block_size, can_fd=frame_bytes > 8, stmin=0
    )
    for n in LENGTHS:
        message = bytes(i * 7 & 0xFF for i in range(n))
        link.send(0, message)
        assert exchange(link, stack, to_them, from_them, lambda s: s.available()) == message
        assert not link.sending
        stack.send(message)
        assert exchange(link, stack, to_them, from_them, lambda s: False) == message
    assert link.errors == []


@settings(max_examples=40, deadline=None)
@given(st.binary(min_size=1, max_size=300), st.sampled_from((8, 12, 64)), st.sampled_from((None, 0x00, 0xAA)))
def test_what_is_segmented_is_joined_by_who_listens(message, frame_bytes, padding):
    joiner = Reassembler()
    frames = segment(message, frame_bytes, padding)
    for k, data in enumerate(frames[:-1]):
        assert joiner.take(k * MS, 0x700, data) == []
    (joined,) = joiner.take(len(frames) * MS, 0x700, frames[-1])
    assert (joined.data, joined.length, joined.error) == (message, len(message), None)
    assert (joined.start_ns, joined.end_ns) == (0 if len(frames) > 1 else MS, len(frames) * MS)
    assert all(len(data) in (*range(9), 12, 16, 20, 24, 32, 48, 64) for data in frames)
    assert padding is None or all(len(data) >= 8 for data in frames)
    assert joiner.end() == []


@pytest.mark.parametrize(
    ("byte", "expected_ns"),
    [
        (0, 0),
        (1, MS),
        (0x7F, 127 * MS),
        (0x80, 127 * MS),
        (0xF0, 127 * MS),
        (0xF1, 100_000),
        (0xF9, 900_000),
        (0xFA, 127 * MS),
        (0xFF, 127 * MS),
    ],
)
def test_separation_times(byte, expected_ns):
    assert st_min_ns(byte) == expected_ns


@pytest.mark.parametrize(
    "text",
    [
        "",
        "00",
        "0801020304050607",
        "02 01",
        "07 010203040506",
        "40 00 00",
        "10 07 010203040506",
        "10 0a 0102030405",
        "10 00 00000fff 0102",
        "20",
        "30 00",
        "01" + "00" * 11,
        "000b" + "00" * 10,
        "103d" + "00" * 62,
    ],
)
def test_frames_that_the_standard_ignores(text):
    assert parse(bytes.fromhex(text)) is None


def test_first_frame_of_32_bit():
    assert parse(bytes.fromhex("1000 00001000 aabb")) == (ours.PduKind.FIRST, 4096, b"\xaa\xbb", 0, 0)


def long_one(n=30, **parameters):
    """A link that has sent its first frame of ``n`` bytes."""
    link = Link(**parameters)
    link.send(0, bytes(n))
    assert len(link.frames(0)) == 1
    return link


def test_block_size_and_separation_time_are_kept():
    link = long_one(6 + 7 * 5)
    assert link.frames(5 * MS) == []
    link.take(5 * MS, flow_control(FlowStatus.CONTINUE, 2, 0xF5))
    assert [len(link.frames(5 * MS + t)) for t in (0, 499_999, 500_000, 10 * MS)] == [1, 0, 1, 0]
    assert link.flow == (2, 0xF5)
    link.take(20 * MS, flow_control(FlowStatus.CONTINUE, 0, 0))
    assert len(link.frames(20 * MS)) == 3
    assert not link.sending


def test_burst_limits_the_frames_of_one_call():
    link = long_one(6 + 7 * 5, burst=2)
    link.take(0, flow_control(FlowStatus.CONTINUE))
    assert [len(link.frames(t)) for t in range(4)] == [2, 2, 1, 0]


def test_waits_are_counted_and_each_one_gives_time():
    link = long_one(most_waits=2)
    for k in range(2):
        link.take((900 + 900 * k) * MS, flow_control(FlowStatus.WAIT))
    assert link.sending
    link.take(1900 * MS, flow_control(FlowStatus.WAIT))
    assert link.errors == [LinkError.N_WFT_OVRN]
    assert not link.sending


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (flow_control(FlowStatus.OVERFLOW), LinkError.N_BUFFER_OVFLW),
        (b"\x33\x00\x00", LinkError.N_INVALID_FS),
    ],
)
def test_a_flow_control_ends_the_message(data, error):
    link = long_one()
    link.take(MS, data)
    assert link.errors == [error]
    assert not link.sending


def test_no_flow_control_in_time():
    link = long_one()
    assert link.frames(1000 * MS) == []
    assert link.sending
    assert link.frames(1001 * MS) == []
    assert link.errors == [LinkError.N_TIMEOUT_BS]
    link.send(1001 * MS, b"\x01")  # goes on
    assert link.frames(1001 * MS) == [b"\x01\x01"]


def test_a_flow_control_that_nobody_asked_for_is_nothing():
    link = Link()
    link.take(0, flow_control(FlowStatus.OVERFLOW))
    assert link.errors == []
    assert link.flow is None


def receiving(n=30, **parameters):
    link = Link(**parameters)
    frames = segment(bytes(range(n)))
    assert link.take(0, frames[0]) is None
    return link, frames


def test_no_consecutive_frame_in_time():
    link, frames = receiving()
    assert link.take(900 * MS, frames[1]) is None
    link.frames(1901 * MS)
    assert link.errors == [LinkError.N_TIMEOUT_CR]
    assert not link.receiving
    assert link.take(1901 * MS, frames[2]) is None


def test_a_wrong_sequence_number_ends_the_message():
    link, frames = receiving()
    link.take(0, frames[1])
    assert link.take(0, frames[1]) is None
    assert link.errors == [LinkError.N_WRONG_SN]
    assert not link.receiving


def test_a_new_message_ends_the_old_one():
    link, frames = receiving()
    assert link.take(0, b"\x01\x3e") == b"\x3e"
    assert link.errors == [LinkError.N_UNEXP_PDU]
    assert link.take(0, frames[1]) is None


def test_too_long_a_message_is_refused_with_overflow():
    link, _ = receiving(100, most_bytes=99)
    assert link.frames(0) == [b"\x32\x00\x00"]
    assert link.errors == [LinkError.N_BUFFER_OVFLW]


def test_short_consecutive_frames_are_ignored_and_the_last_may_be_longer():
    link, frames = receiving(15)
    assert link.take(0, frames[1][:4]) is None
    assert link.take(0, frames[1]) is None
    assert link.take(0, frames[2].ljust(8, b"\xcc")) == bytes(range(15))
    assert link.errors == []


def test_a_listener_tells_why_a_message_is_broken():
    frames = segment(bytes(30))
    joiner = Reassembler()
    joiner.take(0, 1, frames[0])
    joiner.take(0, 2, frames[0])
    (lost,) = joiner.take(MS, 1, frames[2])
    assert (lost.error, lost.length, len(lost.data)) == (LinkError.N_WRONG_SN, 30, 6)
    joiner.take(2 * MS, 1, frames[0])
    broken, single = joiner.take(3 * MS, 1, b"\x01\x3e")
    assert (broken.error, single.error, single.data) == (LinkError.N_UNEXP_PDU, None, b"\x3e")
    (late,) = joiner.take(2001 * MS, 2, frames[1])
    assert (late.error, late.start_ns, late.end_ns) == (LinkError.N_TIMEOUT_CR, 0, 0)
    joiner.take(2002 * MS, 3, frames[0])
    assert [(m.can_id, m.error) for m in joiner.end()] == [(3, LinkError.N_TIMEOUT_CR)]
    assert joiner.take(2003 * MS, 3, b"\x30\x00\x00") == []
