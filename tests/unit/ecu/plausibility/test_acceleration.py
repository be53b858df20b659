"""The acceleration sensor against wheels and force balance: alone against both, jumps, roughness."""

from math import inf, nan

import pytest
from plausibility_samples import beyond, one

from ecu.law.joint.layout import AX
from ecu.law.plausibility.layout import ACCELERATION_BIT, ACCELERATION_LEVEL, BODY, FORCES, LAST_AX, WHEELS

BIT = 1 << ACCELERATION_BIT


class Witnesses:
    """Samples in which sensor, wheels and forces say the same for long, each what it is given."""

    def __init__(self, judged):
        self.judged = judged.sample()

    def say(self, body, wheels, forces, times=1, **differing):
        j = self.judged
        for _ in range(times):
            j.state[BODY], j.state[WHEELS], j.state[FORCES] = body, wheels, forces
            j.state[LAST_AX] = j.state[LAST_AX + 1] = body
            j.sample(AX=body, grade=wheels, expected=forces, **differing)
        return self

    @property
    def believed(self):
        return self.judged.z[AX] == self.judged.z[AX]

    @property
    def level(self):
        return self.judged.state[ACCELERATION_LEVEL]


@pytest.fixture
def witnesses(judged):
    return Witnesses(judged)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("body", "wheels", "forces", "alone"),
    [
        (0.5, 0.0, 0.0, False),  # the tolerance
        (beyond(0.5), 0.0, 0.0, True),
        (-beyond(0.5), 0.0, 0.0, True),
        (2.0, 0.0, 0.0, True),
        (-5.0, -4.0, -4.0, False),  # a half and an eighth of the forces
        (beyond(-5.0, -9.0), -4.0, -4.0, True),
        (-3.0, -4.0, -4.0, False),
        (beyond(-3.0), -4.0, -4.0, True),
        (2.0, 0.25, 0.0, False),  # the witnesses do not agree
        (2.0, beyond(0.25, 0.0), 0.0, True),
        (2.0, -0.25, 0.0, False),
        (2.0, beyond(-0.25, 0.0), 0.0, True),
        (-5.5, -4.0, -4.5, False),  # neither wheels ...
        (-5.5, -4.25, -4.5, False),
        (-4.0, 2.5, 2.5, True),
        (-2.5, 2.5, 2.5, False),  # rolls backward: the wheels' mirrored
        (-3.3125, 2.5, 2.5, False),
        (beyond(-3.3125, -9.0), 2.5, 2.5, True),
        (-1.6875, 2.5, 2.5, False),
        (beyond(-1.6875), 2.5, 2.5, True),
        (2.0, 0.6, 0.0, False),
        (0.5, -0.1, 0.0, False),  # as the forces say, just
        (0.625, 0.125, 0.0, False),  # as the wheels say, just
        (beyond(0.625), 0.125, 0.0, True),
        (0.6, 0.2, 0.0, False),  # as the wheels say
        (0.6, 0.0, 0.2, False),  # as the forces say
    ],
)
def test_alone_against_two_that_agree(witnesses, sign, body, wheels, forces, alone):
    witnesses.say(sign * body, sign * wheels, sign * forces)
    assert witnesses.believed == (not alone)
    assert witnesses.level == (1 / 64 if alone else 0.0)
    assert witnesses.judged.bits == 0


def test_six_samples_are_a_fault_and_it_heals_where_the_wheels_agree(witnesses):
    bits = []
    for _ in range(7):
        bits.append(witnesses.say(3.0, 0.0, 0.0).judged.bits)
        assert not witnesses.believed
    assert bits == [0, 0, 0, 0, 0, BIT, BIT]
    witnesses.say(3.0, 0.0, 3.0, times=20)  # the forces agree: not enough
    assert witnesses.judged.bits == BIT
    witnesses.say(0.875, 0.0, 3.0, times=8).say(3.0, 3.0, 0.0, times=7)
    assert witnesses.judged.bits == BIT
    assert not witnesses.believed
    witnesses.say(0.875, 0.0, 3.0)
    assert (witnesses.judged.bits, witnesses.believed) == (0, True)
    witnesses.say(3.0, 0.0, 0.0, times=2)
    assert witnesses.judged.bits == 0
    witnesses.say(3.0, 0.0, 0.0)  # half was kept
    assert witnesses.judged.bits == BIT


def test_before_it_is_a_fault_the_forces_alone_excuse_it(witnesses):
    witnesses.say(3.0, 0.0, 0.0, times=5).say(3.0, 0.0, 3.0, times=5)
    assert witnesses.judged.bits == 0
    assert witnesses.level < 5 / 64


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_jump_is_not_believed(judged, sign):
    judged.sample(times=3)
    start = judged.state
    judged.sample(AX=8.0 * sign)
    assert judged.z[AX] == 8.0 * sign
    assert judged.state[ACCELERATION_LEVEL] == 1 / 64  # but rough
    judged.state = start
    judged.sample(AX=beyond(8.0) * sign)
    assert judged.z[AX] != judged.z[AX]
    assert judged.state[ACCELERATION_LEVEL] == 1 / 64
    judged.sample(AX=beyond(8.0) * sign, expected=nan)
    assert judged.z[AX] == beyond(8.0) * sign  # from there, no jump


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_bends_from_sample_to_sample_is_evidence_and_still_used(judged, sign):
    judged.sample(times=2, expected=0.0)
    start = judged.state
    for value, evidence in ((2.0, 0.0), (beyond(2.0), 1 / 64)):
        judged.state = start
        judged.sample(AX=sign * value)
        assert (judged.state[ACCELERATION_LEVEL], judged.z[AX]) == (evidence, sign * value)
    judged.state = start
    for value in (1.5, 3.0, 4.5, 4.0, 1.5):  # as steep, but straight; then a bend of exactly two
        judged.sample(AX=sign * value)
        judged.state[BODY] = 0.0
        assert judged.state[ACCELERATION_LEVEL] == 0.0
    judged.sample(AX=sign * (1.0 + 1e-9))
    assert judged.state[ACCELERATION_LEVEL] == 1 / 64


def test_a_steep_straight_rise_is_none_up_to_the_jump(judged):
    judged.sample(times=2)
    start = judged.state.copy()
    start[[BODY, WHEELS, FORCES]] = 16.0
    start[LAST_AX] = 8.0  # from 0
    for value, evidence in ((16.0, 0.0), (beyond(16.0), 1 / 64)):
        judged.state = start
        judged.sample(AX=value, grade=16.0, expected=16.0)
        assert judged.state[ACCELERATION_LEVEL] == evidence


def test_wheels_that_slow_down_show_it(judged):
    judged.sample().sample(WHEEL=(79.99,) * 4)
    assert judged.state[WHEELS] == pytest.approx(-0.005 * 64 / 16)


def test_rough_values_are_a_fault_in_the_sixth(judged):
    judged.sample(times=2)
    bits = [judged.sample(AX=(-1.0) ** n).bits for n in range(8)]
    assert bits.index(BIT) == 6  # the first bends by one only


def test_the_witnesses_are_averaged_over_the_lag(judged):
    """A sixteenth of the way in each sample."""
    judged.sample(AX=1.0, expected=1.0).sample(AX=1.0, expected=1.0)
    assert judged.state[BODY] == 1.0
    assert judged.state[WHEELS] == 15 / 16 * 15 / 16 * 1.0
    assert judged.state[FORCES] == 1.0
    judged.sample(AX=2.0, expected=-3.0, grade=0.5, WHEEL=(81.0,) * 4)
    assert judged.state[BODY] == 1.0 + 1 / 16
    assert judged.state[FORCES] == 1.0 - 4 / 16
    wheels = 225 / 256
    assert judged.state[WHEELS] == wheels + (0.5 * 64 + 0.5 - wheels) / 16
    judged.sample(AX=2.0, expected=-3.0, WHEEL=(81.0,) * 4)
    wheels += (32.5 - wheels) / 16
    assert judged.state[WHEELS] == wheels - wheels / 16


def test_the_cars_speed_is_the_median_wheels(judged):
    judged.sample()
    before = judged.state[WHEELS]
    judged.sample(WHEEL=(80.0, 40.0, 80.0, 100.0))
    assert judged.state[WHEELS] == before == 0.0


@pytest.mark.parametrize(
    "differing",
    [
        {"expected": nan},
        {"WHEEL": (beyond(6.0, 0.0),) * 4},
        {"WHEEL": one(0, 6.0, nan)},
        {"WHEEL": (nan,) * 4},
    ],
)
def test_nothing_is_judged_without_forces_with_one_wheel_or_slowly(witnesses, differing):
    j = witnesses.judged
    slow = "WHEEL" in differing
    j.sample(**({"WHEEL": (10.0,) * 4} if slow else {}))
    j.sample(**({"AX": 9.0} | differing))
    assert (j.z[AX], j.bits) == (9.0, 0)
    assert j.state[ACCELERATION_LEVEL] == 0.0
    assert j.state[BODY] != j.state[BODY]
    assert j.state[LAST_AX] == 9.0
    j.sample(AX=-9.0, WHEEL=(10.0,) * 4, expected=nan)
    assert j.z[AX] == -9.0


@pytest.mark.parametrize(
    ("wheel", "judges"), [((6.0,) * 4, True), ((6.0, 6.0, nan, nan), True), ((6.0, nan, nan, nan), False)]
)
def test_judged_at_three_metres_per_second_with_two_wheels(witnesses, wheel, judges):
    j = witnesses.judged
    j.sample(speed=3.0, WHEEL=(6.0,) * 4)
    j.sample(speed=3.0, times=2, WHEEL=wheel)
    j.sample(speed=3.0, WHEEL=wheel, AX=9.0)
    assert (j.z[AX] == 9.0) == (not judges)


def test_a_missing_value_is_no_evidence_and_what_comes_after_it_begins_anew(judged):
    judged.sample(times=3)
    judged.sample(AX=nan)
    assert judged.bits == 0
    judged.sample(AX=9.0, expected=9.0)  # no jump: from nowhere
    assert (judged.z[AX], judged.state[ACCELERATION_LEVEL]) == (9.0, 0.0)
    judged.sample(AX=9.0, expected=9.0)
    assert judged.state[ACCELERATION_LEVEL] == 0.0
    judged.sample(AX=0.5, expected=9.0)
    assert judged.z[AX] != judged.z[AX]


def test_after_a_time_without_forces_the_last_value_still_counts(judged):
    judged.sample(times=2)
    judged.sample(AX=1.0, expected=nan).sample(AX=beyond(9.0), expected=0.0)
    assert judged.z[AX] != judged.z[AX]
    judged.state[:] = 0.0
    judged.sample(AX=50.0)  # the very first comes from nowhere, too
    assert (judged.z[AX], judged.state[ACCELERATION_LEVEL]) == (50.0, 0.0)


def test_a_fault_stays_and_heals_while_nothing_is_judged(witnesses):
    witnesses.say(3.0, 0.0, 0.0, times=6)
    j = witnesses.judged
    j.sample(expected=nan, times=15)
    assert j.bits == BIT
    assert j.z[AX] != j.z[AX]
    j.sample(expected=nan)
    assert (j.bits, j.z[AX]) == (0, 0.0)


def test_evidence_is_forgotten_slowly(witnesses):
    witnesses.say(3.0, 0.0, 0.0)
    assert witnesses.level == 1 / 64
    witnesses.say(0.0, 0.0, 0.0)
    assert witnesses.level == 1 / 64 - 1 / 4096
    witnesses.say(0.0, 0.0, 0.0, times=70)
    assert witnesses.level == 0.0


def test_what_is_no_number_is_no_evidence(witnesses):
    for value in (inf, -inf, nan):
        witnesses.judged.sample(AX=value)
        assert not witnesses.believed
        assert witnesses.judged.bits == 0
