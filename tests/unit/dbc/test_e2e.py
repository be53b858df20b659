"""End-to-end protection: what is seen, what cannot be."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from dbc.e2e import COUNTER_MODULUS, Checker, Status, check_value, crc8, protect

DATA_ID = 0xB0A8
payloads = st.binary(min_size=8, max_size=8)


def frame(counter, body=b"\x00" * 8, data_id=DATA_ID):
    return protect(data_id, bytearray(body), counter)


def statuses(checker, counters):
    return [checker.check(frame(c)) for c in counters]


@given(payloads)
def test_check_value_is_the_crc_over_data_id_and_payload(body):
    assert check_value(DATA_ID, body) == crc8(bytes([DATA_ID & 0xFF, DATA_ID >> 8]) + body[1:])


@given(payloads, st.integers(0, 14))
def test_every_single_and_double_bit_flip_is_seen(body, counter):
    good = int.from_bytes(frame(counter, body), "little")
    flips = itertools.chain(
        ((i,) for i in range(64)), itertools.islice(itertools.combinations(range(64), 2), 0, 2016, 7)
    )
    for bits in flips:
        bad = good
        for bit in bits:
            bad ^= 1 << bit
        assert Checker(DATA_ID, 8).check(bad.to_bytes(8, "little")) is Status.WRONG_CRC


def test_every_double_bit_flip_of_one_frame():
    good = int.from_bytes(frame(3, bytes(range(8))), "little")
    for i, j in itertools.combinations(range(64), 2):
        assert Checker(DATA_ID, 8).check((good ^ 1 << i ^ 1 << j).to_bytes(8, "little")) is Status.WRONG_CRC


def test_sequence():
    checker = Checker(DATA_ID, 8)
    assert statuses(checker, [13, 14, 0, 0, 2, 5, 9, 10, 11]) == [
        Status.SYNC, Status.OK, Status.OK, Status.REPEATED, Status.OK_SOME_LOST, Status.OK_SOME_LOST,
        Status.WRONG_SEQUENCE, Status.OK, Status.OK,
    ]  # fmt: skip
    assert checker.lost == 1 + 2 + 3
    assert checker.corrupt == 0


def test_up_to_two_in_a_row_may_be_lost():
    for lost, expected in ((1, Status.OK_SOME_LOST), (2, Status.OK_SOME_LOST), (3, Status.WRONG_SEQUENCE)):
        checker = Checker(DATA_ID, 8)
        assert statuses(checker, [0, 1, 2 + lost])[-1] is expected


def test_wrong_length_data_id_and_counter_fifteen():
    checker = Checker(DATA_ID, 8)
    assert checker.check(frame(0)[:7]) is Status.WRONG_CRC
    assert checker.check(frame(0) + b"\x00") is Status.WRONG_CRC
    assert checker.check(b"") is Status.WRONG_CRC
    assert checker.check(frame(0, data_id=DATA_ID + 1)) is Status.WRONG_CRC
    fifteen = bytearray(8)
    fifteen[1] = 15
    fifteen[0] = check_value(DATA_ID, fifteen)
    assert checker.check(bytes(fifteen)) is Status.WRONG_CRC
    assert checker.corrupt == 5


def test_a_shift_by_the_counter_length_cannot_be_seen():
    checker = Checker(DATA_ID, 8)
    assert statuses(checker, [0, 1, (2 + COUNTER_MODULUS) % COUNTER_MODULUS])[-1] is Status.OK


@given(st.lists(st.integers(0, 14), min_size=2, max_size=60))
def test_only_a_forward_step_of_at_most_three_is_usable(counters):
    checker = Checker(DATA_ID, 8)
    for before, (counter, status) in zip(
        counters, itertools.islice(zip(counters, statuses(checker, counters), strict=True), 1, None), strict=False
    ):
        delta = (counter - before) % COUNTER_MODULUS
        if status in (Status.OK, Status.OK_SOME_LOST):
            assert 1 <= delta <= 3
        if delta == 0:
            assert status is Status.REPEATED
