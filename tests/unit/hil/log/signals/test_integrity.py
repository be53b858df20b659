from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc import e2e
from dbc.contract import contract, database_text
from dbc.database import parse_database
from dbc.frame import BusName
from hil.log.builder import FrameBuilder
from hil.log.frames import FrameFlag
from hil.log.signals.integrity import Integrity, IntegrityCounter, check_frames, check_integrity, has_profile_layout

PROTECTED = [spec for bus in BusName for spec in contract(bus).by_id.values() if spec.data_id is not None]


def payload(spec, counter, fill=0x5A):
    return e2e.protect(spec.data_id, bytearray([fill] * spec.length), counter)


def legacy(spec, counter, fill=0x5A):
    data = bytearray(payload(spec, counter, fill))
    data[0] = e2e.check_value(spec.data_id, data, legacy=True)
    return bytes(data)


def recording(frames):
    """frames: (spec, data)."""
    builder = FrameBuilder()
    for i, (spec, data) in enumerate(frames):
        assert builder.add(i * 10_000_000, spec.bus.value, spec.can_id, False, data, FrameFlag(0), 0)
    return builder.recording(Path("memory"), "candump")


@pytest.mark.parametrize("spec", PROTECTED, ids=lambda spec: spec.name)
def test_a_flawless_run(spec):
    frames = [(spec, payload(spec, i, i)) for i in range(50)]
    assert check_integrity(recording(frames)) == {spec.name: Integrity(50, 0, 0, 0)}


@pytest.mark.parametrize(
    ("counters", "expected"),
    [
        ([0, 1, 1, 2], Integrity(4, 0, 1, 0)),
        ([13, 14, 1, 2], Integrity(4, 0, 0, 1)),
        ([0, 9], Integrity(2, 0, 0, 8)),
        ([3, 2], Integrity(2, 0, 0, 13)),
        ([3, 3 + 15], Integrity(2, 0, 1, 0)),  # a shift of 15 looks like a repetition
    ],
)
def test_counters(counters, expected):
    spec = PROTECTED[0]
    assert check_integrity(recording([(spec, payload(spec, c)) for c in counters])) == {spec.name: expected}


def test_wrong_check_value_length_counter_and_data_id_are_corrupt():
    spec, other = PROTECTED[:2]
    good = payload(spec, 1)
    wrong = [
        bytes([good[0] ^ 1]) + good[1:],
        good[:-1] + bytes([good[-1] ^ 0x80]),
        good[:-1],
        payload(other, 1),
    ]
    counter_15 = bytearray(good)
    counter_15[1] |= 0x0F
    counter_15[0] = e2e.check_value(spec.data_id, counter_15)
    frames = [(spec, data) for data in [payload(spec, 0), *wrong, bytes(counter_15), payload(spec, 1)]]
    assert check_integrity(recording(frames)) == {spec.name: Integrity(7, 5, 0, 0)}


@settings(max_examples=60)
@given(st.sampled_from(PROTECTED), st.lists(st.tuples(st.integers(0, 15), st.booleans()), max_size=40))
def test_counts_equal_the_receivers_own(spec, sent):
    checker = e2e.Checker(spec.data_id, spec.length)
    frames, repeated = [], 0
    for counter, damaged in sent:
        data = bytearray(payload(spec, 0))
        data[1] = (data[1] & 0xF0) | counter
        data[0] = e2e.check_value(spec.data_id, data) ^ damaged
        frames.append((spec, bytes(data)))
        repeated += checker.check(bytes(data)) is e2e.Status.REPEATED
    expected = {spec.name: Integrity(len(sent), checker.corrupt, repeated, checker.lost)} if sent else {}
    assert check_integrity(recording(frames)) == expected


def columns(payloads, width=8):
    data = np.zeros((len(payloads), width), np.uint8)
    for row, one in zip(data, payloads, strict=True):
        row[: len(one)] = list(one)
    return data, np.array([len(one) for one in payloads], np.uint8)


@settings(max_examples=100)
@given(st.data())
def test_any_message_in_any_chunks_equals_the_receivers_own(data):
    data_id, length = data.draw(st.integers(0, 0xFFFF)), data.draw(st.integers(2, 64))
    checker = e2e.Checker(data_id, length)
    payloads, repeated = [], 0
    for seed, damage in data.draw(st.lists(st.tuples(st.integers(0, 2**32), st.sampled_from([0, 0, 0, 1, 0x80])))):
        one = np.random.default_rng(seed).bytes(length + (seed % 50 == 0) - (seed % 50 == 1))
        if len(one) > 1:
            one = bytes([e2e.check_value(data_id, one) ^ damage]) + one[1:]
        payloads.append(one)
        repeated += checker.check(one) is e2e.Status.REPEATED
    frames, lengths = columns(payloads, 65 + length % 2)
    counter = IntegrityCounter(data_id, length)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(payloads)), max_size=4)))
    for start, end in zip([0, *cuts], [*cuts, len(payloads)], strict=True):
        counter.add(frames[start:end], lengths[start:end])
    result = counter.result
    assert result == Integrity(len(payloads), checker.corrupt, repeated, checker.lost, result.legacy)
    assert result == check_frames(frames, lengths, data_id, length)
    assert result == check_frames(np.asfortranarray(frames), lengths, data_id, length)


def test_a_table_too_narrow_for_the_message_has_corrupt_frames_only():
    frames, lengths = columns([bytes(8)] * 3)
    assert check_frames(frames, lengths, 1, 12) == Integrity(3, 3, 0, 0)


@pytest.mark.parametrize(("data_id", "length"), [(-1, 8), (0x10000, 8), (1, 1), (1, 65)])
def test_impossible_messages_are_refused(data_id, length):
    with pytest.raises(ValueError, match="expected a data id"):
        IntegrityCounter(data_id, length)


@pytest.mark.parametrize("spec", PROTECTED, ids=lambda spec: spec.name)
def test_an_older_recording_is_told_as_such_and_checked_by_its_own_value(spec):
    old = recording([(spec, legacy(spec, i, i)) for i in (0, 1, 1, 2, 5)])
    found = check_integrity(old)
    assert found == {spec.name: Integrity(5, 5, 0, 0, 5)}
    assert found[spec.name].is_legacy
    found = check_integrity(old, legacy=True)
    assert found == {spec.name: Integrity(5, 0, 1, 2)}
    assert not found[spec.name].is_legacy


def test_a_damaged_recording_is_no_older_one():
    spec = PROTECTED[0]
    damaged = [bytes([payload(spec, i)[0] ^ 1 << i % 8]) + payload(spec, i)[1:] for i in range(15)]
    few_old = [legacy(spec, i) for i in range(2)]
    found = check_integrity(recording([(spec, one) for one in damaged + few_old]))[spec.name]
    assert (found.received, found.corrupt) == (17, 17)
    assert found.legacy >= 2
    assert not found.is_legacy
    assert not Integrity(0, 0, 0, 0).is_legacy


def test_the_layout_is_found_in_any_database():
    for bus in BusName:
        messages = parse_database(database_text(bus)).messages
        for spec in contract(bus).by_id.values():
            assert has_profile_layout(messages[spec.can_id, False]) == (spec.data_id is not None), spec.name
    moved = database_text(BusName.VEHICLE).replace("SG_ ALIVE_COUNTER : 8|4@1+", "SG_ ALIVE_COUNTER : 12|4@1+", 1)
    first = min(key for key in parse_database(moved).messages)
    assert not has_profile_layout(parse_database(moved).messages[first])
