from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc import e2e
from dbc.contract import contract
from dbc.frame import BusName
from hil.log.frames import FrameBuilder, FrameFlag
from hil.log.integrity import Integrity, check_integrity

PROTECTED = [spec for bus in BusName for spec in contract(bus).by_id.values() if spec.data_id is not None]


def payload(spec, counter, fill=0x5A):
    return e2e.protect(spec.data_id, bytearray([fill] * spec.length), counter)


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
