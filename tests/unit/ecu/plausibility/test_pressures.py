"""Pressures off their demands: one wheel of an axle is a wrong sensor, both are a brake that does not follow."""

from math import nan

import pytest
from plausibility_samples import NAN4, beyond, one, same

from ecu.law.joint.layout import PRESSURE
from ecu.law.plausibility.layout import PRESSURE_BIT, PRESSURE_LEVEL, PRESSURE_LOW

MOST = 2.0**18
WHEELS = range(4)


def bit(*wheels):
    return sum(1 << PRESSURE_BIT + i for i in wheels)


def beside(i):
    return (1, 0, 3, 2)[i]


@pytest.mark.parametrize("i", WHEELS)
def test_off_by_the_tolerance_is_right_and_by_more_is_not_believed_in_that_sample(judged, i):
    judged.sample(PRESSURE=one(i, MOST))
    assert (judged.four(PRESSURE), judged.hold) == (one(i, MOST), 0.0)
    judged.sample(PRESSURE=one(i, beyond(MOST)))
    assert (judged.four(PRESSURE), judged.hold, judged.bits) == ((0.0,) * 4, 1.0, 0)
    assert judged.state[PRESSURE_LEVEL + i] == 1 / 64
    assert judged.state[PRESSURE_LEVEL + beside(i)] == 0.0


@pytest.mark.parametrize("i", WHEELS)
@pytest.mark.parametrize("value", [1e6, -1e6])
def test_five_samples_are_a_fault_until_it_has_healed(judged, i, value):
    assert [judged.sample(PRESSURE=one(i, value)).bits for _ in range(6)] == [0, 0, 0, 0, bit(i), bit(i)]
    judged.sample(times=15, PRESSURE=one(i, 2e3, 1e3))
    assert (judged.bits, judged.hold) == (bit(i), 1.0)
    assert judged.four(PRESSURE) == (1e3,) * 4  # the other wheel's, although it looks right
    judged.sample(PRESSURE=one(i, 2e3, 1e3))
    assert (judged.bits, judged.hold, judged.four(PRESSURE)) == (0, 0.0, one(i, 2e3, 1e3))
    assert [judged.sample(PRESSURE=one(i, value)).bits for _ in range(3)] == [0, 0, bit(i)]


def test_the_tolerance_grows_with_the_demand(judged):
    asked = (2.0**21,) * 4
    judged.sample(times=400, PRESSURE=asked, ASKED_PRESSURE=asked)
    judged.state[PRESSURE_LOW : PRESSURE_LOW + 4] = asked  # to the last bit
    for off in (2 * MOST, -2 * MOST):
        judged.sample(PRESSURE=one(2, 2.0**21 + off, 2.0**21), ASKED_PRESSURE=asked)
        assert judged.hold == 0.0
    for value in (beyond(2.0**21 + 2 * MOST), beyond(2.0**21 - 2 * MOST, 0.0)):
        judged.sample(PRESSURE=one(2, value, 2.0**21), ASKED_PRESSURE=asked)
        assert judged.hold == 1.0
        assert judged.z[PRESSURE + 2] == 2.0**21


def test_the_brake_may_be_anywhere_between_the_lag_and_the_demand(judged):
    """Applied: an eighth of the way in each sample at least, and no further than the demand. Released: the same."""
    asked = (2.0**20,) * 4
    judged.sample()
    for low in (2.0**17, 2.0**17 + 7 * 2.0**14):
        start = judged.state
        for value, right in (
            (low - 1.5 * MOST, True),
            (low - 1.5 * MOST - 1e-3, False),
            (2.0**20 + 1.5 * MOST, True),
            (2.0**20 + 1.5 * MOST + 1e-3, False),
        ):
            judged.state = start
            judged.sample(PRESSURE=one(1, value, 2.0**19), ASKED_PRESSURE=asked)
            assert (judged.hold == 0.0) == right
            if not right:
                assert judged.z[PRESSURE + 1] == 2.0**19
    judged.state[:] = 0.0
    judged.sample(times=500, PRESSURE=asked, ASKED_PRESSURE=asked)
    start = judged.state
    high = 7 * 2.0**17
    most = MOST + high / 8
    for value, right in (
        (high + most, True),
        (beyond(high + most), False),
        (-most, True),
        (beyond(-most, -1e9), False),
    ):
        judged.state = start
        judged.sample(PRESSURE=one(3, value, 2.0**19))
        assert (judged.hold == 0.0) == right


@pytest.mark.parametrize("value", [2e6, -2e6])
def test_both_wheels_of_an_axle_off_together_are_the_brake(judged, value):
    judged.sample(times=10, PRESSURE=(value, value, 0.0, 0.0))
    assert (judged.bits, judged.hold) == (0, 0.0)
    assert judged.four(PRESSURE) == (value, value, 0.0, 0.0)
    judged.sample(times=10, PRESSURE=(0.0, 0.0, value, value))
    assert (judged.bits, judged.hold) == (0, 0.0)


def test_of_two_that_are_off_the_one_that_is_further_off_is_wrong(judged):
    """By more than the tolerance apart; where both are as far off, neither."""
    judged.sample(PRESSURE=(3.0 * MOST, 2.0 * MOST, 0.0, 0.0))
    assert judged.hold == 0.0
    judged.sample(PRESSURE=(beyond(3.0 * MOST), 2.0 * MOST, 0.0, 0.0))
    assert (judged.hold, judged.four(PRESSURE)) == (1.0, (2.0 * MOST, 2.0 * MOST, 0.0, 0.0))
    judged.sample(times=6, PRESSURE=(4.0 * MOST, 2.0 * MOST, 0.0, 0.0))
    assert judged.bits == bit(0)
    judged.state[:] = 0.0
    judged.sample(times=10, PRESSURE=(0.0, 0.0, 2.0 * MOST, -2.0 * MOST))
    assert (judged.bits, judged.hold) == (0, 0.0)
    judged.sample(PRESSURE=(0.0, 0.0, 2.0 * MOST, beyond(-2.0 * MOST, -1e9)))
    assert judged.hold == 1.0
    assert judged.four(PRESSURE) == (0.0,) * 4  # nor is the other believed in such a sample


@pytest.mark.parametrize("i", WHEELS)
def test_the_axles_other_wheel_stands_in_for_one_that_is_missing(judged, i):
    seen = tuple(1e5 + k for k in WHEELS)
    values = tuple(nan if k == i else value for k, value in enumerate(seen))
    judged.sample(PRESSURE=values, ASKED_PRESSURE=(1e5,) * 4)
    assert (judged.hold, judged.bits) == (1.0, 0)
    assert judged.four(PRESSURE) == tuple(seen[beside(i)] if k == i else value for k, value in enumerate(seen))


def test_what_the_demands_make_likely_stands_in_for_both_of_an_axle(judged):
    judged.sample()
    judged.sample(PRESSURE=(nan, nan, 0.0, 0.0), ASKED_PRESSURE=(2.0**20,) * 4)
    middle = 0.5 * (2.0**17 + 2.0**20)
    assert judged.four(PRESSURE) == (middle, middle, 0.0, 0.0)
    judged.sample(PRESSURE=NAN4, ASKED_PRESSURE=NAN4)  # the band stays
    assert judged.four(PRESSURE) == (middle, middle, middle, middle)
    judged.sample(PRESSURE=(0.0, 0.0, nan, nan))
    assert judged.z[PRESSURE + 2] == judged.z[PRESSURE + 3] == 0.5 * 7 * 2.0**17
    assert judged.bits == 0


@pytest.mark.parametrize("i", WHEELS)
def test_a_wheel_that_is_a_fault_itself_does_not_stand_in(judged, i):
    judged.sample(times=6, PRESSURE=one(i, 1e6))
    judged.sample(PRESSURE=one(i, 1e4, nan))
    assert judged.four(PRESSURE) == (0.0,) * 4


def test_one_that_is_further_off_than_what_it_stands_in_for_does_not(judged):
    """Another axle's value is missing, so that stand-ins are looked for at all."""
    judged.sample(PRESSURE=(2.0 * MOST, 2.5 * MOST, nan, 0.0))
    assert judged.four(PRESSURE) == (0.0,) * 4
    judged.sample(PRESSURE=(2.0 * MOST, 1.5 * MOST, nan, 0.0))
    assert judged.four(PRESSURE) == (1.5 * MOST, 1.5 * MOST, 0.0, 0.0)


def test_without_demands_nothing_is_compared(judged):
    for value in (1e6, 5e6, 0.0):
        judged.sample(times=6, PRESSURE=one(0, value), ASKED_PRESSURE=NAN4)
        assert (judged.bits, judged.hold, judged.z[PRESSURE]) == (0, 0.0, value)
    judged.sample(PRESSURE=one(0, 1e6), ASKED_PRESSURE=NAN4)
    judged.sample(PRESSURE=one(0, 8e5))  # from there the demands are followed again
    assert same(judged.four(PRESSURE), one(0, 8e5))
    assert judged.hold == 0.0
