"""Check values of other makers' messages: autosar-e2e and a real car's log are the oracles."""

import random

import pytest
from e2e import p01, p02, p05, p11

from dbc import e2e
from hil.gateway.protection import Profile1, Profile2, Profile5, Sequence, ToyotaSum, crc8_h2f

P01 = {"both": p01.E2E_P01_DATAID_BOTH, "alternating": p01.E2E_P01_DATAID_ALT, "low": p01.E2E_P01_DATAID_LOW,
       "nibble": p01.E2E_P01_DATAID_NIBBLE}  # fmt: skip
P11 = {"both": p11.E2E_P11_DATAID_BOTH, "nibble": p11.E2E_P11_DATAID_NIBBLE}


def profile_1(mode):
    def make(draw, offset):
        data_id = draw.randrange(0x1000) if mode == "nibble" else draw.randrange(0x10000)
        options = {"data_id_mode": P01[mode], "offset": offset}
        return Profile1(data_id, mode, offset), lambda data, check: (
            p01.e2e_p01_check if check else p01.e2e_p01_protect
        )(data, data_id, **options, **({} if check else {"increment_counter": False}))

    return make


def profile_11(mode):
    def make(draw, offset):
        data_id = draw.randrange(0x1000)
        options = {"data_id_mode": P11[mode], "offset": offset}
        return Profile1(data_id, mode, offset), lambda data, check: (
            p11.e2e_p11_check if check else p11.e2e_p11_protect
        )(data, data_id, **options, **({} if check else {"increment_counter": False}))

    return make


def profile_2(draw, offset):
    ids = draw.randbytes(16)
    return (
        Profile2(ids),
        lambda data, check: (
            p02.e2e_p02_check(data, ids) if check else p02.e2e_p02_protect(data, ids, increment_counter=False)
        ),
    )


def profile_5(draw, offset):
    data_id = draw.randrange(0x10000)
    return (
        Profile5(data_id, offset),
        lambda data, check: (
            p05.e2e_p05_check(data, data_id, offset=offset)
            if check
            else p05.e2e_p05_protect(data, data_id, offset=offset, increment_counter=False)
        ),
    )


PROFILES = {f"1 {mode}": profile_1(mode) for mode in P01} | {f"11 {mode}": profile_11(mode) for mode in P11}
PROFILES |= {"2": profile_2, "5": profile_5}


@pytest.mark.parametrize("profile", PROFILES)
def test_bytes_are_the_oracles(profile):
    draw = random.Random(profile)
    for offset in (0,) if profile == "2" else (0, 0, 1, 3, 4):
        for counter in range(15 if profile[0] == "1" else 16):
            ours, oracle = PROFILES[profile](draw, offset)
            body = bytearray(draw.randbytes(8))
            ours.protect(mine := bytearray(body), counter)
            body[offset + (2 if profile == "5" else 1)] &= 0x00 if profile == "5" else 0xF0
            body[offset + (2 if profile == "5" else 1)] |= counter
            oracle(body, False)
            assert mine.hex() == body.hex(), (offset, counter)
            assert ours.counter(mine) == counter
            assert ours.sound(mine)
            assert oracle(mine, True)
            mine[draw.randrange(8)] ^= 1 << draw.randrange(8)
            assert not ours.sound(bytes(mine))


def test_our_own_profile_is_one_of_them():
    payload = bytearray(range(8))
    Profile1(0xBE10).protect(payload, 7)
    assert bytes(payload) == e2e.protect(0xBE10, bytearray(range(8)), 7)


def test_crc_of_profile_2_against_the_catalogue_value():
    assert crc8_h2f(b"123456789") == 0xDF  # CRC-8/AUTOSAR, CRC RevEng catalogue


def test_counter_beyond_its_range_is_not_sound():
    payload = bytearray(8)
    Profile1(0x123).protect(payload, 15)
    assert not Profile1(0x123).sound(payload)


def test_sum_is_the_published_one():
    """Steering request 0x2E4 with 05 F8 (IOActive, Adventures in Automotive Networks, 2013): sum 0xE3 over 5 bytes."""
    payload = bytearray.fromhex("F800000000")
    ToyotaSum(0x2E4).protect(payload, 0)
    assert payload[-1] == 0xE3
    assert ToyotaSum(0x2E4).sound(payload)
    payload[1] ^= 1
    assert not ToyotaSum(0x2E4).sound(payload)


def test_sequence_uses_what_follows_within_two_lost():
    sequence = Sequence(16)
    came = [14, 15, 15, 0, 3, 7, 8, 5]
    assert [sequence.usable(counter) for counter in came] == [False, True, False, True, True, False, True, False]
