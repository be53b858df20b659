"""Messages of diagnostics in frames: joined, answered, found by themselves; whatever is lost is counted."""

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from uds_logs import MS, exchange, table_of

from dbc.isotp import LinkError, segment
from hil.errors import BrakebenchError
from hil.log.frames import FrameTable
from hil.uds.addresses import Addresses, Identifier, standard_partner
from hil.uds.conversation import NO_FIRST, NO_ISOTP, Conversation
from hil.uds.find_pairs import PairFinder
from hil.uds.known import Did, Names
from hil.uds.own import names_of
from hil.uds.words import Kind

VIN_REQUEST, VIN = b"\x22\xf1\x90", b"\x62\xf1\x90WAUZZZ4M1HA000001"
STANDARD = Addresses.of([])


def read(frames, addresses=STANDARD, **more):
    conversation = Conversation(addresses, **more)
    table = table_of(frames)
    halves = [table.take(slice(0, len(frames) // 2)), table.take(slice(len(frames) // 2, None))]
    return [one for part in conversation.messages(halves) for one in part], conversation.counts


def found(frames):
    finder = PairFinder()
    finder.take([table_of(frames)])
    return [(str(request), str(answer)) for request, answer in finder.pairs()]


PAIRS = {"standard": (0x7E0, 0x7E8), "fixed": (0x18DA10F1, 0x18DAF110)}


@pytest.mark.parametrize("frame_bytes", [8, 12, 64])
@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_requests_and_answers_are_joined(pair, frame_bytes):
    frames = exchange(*pair, VIN_REQUEST, VIN, 0, frame_bytes, padding=0xAA)
    frames += exchange(*pair, b"\x22\x01\x00", b"\x62\x01\x00" + bytes(5000), 50 * MS, frame_bytes)
    messages, counts = read(sorted(frames))
    assert [bytes(m.data[:3]) for m in messages] == [VIN_REQUEST, VIN[:3], b"\x22\x01\x00", b"\x62\x01\x00"]
    assert [m.length for m in messages] == [3, 20, 3, 5003]  # more than 4095: a first frame of 32 bits
    assert [m.identifier.can_id for m in messages] == [*pair, *pair]
    assert [m.after_ns for m in messages] == [None, 10 * MS, None, 10 * MS]
    assert messages[1].said.text.endswith('VIN = "WAUZZZ4M1HA000001"')
    assert counts.whole
    assert sum(counts.frames.values()) == len(frames)
    assert (counts.unanswered, counts.unasked) == (0, 0)


def test_requests_without_an_answer_and_answers_without_a_request():
    frames = [
        (0, 0x7E0, b"\x02\x3e\x80"),  # wants none
        (1 * MS, 0x7E0, b"\x02\x10\x03"),
        (2 * MS, 0x7E0, b"\x03\x22\xf1\x90"),
        (3 * MS, 0x7E8, b"\x03\x7f\x22\x78"),
        (900 * MS, 0x7E8, b"\x03\x7f\x22\x31"),
        (901 * MS, 0x7E8, b"\x02\x7e\x00"),
        (902 * MS, 0x7DF, b"\x02\x3e\x00"),
        (903 * MS, 0x7E8, b"\x02\x7e\x00"),
        (904 * MS, 0x7E9, b"\x02\x7e\x00"),
    ]
    messages, counts = read(frames)
    assert (counts.unanswered, counts.unasked) == (1, 1)
    assert [m.after_ns and m.after_ns // MS for m in messages] == [None, None, None, 1, 898, None, None, 1, 2]
    assert counts.messages == {Kind.REQUEST: 4, Kind.PENDING: 1, Kind.REFUSAL: 1, Kind.ANSWER: 3}


def test_periodic_data_are_told_from_answers():
    known = Names(dids={0xF201: Did("speed", 2, lambda data: f"{data[0]} m/s")})
    frames = exchange(0x7E0, 0x7E8, b"\x2a\x03\x01\x62", b"\x6a", 0)
    frames += [(100 * MS, 0x7E8, b"\x03\x01\x07\x00"), (101 * MS, 0x7E8, b"\x03\x62\x01\x02")]
    frames += exchange(0x7E0, 0x7E8, VIN_REQUEST, VIN, 200 * MS)
    frames += [(250 * MS, 0x7E8, b"\x03\x62\x01\x02")]  # the request of the same first byte is answered
    frames += exchange(0x7E0, 0x7E8, b"\x2a\x04", b"\x6a", 300 * MS)
    frames += [(400 * MS, 0x7E8, b"\x03\x01\x07\x00")]
    messages, _ = read(frames, names_of=lambda *_: known)
    texts = [m.said.text for m in messages]
    assert texts[2:4] == ["periodic data, 0xF201 speed = 7 m/s", "periodic data, 0xF262 = 01 02"]
    assert "WAUZZZ4M1HA000001" in texts[5]
    assert texts[6] == texts[3]
    assert not texts[-1].startswith("periodic data")


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from((0x7E0, 0x7E8, 0x18DA10F1)), st.binary(min_size=1, max_size=120)), max_size=6),
    st.sampled_from((8, 64)),
    st.randoms(use_true_random=False),
)
def test_interleaved_messages_come_back_whole(messages, frame_bytes, rng):
    """Whatever is sent on several identifiers at once, each in its own order, is joined as it was."""
    waiting = {}
    for can_id, message in messages:
        waiting.setdefault(can_id, []).extend(segment(message, frame_bytes))
    frames = []
    while any(waiting.values()):
        can_id = rng.choice([one for one, left in waiting.items() if left])
        frames.append((len(frames) * MS, can_id, waiting[can_id].pop(0)))
    joined, counts = read(frames)
    assert counts.whole
    for can_id in waiting:
        sent = [message for one, message in messages if one == can_id]
        assert [m.data for m in joined if m.identifier.can_id == can_id] == sent


@settings(max_examples=100, deadline=None)
@given(st.lists(st.binary(min_size=1, max_size=200), min_size=1, max_size=4), st.integers(0, 2**32), st.data())
def test_nothing_is_lost_in_silence(messages, seed, data):
    """Frames lost, doubled and swapped: each is in a message that is said, or counted; none is joined wrongly."""
    sent = [frame for message in messages for frame in segment(message)]
    rng, kind = random.Random(seed), data.draw(st.sampled_from(("lost", "doubled", "swapped")))
    k = rng.randrange(len(sent))
    damaged = list(sent)
    if kind == "lost":
        del damaged[k]
    elif kind == "doubled":
        damaged.insert(k, damaged[k])
    else:
        other = rng.randrange(len(sent))
        damaged[k], damaged[other] = damaged[other], damaged[k]
    joined, counts = read([(n * MS, 0x7E8, frame) for n, frame in enumerate(damaged)])
    assert sum(counts.frames.values()) == len(damaged)
    assert sum(counts.messages.values()) + sum(counts.broken.values()) == len(joined)
    if kind == "lost" and sent[k][0] >> 4:  # of a segmented message
        assert not counts.whole
        assert len([m for m in joined if m.error is None]) == len(messages) - 1
    if damaged == sent:
        assert counts.whole
    starts = {frame for message in messages if len(message) > 7 for frame in segment(message)[:1]}
    first = sum(frame in starts for frame in damaged if frame[0] >> 4 == 1)
    single = sum(frame[0] >> 4 == 0 for frame in damaged)
    assert len(joined) == first + single  # every begin is told, complete or not


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 10_000_000_000),
            st.sampled_from((0x7A0, 0x7A8, 0x7A9, 0x7DF, 0x7E8, 0x18DA10F1, 0x100)),
            st.binary(max_size=12).filter(lambda data: len(data) in (*range(9), 12)),
        ),
        max_size=30,
    )
)
def test_any_frames_are_read_without_an_error_and_counted(frames):
    """Whatever stands in a log, stamps that run back included."""
    periodic = Identifier(0x7A9, False)
    pair = Identifier(0x7A0, False), Identifier(0x7A8, False)
    messages, counts = read(frames, Addresses.of([pair], periodic=[periodic]), names_of=lambda _, i: names_of(i))
    assert sum(counts.frames.values()) == sum(can_id != 0x100 for _, can_id, _ in frames)
    assert sum(counts.messages.values()) + sum(counts.broken.values()) == len(messages)
    assert all(message.said.text for message in messages)
    finder = PairFinder()
    finder.take([table_of(frames)])
    assert all(request != answer for request, answer in finder.pairs())


def test_why_a_message_is_incomplete_is_said():
    first, *rest = segment(VIN)
    cases = {
        LinkError.N_WRONG_SN: [first, rest[1]],
        LinkError.N_UNEXP_PDU: [first, rest[0], b"\x03\x7f\x22\x31"],
        LinkError.N_TIMEOUT_CR: [first, rest[0]],
    }
    for error, frames in cases.items():
        joined, counts = read([(n * MS, 0x7E8, data) for n, data in enumerate(frames)])
        assert joined[0].error is error
        assert (joined[0].length, counts.broken[error]) == (20, 1)
        assert VIN.startswith(joined[0].data)
    late = [(0, 0x7E8, first), (1 * MS, 0x7E8, rest[0]), (9000 * MS, 0x7E8, rest[1]), (9001 * MS, 0x7E8, b"\x49\x01")]
    joined, counts = read(late)
    assert joined[0].error is LinkError.N_TIMEOUT_CR
    assert (counts.frames[NO_FIRST], counts.frames[NO_ISOTP]) == (1, 1)
    assert not counts.whole


# ------------------------------------------------------------------------------------------------ identifiers


def test_connections_are_found_by_what_is_said():
    frames = exchange(0x714, 0x77E, b"\x10\x03", b"\x50\x03\x00\x32\x01\xf4", 0, padding=0xAA)
    frames += exchange(0x17FC0076, 0x17FE0076, VIN_REQUEST, VIN, 100 * MS)
    frames += exchange(0x600, 0x601, b"\x31\x01\x02\x03", b"\x7f\x31\x33", 200 * MS)
    frames += exchange(0x7E0, 0x7E8, VIN_REQUEST, VIN, 300 * MS)  # standard: need not be found
    assert found(frames) == [("714", "77E"), ("17FC0076", "17FE0076"), ("600", "601")]


def test_what_is_no_diagnostics_is_not_found():
    rng = np.random.default_rng(5)
    cyclic = [(int(k * MS), 0x100 + k % 40, rng.bytes(8)) for k in range(20_000)]
    assert found(cyclic) == []
    request, answer = (0, 0x300, b"\x03\x22\xf1\x90"), (5 * MS, 0x301, VIN[:3] + b"abcd")
    assert found([request, (5 * MS, 0x301, b"\x07" + answer[2])]) == [("300", "301")]
    others = {
        "another data identifier": (5 * MS, 0x301, b"\x04\x62\xf1\x91a"),
        "too late": (6000 * MS, 0x301, b"\x04\x62\xf1\x90a"),
        "another service": (5 * MS, 0x301, b"\x04\x59\x02\xff\x00"),
        "the same identifier": (5 * MS, 0x300, b"\x04\x62\xf1\x90a"),
    }
    for why, frame in others.items():
        assert found([request, frame]) == [], why
    true = (5 * MS, 0x301, b"\x04\x62\xf1\x90a")
    assert found([request, true, (6 * MS, 0x301, b"\x99\x01")]) == []  # not all its frames are ISO-TP


def test_identifiers_are_told_and_standard():
    told = Addresses.parse(["714:77E", "0x18DA01F1:18DAF101", "700"])
    assert told.partner(Identifier(0x77E, False)) == Identifier(0x714, False)
    assert told.partner(Identifier(0x18DA01F1, True)) == Identifier(0x18DAF101, True)
    assert told.is_functional(Identifier(0x700, False))
    assert told.partner(Identifier(0x7E8, False)) is None  # where identifiers are told only these count
    assert Identifier.parse("0714") == Identifier(0x714, True)
    assert standard_partner(Identifier(0x7E3, False)) == Identifier(0x7EB, False)
    assert standard_partner(Identifier(0x18DBF133, True)) is None
    for wrong in ("7XY:7E8", "20000000:1", ":", "7E0:7E0"):
        with pytest.raises(BrakebenchError, match="identifier"):
            Addresses.parse([wrong])


def test_an_empty_log_has_no_messages():
    conversation = Conversation(STANDARD)
    assert list(conversation.messages([FrameTable.empty()])) == []
    assert conversation.counts.whole
