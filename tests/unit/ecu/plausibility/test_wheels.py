"""Wheel speeds that cannot be: too fast a change, beyond the car's speed, above all others."""

from itertools import permutations
from math import inf, nan

import pytest
from plausibility_samples import beyond, one, same

from ecu.law.joint.layout import WHEEL
from ecu.law.plausibility.layout import WHEEL_BIT, WHEEL_LEVEL

FAST = 120.0  # m/s by the observer: no wheel is above the others
WHEELS = range(4)


def bit(*wheels):
    return sum(1 << WHEEL_BIT + i for i in wheels)


def test_a_healthy_sample_stays_as_it_is(judged):
    speeds = (80.0, 82.0, 79.0, 81.0)
    judged.sample(times=50, WHEEL=speeds)
    assert (judged.bits, judged.top, judged.hold) == (0, 82.0, 0.0)
    assert judged.four(WHEEL) == speeds
    assert judged.z[0] == judged.z[4] == 0.0


@pytest.mark.parametrize("i", WHEELS)
@pytest.mark.parametrize(("limit", "toward"), [(112.0, inf), (16.0, -inf)])
def test_a_wheel_that_changes_faster_than_tyre_and_brake_turn_it_is_left_out_in_that_sample(judged, i, limit, toward):
    start = judged.sample(speed=FAST).state
    assert same(judged.sample(speed=FAST, WHEEL=one(i, limit, 80.0)).four(WHEEL), one(i, limit, 80.0))
    assert judged.state[WHEEL_LEVEL + i] == 0.0
    judged.state = start
    assert same(judged.sample(speed=FAST, WHEEL=one(i, beyond(limit, toward), 80.0)).four(WHEEL), one(i, nan, 80.0))
    assert judged.state[WHEEL_LEVEL + i] == 1 / 64
    assert (judged.bits, judged.top) == (0, 80.0)


@pytest.mark.parametrize(("most", "away"), [(32.0, 1.0), (64.0, -1.0)])
def test_it_is_believed_as_soon_as_it_can_have_got_there(judged, most, away):
    """A jump of what a wheel can do in three samples is left out twice; of more, it is a fault in the third."""
    rest = 60.0 if away > 0 else 240.0
    judged.sample(speed=FAST, WHEEL=one(0, rest, 80.0))
    there = rest + 3 * most * away
    for left_out in (True, True, False, False):
        judged.sample(speed=FAST, WHEEL=one(0, there, 80.0))
        assert (judged.z[WHEEL] != judged.z[WHEEL]) == left_out
        assert judged.bits == 0


@pytest.mark.parametrize(("most", "rest", "away"), [(32.0, 60.0, 1.0), (64.0, 240.0, -1.0)])
def test_a_jump_that_takes_longer_than_three_samples_is_a_fault(judged, most, rest, away):
    judged.sample(speed=FAST, WHEEL=one(0, rest, 80.0))
    there = rest + away * (3 * most + 1e-6)
    assert [judged.sample(speed=FAST, WHEEL=one(0, there, 80.0)).bits for _ in range(4)] == [0, 0, bit(0), bit(0)]


@pytest.mark.parametrize("i", WHEELS)
def test_a_wheel_is_a_fault_after_three_samples_of_evidence_and_until_it_has_healed(judged, i):
    bits = [judged.sample(WHEEL=one(i, 300.0, 80.0)).bits for _ in range(4)]
    assert bits == [0, 0, bit(i), bit(i)]
    judged.sample(times=3)  # until it can have got there
    judged.sample(times=15)
    assert judged.bits == bit(i)
    assert same(judged.four(WHEEL), one(i, nan, 80.0))  # left out although it looks right
    judged.sample()
    assert (judged.bits, judged.four(WHEEL)) == (0, (80.0,) * 4)
    assert [judged.sample(WHEEL=one(i, 300.0, 80.0)).bits for _ in range(2)] == [0, bit(i)]  # half was kept


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_no_wheel_of_this_car_turns_faster_than_its_top_speed(judged, way):
    end = 256.5 * way
    judged.sample(speed=200.0, WHEEL=(end, 80.0, 80.0, 80.0))
    assert judged.z[WHEEL] == end
    judged.sample(speed=200.0, WHEEL=(beyond(end, way * inf), 80.0, 80.0, 80.0))
    assert judged.z[WHEEL] != judged.z[WHEEL]
    judged.sample(speed=200.0, times=2, WHEEL=(beyond(end, way * inf), 80.0, 80.0, 80.0))
    assert judged.bits == bit(0)


@pytest.mark.parametrize(
    ("speed", "most"), [(0.0, 133.25), (nan, 133.25), (50.0, 133.25), (60.0, 158.25), (60.125, 158.5625)]
)
def test_above_the_second_fastest_and_the_observer_by_the_margin(judged, speed, most):
    """A quarter of either, and 4.125 m/s."""
    begun = judged.state
    for speeds in set(permutations((most, 100.0, 70.0, 30.0))):
        i = speeds.index(most)
        judged.state = begun
        assert judged.sample(speed=speed, WHEEL=speeds).four(WHEEL) == speeds
        assert judged.top == most
        judged.state = begun
        above = tuple(beyond(most) if k == i else value for k, value in enumerate(speeds))
        judged.sample(speed=speed, WHEEL=above)
        assert same(judged.four(WHEEL), tuple(nan if k == i else value for k, value in enumerate(speeds)))
        assert judged.top == 100.0
        assert judged.state[WHEEL_LEVEL + i] == 1 / 64


def test_two_wheels_together_are_believed(judged):
    for speeds in set(permutations((200.0, 200.0, 20.0, 20.0))):
        judged.state[:] = 0.0
        assert judged.sample(speed=0.0, WHEEL=speeds).four(WHEEL) == speeds


def test_a_margin_beside_wheels_that_turn_backward_or_are_missing(judged):
    for others in (-50.0, nan, 0.0):
        judged.state[:] = 0.0
        assert judged.sample(speed=0.0, WHEEL=one(1, 8.25, others)).z[WHEEL + 1] == 8.25
        judged.state[:] = 0.0
        assert judged.sample(speed=0.0, WHEEL=one(1, beyond(8.25), others)).z[WHEEL + 1] != 8.25


@pytest.mark.parametrize("i", WHEELS)
def test_a_driven_wheel_may_spin_it_is_left_out_and_no_fault(judged, i):
    for torque, bits in ((beyond(32.0), 0), (32.0, bit(i)), (-100.0, bit(i))):
        judged.state[:] = 0.0
        judged.sample(times=4, WHEEL=one(i, 150.0, 80.0), MOTOR=one(i, torque), ASKED_MOTOR=(nan,) * 4)
        assert judged.bits == bits
        assert same(judged.four(WHEEL), one(i, nan, 80.0))
    judged.sample(times=3, WHEEL=one(i, 300.0, 80.0), MOTOR=one(i, 100.0), ASKED_MOTOR=(nan,) * 4)
    assert judged.bits == bit(i)  # no motor does that


@pytest.mark.parametrize("i", WHEELS)
def test_a_wheel_that_was_missing_may_come_back_at_any_speed(judged, i):
    judged.sample(speed=FAST)
    judged.sample(speed=FAST, times=3, WHEEL=one(i, nan, 80.0))
    assert (judged.bits, judged.top) == (0, 80.0)
    judged.sample(speed=FAST, WHEEL=one(i, 200.0, 80.0))
    assert judged.four(WHEEL) == one(i, 200.0, 80.0)
    assert judged.top == 200.0
    judged.sample(speed=FAST, WHEEL=one(i, 240.0, 80.0))
    assert judged.z[WHEEL + i] != judged.z[WHEEL + i]


def test_without_any_believed_wheel_the_slowest_lets_the_brake_give_most(judged):
    for speeds, top in (
        ((300.0, 280.0, 270.0, 290.0), 256.5),
        ((300.0, -280.0, 270.0, 290.0), 0.0),
        ((270.0, 300.0, -257.0, nan), 0.0),
        ((nan,) * 4, 0.0),
        ((-80.0,) * 4, 0.0),
    ):
        judged.state[:] = 0.0
        assert judged.sample(speed=200.0, WHEEL=speeds).top == top
    judged.state[:] = 0.0
    judged.sample(speed=FAST, WHEEL=(200.0,) * 4)
    assert judged.sample(speed=FAST, WHEEL=(120.0, 110.0, 90.0, nan)).top == 90.0
    assert judged.bits == 0
    assert judged.sample(speed=FAST, WHEEL=(0.5,) * 4).top == 0.5


def test_the_evidence_of_a_missing_wheel_stands(judged):
    judged.sample(WHEEL=one(0, 300.0, 80.0)).sample(times=9, WHEEL=one(0, nan, 80.0))
    assert judged.state[WHEEL_LEVEL] == 1 / 64


def test_wheels_that_hardly_turn_are_no_measure_for_another(judged):
    assert judged.sample(speed=0.0, WHEEL=(9.25, 0.8, -0.5, -0.7)).z[WHEEL] == 9.25
    judged.state[:] = 0.0
    assert judged.sample(speed=0.0, WHEEL=(9.5, 0.8, -0.5, -0.7)).z[WHEEL] != 9.5
    for others in ((-1.0, -0.5, -0.7), (0.0, 0.0, 0.0)):
        judged.state[:] = 0.0
        assert judged.sample(speed=0.0, WHEEL=(8.5, *others)).z[WHEEL] != 8.5
        judged.state[:] = 0.0
        assert judged.sample(speed=-5.0, WHEEL=(8.25, *others)).z[WHEEL] == 8.25


def test_the_first_samples_of_three_wheels_do_not_hang_together(judged):
    judged.sample(WHEEL=(nan, 80.0, 90.0, 85.0)).sample(WHEEL=(200.0, 80.0, 90.0, 85.0), speed=FAST)
    assert judged.four(WHEEL) == (200.0, 80.0, 90.0, 85.0)
    judged.sample(WHEEL=(240.0, 80.0, 90.0, nan), speed=FAST).sample(WHEEL=(80.0, 200.0, 90.0, 85.0), speed=FAST)
    assert same(judged.four(WHEEL), (nan, nan, 90.0, 85.0))


def test_a_rare_odd_sample_is_forgotten(judged):
    for _ in range(10):
        judged.sample(WHEEL=one(2, 257.0, 80.0)).sample(times=200)
        assert judged.bits == 0
    assert judged.state[WHEEL_LEVEL + 2] == 0.0


def test_a_missing_wheel_lets_no_other_jump(judged):
    judged.sample(speed=FAST, WHEEL=(nan, 80.0, 90.0, 85.0)).sample(speed=FAST, WHEEL=(nan, 200.0, 90.0, 85.0))
    assert same(judged.four(WHEEL), (nan, nan, 90.0, 85.0))


def test_pressures_are_no_wheels(judged):
    pressures = {"PRESSURE": (1e5,) * 4, "ASKED_PRESSURE": (1e5,) * 4}
    assert judged.sample(speed=0.0, WHEEL=one(1, 150.0, 80.0), **pressures).z[WHEEL + 1] != 150.0


def test_without_the_observers_speed_the_car_may_stand(judged):
    assert judged.sample(speed=nan, WHEEL=one(3, 8.5)).z[WHEEL + 3] != 8.5
    judged.state[:] = 0.0
    assert judged.sample(speed=nan, WHEEL=one(3, 8.25)).z[WHEEL + 3] == 8.25
