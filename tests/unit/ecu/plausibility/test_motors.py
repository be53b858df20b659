"""Motor torques against demands: compared while braking, excluded in three samples, tried again after a free pedal."""

from math import nan

import pytest
from plausibility_samples import NAN4, beyond, one

from ecu.law.joint.layout import MOTOR
from ecu.law.plausibility.judge import opposing_torque
from ecu.law.plausibility.layout import EXCLUDED_S, MOTOR_BIT, MOTOR_LEVEL, REPORTED

WHEELS = range(4)
READY = 4  # samples with demands before the first that is compared


def bit(*wheels):
    return sum(1 << MOTOR_BIT + i for i in wheels)


@pytest.fixture
def ready(judged):
    """Demands of zero for as long as motors take to follow; the next sample is compared where it brakes."""
    return judged.sample(times=READY)


def level(judged, i):
    return judged.state[MOTOR_LEVEL + i]


@pytest.mark.parametrize("i", WHEELS)
@pytest.mark.parametrize(
    ("asked", "available", "low", "high"),
    [
        (-128.0, 512.0, -192.0, 32.0),  # from -32, the rate, and the lag's quarter; 32 and a quarter of 128 around
        (-64.0, 512.0, -112.0, 32.0),  # from -16, the lag's quarter
        (-512.0, 512.0, -672.0, 128.0),  # from -32, the rate
        (-512.0, 16.0, -672.0, 144.0),  # from -16, all it has
        (-512.0, nan, -672.0, 160.0),  # from 0
        (128.0, 512.0, 0.0 - 32.0, 192.0),
        (0.0, 512.0, -32.0, 32.0),
    ],
)
def test_the_band_of_a_demand_that_has_just_come(ready, i, asked, available, low, high):
    start = ready.state
    if asked == 128.0:
        low = 32.0 - 64.0
    for torque, right in ((low, True), (beyond(low, -1e9), False), (high, True), (beyond(high), False)):
        ready.state = start
        ready.sample(DEMAND=1.0, MOTOR=one(i, torque), ASKED_MOTOR=one(i, asked), AVAILABLE=one(i, available, 512.0))
        assert level(ready, i) == (0.0 if right else 1 / 64), torque
        assert ready.z[MOTOR + i] == torque
        assert (ready.hold, ready.bits) == (0.0, 0)


def test_the_band_closes_by_the_lag_and_no_faster_than_the_rate(ready):
    """-512 asked: high at -32, -64, ... by the rate until the lag's quarter is less."""
    high = 0.0
    for _ in range(20):
        high = max(high - 32.0, high + 0.25 * (-512.0 - high))
        start, limit = ready.state, high + 160.0
        ready.sample(DEMAND=1.0, MOTOR=one(2, beyond(limit, 1e9)), ASKED_MOTOR=one(2, -512.0))
        assert level(ready, 2) == 1 / 64
        ready.state = start
        ready.sample(DEMAND=1.0, MOTOR=one(2, limit), ASKED_MOTOR=one(2, -512.0))
        assert level(ready, 2) == 0.0
    low = -512.0
    for _ in range(20):
        low = min(low + 32.0, low - 0.25 * low)
        start, limit = ready.state, low - 32.0 - 0.25 * max(-low, 0.0)
        ready.sample(DEMAND=1.0, MOTOR=one(2, beyond(limit, -1e9)))
        assert level(ready, 2) == 1 / 64
        ready.state = start
        ready.sample(DEMAND=1.0, MOTOR=one(2, limit))
        assert level(ready, 2) == 0.0


@pytest.mark.parametrize("i", WHEELS)
def test_four_samples_exclude_a_motor(ready, i):
    for n, bits in enumerate((0, 0, 0, bit(i), bit(i))):
        ready.sample(DEMAND=1.0, MOTOR=one(i, 400.0, 7.0))
        assert (ready.bits, ready.hold) == (bits, 1.0 if bits else 0.0), n
        assert ready.four(MOTOR) == one(i, 0.0 if bits else 400.0, 7.0)  # believed to give nothing
    assert opposing_torque(ready.state) == (0.0,) * 4


def exclude(judged, i):
    return judged.sample(times=4, DEMAND=1.0, MOTOR=one(i, 400.0))


@pytest.mark.parametrize("i", WHEELS)
def test_an_excluded_motor_is_tried_again_after_the_pedal_was_free_for_long_enough(ready, i):
    exclude(ready, i)
    ready.sample(times=40, DEMAND=1.0)
    assert ready.bits == bit(i)  # not within the braking
    ready.sample(times=7)
    assert ready.bits == bit(i)
    ready.sample(times=5, DEMAND=1.0)
    assert ready.bits == bit(i)
    assert ready.state[EXCLUDED_S + i] == 1 / 64
    assert ready.sample().bits == 0
    assert ready.state[EXCLUDED_S + i] == 0.0
    assert ready.sample().hold == 0.0
    assert [ready.sample(DEMAND=1.0, MOTOR=one(i, 400.0)).bits for _ in range(2)] == [0, bit(i)]  # half was kept


def test_evidence_while_it_is_excluded_begins_the_time_anew(ready):
    exclude(ready, 1)
    ready.sample(times=5)
    ready.sample(times=3, DEMAND=1.0, MOTOR=one(1, 400.0))
    ready.sample(times=7)
    assert ready.bits == bit(1)
    assert ready.sample().bits == 0


def test_nothing_is_compared_before_the_motors_can_follow_without_demands_or_while_the_pedal_is_free(judged):
    judged.sample(times=READY, DEMAND=1.0, MOTOR=(400.0,) * 4)
    assert all(level(judged, i) == 0.0 for i in WHEELS)
    judged.sample(DEMAND=1.0, MOTOR=(450.0,) * 4)
    assert all(level(judged, i) == 0.0 for i in WHEELS)  # from where it was
    judged.sample(times=10, MOTOR=(400.0,) * 4)  # the driver's own torque
    assert (judged.bits, judged.hold) == (0, 0.0)
    judged.sample(times=10, DEMAND=1.0, MOTOR=(500.0,) * 4, ASKED_MOTOR=NAN4)
    assert (judged.bits, judged.four(MOTOR)) == (0, (500.0,) * 4)
    judged.sample(times=READY, DEMAND=1.0, MOTOR=(500.0,) * 4)  # demands are new again
    assert judged.bits == 0
    judged.sample(times=120, MOTOR=(0.0,) * 4)
    assert judged.sample(DEMAND=1.0, MOTOR=one(0, 200.0)).state[MOTOR_LEVEL] == 1 / 64


@pytest.mark.parametrize(("torque", "least", "most"), [(300.0, -32.0, 372.0), (-300.0, -372.0, 32.0)])
def test_braking_begins_from_the_drivers_torque(ready, torque, least, most):
    """300 Nm of it: no more than 32 Nm of it are gone after a sample, 32 Nm and a quarter around."""
    ready.sample(MOTOR=one(0, torque))
    start = ready.state
    edge = 268.0 + 32.0 + 67.0 if torque > 0 else -(268.0 + 32.0 + 67.0)
    for value, right in ((edge, True), (beyond(edge, 10 * torque), False)):
        ready.state = start
        ready.sample(DEMAND=1.0, MOTOR=one(0, value))
        assert (level(ready, 0) == 0.0) == right
    for value, right in ((-99.0 if torque > 0 else 99.0, True), (-99.5 if torque > 0 else 99.5, False)):
        ready.state = start
        ready.sample(DEMAND=1.0, MOTOR=one(0, value))
        assert (level(ready, 0) == 0.0) == right


@pytest.mark.parametrize("i", WHEELS)
def test_a_torque_that_is_missing_counts_as_none(ready, i):
    ready.sample(times=6, DEMAND=1.0, MOTOR=one(i, nan, 5.0))
    assert (ready.bits, ready.hold, ready.four(MOTOR)) == (0, 1.0, one(i, 0.0, 5.0))
    ready.sample(MOTOR=one(i, nan, 5.0))
    assert (ready.hold, ready.four(MOTOR)) == (1.0, one(i, 0.0, 5.0))
    ready.sample(DEMAND=1.0, MOTOR=one(i, 32.0))
    assert level(ready, i) == 0.0
    ready.sample(DEMAND=1.0, MOTOR=one(i, beyond(32.0)))
    assert level(ready, i) == 1 / 64


DRIVES = {"DEMAND": 1.0, "MOTOR": (256.0, 0.0, 0.0, 0.0)}  # 1 m/s2 of this car


def excluded_driving(ready, ax, expected, times=1):
    ready.sample(times=4, DEMAND=1.0, MOTOR=(256.0, 0.0, 0.0, 0.0), AX=-3.0, expected=-3.0)
    assert ready.bits == bit(0)
    return ready.sample(times=times, AX=ax, expected=expected, **DRIVES)


def test_what_drives_is_opposed_where_the_acceleration_confirms_it(ready):
    excluded_driving(ready, -2.0, -3.0)
    assert ready.state[REPORTED] == 1 / 16
    assert opposing_torque(ready.state) == (256.0, 0.0, 0.0, 0.0)
    assert ready.four(MOTOR) == (256.0, 0.0, 0.0, 0.0)
    assert (ready.bits, ready.hold) == (bit(0), 1.0)
    ready.sample(AX=-2.0, expected=-2.0, **DRIVES)  # what was believed is in it now
    assert ready.state[REPORTED] == 1 / 16 + 15 / 256
    ready.sample(times=40, AX=-3.0, expected=-2.0, **DRIVES)
    assert ready.state[REPORTED] < 0.0
    assert opposing_torque(ready.state) == (0.0,) * 4
    assert ready.z[MOTOR] == 0.0


@pytest.mark.parametrize(
    ("ax", "expected", "better"),
    [(-3.0, -3.0, -1), (-2.5, -3.0, 0), (-2.25, -3.0, 0.5), (nan, -3.0, 0), (-2.0, nan, 0)],
)
def test_how_much_better_the_report_explains_it(ready, ax, expected, better):
    excluded_driving(ready, ax, expected)
    assert ready.state[REPORTED] == better / 16
    assert opposing_torque(ready.state)[0] == (256.0 if better > 0 else 0.0)


def test_the_opposing_torque_is_no_more_than_a_motor_has_and_never_of_one_that_brakes(ready):
    excluded_driving(ready, -2.0, -3.0)
    ready.sample(AX=-2.0, expected=-2.0, DEMAND=1.0, MOTOR=(600.0, 300.0, 0.0, 0.0))
    assert opposing_torque(ready.state) == (512.0, 0.0, 0.0, 0.0)
    before = ready.state[REPORTED]
    ready.sample(AX=-4.0, expected=-4.0, DEMAND=1.0, MOTOR=(-256.0, 300.0, 0.0, 0.0))
    assert ready.state[REPORTED] == before + (1.0 - before) / 16
    assert opposing_torque(ready.state) == (0.0,) * 4
    assert ready.z[MOTOR] == -256.0
    ready.sample(AX=-2.0, expected=-3.0, DEMAND=1.0, MOTOR=(nan, 0.0, 0.0, 0.0))
    assert (opposing_torque(ready.state), ready.z[MOTOR]) == ((0.0,) * 4, 0.0)


@pytest.mark.parametrize("i", WHEELS)
def test_reports_of_motors_that_are_not_excluded_and_of_missing_ones_do_not_count(ready, i):
    exclude(ready, i)
    start = ready.state
    for others in (0.0, 64.0, nan):
        ready.state = start
        ready.sample(AX=-2.0, expected=-3.0, DEMAND=1.0, MOTOR=one(i, 256.0, others))
        assert ready.state[REPORTED] == 1 / 16
    ready.state = start
    ready.sample(AX=-2.0, expected=-3.0, DEMAND=1.0, MOTOR=one(i, nan, 256.0))
    assert ready.state[REPORTED] == 0.0


def test_two_excluded_motors_add_up_and_what_was_believed_ends_with_the_exclusion(ready):
    ready.sample(times=4, DEMAND=1.0, MOTOR=(256.0, 0.0, 128.0, 0.0), AX=-3.0, expected=-3.0)
    assert ready.bits == bit(0, 2)
    ready.sample(AX=-1.5, expected=-3.0, DEMAND=1.0, MOTOR=(256.0, 0.0, 128.0, 0.0))
    assert ready.state[REPORTED] == 1.5 / 16
    assert opposing_torque(ready.state) == (256.0, 0.0, 128.0, 0.0)
    ready.sample(times=9)
    assert ready.bits == 0
    assert ready.state[REPORTED] == 0.0
