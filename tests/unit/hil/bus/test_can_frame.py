import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bus.can_frame import pack_frame
from hil.bus.loopback_wire import MAX_FRAMES, MAX_PACKET, pack_event, pack_header, unpack

VEHICLE = BusName.VEHICLE


@st.composite
def frames(draw, time_ns):
    extended = draw(st.booleans())
    can_id = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
    return Frame(VEHICLE, can_id, draw(st.binary(max_size=8)), time_ns, extended)


def packet(sequence, frames, time_ns=0):
    return pack_header(len(frames), sequence, time_ns) + b"".join(pack_frame(frame, VEHICLE) for frame in frames)


@given(st.data(), st.integers(0, 2**63 - 1), st.integers(0, 2**64 - 1))
def test_packing_and_unpacking_keeps_all(data, time_ns, sequence):
    sent = data.draw(st.lists(frames(time_ns), max_size=MAX_FRAMES))
    packed = packet(sequence, sent, time_ns)
    assert len(packed) <= MAX_PACKET
    assert unpack(packed, VEHICLE) == (sequence, sent)


GOOD = packet(7, [Frame(VEHICLE, 0x123, b"abc"), Frame(VEHICLE, 0x1234567, b"12345678", 0, True)])


@given(st.binary(max_size=200))
@example(b"")
@example(GOOD[:-1])
@example(GOOD + b"\0")
@example(GOOD[:24])
@example(pack_header(0, 0, -1))
@example(pack_header(MAX_FRAMES + 1, 0, 0) + bytes(16 * (MAX_FRAMES + 1)))
@example(pack_header(1, 0, -1) + bytes(16))
@example(pack_header(1, 0, 0) + b"\0\0\0\0\x09" + bytes(11))
@example(pack_header(1, 0, 0) + b"\0\x08\0\0" + bytes(12))
@example(pack_header(1, 0, 0) + b"\0\0\0\x20" + bytes(12))
@example(pack_header(1, 0, 0) + b"\0\0\0\xa0" + bytes(12))
def test_a_strangers_packet_is_none(content):
    assert unpack(content, VEHICLE) is None


@given(st.integers(0, len(GOOD) * 8 - 1))
def test_a_bit_flip_is_refused_or_gives_valid_frames(bit):
    mutant = bytearray(GOOD)
    mutant[bit // 8] ^= 1 << bit % 8
    content = unpack(bytes(mutant), VEHICLE)
    if content is not None:
        for frame in content[1]:
            pack_frame(frame, VEHICLE)  # raises on what is not one


def test_the_boundaries_of_a_frame():
    for frame in (Frame(VEHICLE, 0x7FF, bytes(8)), Frame(VEHICLE, 0x1FFFFFFF, b"", 0, True)):
        assert len(pack_frame(frame, VEHICLE)) == 16
    for frame in (Frame(VEHICLE, 0x800, b""), Frame(VEHICLE, 0x20000000, b"", 0, True), Frame(VEHICLE, 0, bytes(9))):
        with pytest.raises(ValueError, match="cannot send"):
            pack_frame(frame, VEHICLE)


@pytest.mark.parametrize("state", LinkState)
@pytest.mark.parametrize("number", [1, 371])
def test_link_events_pass_among_frames(state, number):
    frame = Frame(VEHICLE, 0x123, b"\x01", 5)
    records = [pack_frame(frame, VEHICLE), pack_event(LinkEvent(VEHICLE, state, 5, number, "of any kind"))]
    packet = pack_header(2, 9, 5) + b"".join(records)
    sequence, (first, event) = unpack(packet, VEHICLE)
    assert (sequence, first) == (9, frame)
    assert (event.state, event.number, event.time_ns, event.bus) == (state, number, 5, VEHICLE)
