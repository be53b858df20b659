"""Budgets in ticks of 10 ms. A frame sent in one tick is received in the next."""

import math

import pytest

from dbc.bench_messages import StimulusEcu
from dbc.contract import spec_of
from dbc.frame import BusName, LinkEvent, LinkState
from dbc.messages import (
    BatteryStatus,
    BodyMotion,
    BrakeMode,
    BrakePedal,
    BrakeStatus,
    EhbDemandFront,
    EhbPressureFront,
    EhbState,
    Fault,
    MotorDemandFront,
    MotorDemandRear,
    MotorStatusFront,
    MotorStatusRear,
    Steering,
    WheelSpeedFront,
    WheelSpeedRear,
)


def sent(frames, message_type):
    spec = spec_of(message_type)
    found = [spec.decode(f.data) for f in frames if (f.bus, f.can_id) == (spec.bus, spec.can_id)]
    return found[-1] if found else None


def mode(rig):
    return rig.node.memory.modes.mode


def until(rig, condition, limit=200):
    """Ticks until the condition on the frames holds."""
    for n in range(1, limit + 1):
        if condition(rig.step()):
            return n
    raise AssertionError("never")


def front_motor(frames):
    return sent(frames, MotorDemandFront).torque_demand_fl_nm


def front_pressure(frames):
    return sent(frames, EhbDemandFront).pressure_demand_fl_pa


def test_starts_silent_and_goes_straight_to_normal_after_ten_valid_frames_of_each(rig):
    ticks = 0
    while mode(rig) == BrakeMode.INIT:
        frames = rig.step()
        if mode(rig) == BrakeMode.INIT:
            assert front_pressure(frames) is None
            assert front_motor(frames) is None
        ticks += 1
    # the slowest is BATTERY_STATUS: one frame to establish the sequence, ten valid ones, 100 ms each
    assert ticks == 102
    assert mode(rig) == BrakeMode.NORMAL


@pytest.mark.parametrize("kind", [BrakePedal, WheelSpeedFront, MotorStatusRear, Steering, BatteryStatus])
def test_stays_in_init_while_a_message_is_missing(rig, kind):
    rig.car.silent.add(kind)
    rig.step(300)
    assert mode(rig) == BrakeMode.INIT


@pytest.mark.parametrize("lost_in_row", [1, 2])
def test_up_to_two_lost_frames_change_nothing(normal_rig, lost_in_row):
    for _ in range(lost_in_row):
        normal_rig.step()
        normal_rig.waiting = []  # sent, and lost on the way
    for _ in range(20):
        normal_rig.step()
        assert mode(normal_rig) == BrakeMode.NORMAL


@pytest.mark.parametrize(
    ("kind", "fault", "expected"),
    [
        (WheelSpeedFront, Fault.WHEEL_SPEED_FRONT, BrakeMode.DEGRADED),
        (WheelSpeedRear, Fault.WHEEL_SPEED_REAR, BrakeMode.DEGRADED),
        (BodyMotion, Fault.BODY_MOTION, BrakeMode.DEGRADED),
        (EhbPressureFront, Fault.EHB_PRESSURE_FRONT, BrakeMode.DEGRADED),
        (MotorStatusFront, Fault.MOTOR_FRONT, BrakeMode.DEGRADED),
        (Steering, Fault.STEERING, BrakeMode.DEGRADED),
        (BrakePedal, Fault.PEDAL_1 | Fault.PEDAL_2, BrakeMode.SAFE_STOP),
    ],
)
def test_silence_is_detected_within_forty_milliseconds(normal_rig, kind, fault, expected):
    normal_rig.car.silent.add(kind)
    # the step below still receives the last frame, sent 10 ms before: detection counts from that sending
    ticks_after_reception = until(normal_rig, lambda _: mode(normal_rig) != BrakeMode.NORMAL) - 1
    assert 1 + ticks_after_reception <= 4
    assert mode(normal_rig) == expected
    status = sent(normal_rig.step(), BrakeStatus) or sent(normal_rig.step(), BrakeStatus)
    assert status.active_faults == int(fault)


def test_battery_silence_is_detected_within_three_cycles(normal_rig):
    normal_rig.car.silent.add(BatteryStatus)
    assert until(normal_rig, lambda _: mode(normal_rig) == BrakeMode.FRICTION_ONLY) <= 32


def test_motor_demand_is_zero_within_fifty_milliseconds_and_friction_takes_over(normal_rig):
    normal_rig.car.blending = 0.7
    frames = normal_rig.step(5)
    before = front_pressure(frames)
    assert front_motor(frames) < -100.0
    normal_rig.car.silent.add(MotorStatusFront)
    ticks = until(normal_rig, lambda f: front_motor(f) == 0.0)
    assert ticks <= 5
    frames = normal_rig.step()
    assert front_pressure(frames) > 2.0 * before
    assert sent(frames, MotorDemandRear).torque_demand_rl_nm < -50.0


def test_a_failed_motor_is_left_alone_in_the_tick_that_says_so(normal_rig):
    normal_rig.car.blending = 0.7
    normal_rig.step(5)
    normal_rig.car.failed_wheels = {0}
    normal_rig.step()
    frames = normal_rig.step()
    demand = sent(frames, MotorDemandFront)
    assert demand.torque_demand_fl_nm == 0.0
    assert demand.torque_demand_fr_nm < -100.0
    assert mode(normal_rig) == BrakeMode.DEGRADED


@pytest.mark.parametrize(
    "kinds",
    [
        {MotorStatusFront, MotorStatusRear},
        {WheelSpeedFront, WheelSpeedRear},
        {BatteryStatus},
        {BodyMotion},
        {EhbPressureFront},
    ],
)
def test_losing_inputs_never_releases_pressure(normal_rig, kinds):
    normal_rig.car.blending = 0.7
    before = front_pressure(normal_rig.step(5))
    normal_rig.car.silent |= kinds
    for _ in range(100):
        pressure = front_pressure(normal_rig.step())
        assert pressure >= before - 1e3


def test_without_pedal_the_last_demand_stands_for_200_ms_and_is_then_handed_over(normal_rig):
    normal_rig.car.blending = 0.7
    normal_rig.step(5)
    normal_rig.car.silent.add(BrakePedal)
    until(normal_rig, lambda _: mode(normal_rig) == BrakeMode.SAFE_STOP)
    held = front_pressure(normal_rig.step())
    assert held > 20e5
    ticks = until(normal_rig, lambda f: front_pressure(f) is None)
    assert 1 + ticks == 20  # 200 ms after the tick of detection
    frames = normal_rig.step()
    assert front_motor(frames) == 0.0
    # the pedal comes back: one mode at a time, one second apart
    normal_rig.car.silent.clear()
    first = until(normal_rig, lambda f: front_pressure(f) is not None)
    assert 10 <= first <= 110
    assert mode(normal_rig) == BrakeMode.FRICTION_ONLY
    second = until(normal_rig, lambda _: mode(normal_rig) == BrakeMode.DEGRADED)
    third = until(normal_rig, lambda _: mode(normal_rig) == BrakeMode.NORMAL)
    assert second == 100
    assert third == 100


def test_upgrade_needs_ten_valid_frames_after_the_fault(normal_rig):
    normal_rig.step(200)
    normal_rig.car.silent.add(Steering)
    until(normal_rig, lambda _: mode(normal_rig) == BrakeMode.DEGRADED)
    normal_rig.car.silent.clear()
    # one tick of latency, a frame or two to establish the sequence, ten valid ones
    assert 11 <= until(normal_rig, lambda _: mode(normal_rig) == BrakeMode.NORMAL) <= 14


def test_one_pedal_channel_is_enough_in_degraded_mode(normal_rig):
    before = front_pressure(normal_rig.step())
    normal_rig.car.pedal = (None, 0.6)
    normal_rig.step(2)
    assert mode(normal_rig) == BrakeMode.DEGRADED
    assert front_pressure(normal_rig.step()) == pytest.approx(before)


def test_disagreeing_channels_brake_by_the_larger(normal_rig):
    before = front_pressure(normal_rig.step())
    normal_rig.car.pedal = (0.6, 0.1)
    normal_rig.step(10)
    assert mode(normal_rig) == BrakeMode.DEGRADED
    assert front_pressure(normal_rig.step()) == pytest.approx(before)


def test_no_motor_torque_beside_a_brake_on_its_own_map(normal_rig):
    normal_rig.car.blending = 0.7
    normal_rig.step(5)
    normal_rig.car.ehb_state = EhbState.OWN_PEDAL_MAP
    normal_rig.step()
    frames = normal_rig.step()
    assert front_motor(frames) == 0.0
    normal_rig.step(40)
    assert mode(normal_rig) == BrakeMode.FRICTION_ONLY


@pytest.mark.parametrize("state", [LinkState.BUS_OFF, LinkState.DISCONNECTED])
def test_a_dead_link_means_friction_only_until_it_is_back(normal_rig, state):
    normal_rig.step(1, extra=[LinkEvent(BusName.VEHICLE, state)])
    assert mode(normal_rig) == BrakeMode.FRICTION_ONLY
    normal_rig.step(300)
    assert mode(normal_rig) == BrakeMode.FRICTION_ONLY
    normal_rig.step(1, extra=[LinkEvent(BusName.VEHICLE, LinkState.RESTARTED)])
    assert mode(normal_rig) == BrakeMode.DEGRADED


def test_five_corrupt_frames_in_a_row_mean_friction_only(normal_rig):
    spec = spec_of(Steering)
    corrupt = None
    for n in range(1, 6):
        normal_rig.step()
        frames = [f for f in normal_rig.waiting if f.can_id != spec.can_id]
        bad = [f for f in normal_rig.waiting if f.can_id == spec.can_id]
        corrupt = bad[0]._replace(data=bytes([bad[0].data[0] ^ 1]) + bad[0].data[1:])
        normal_rig.waiting = [*frames, corrupt]
        assert mode(normal_rig) != BrakeMode.FRICTION_ONLY, n
    normal_rig.step()
    assert mode(normal_rig) == BrakeMode.FRICTION_ONLY


def test_stimulus_sets_the_blending_factor_and_keeps_it_when_silent(normal_rig):
    normal_rig.car.blending = 0.5
    frames = normal_rig.step(4)
    assert sent(frames, BrakeStatus) is not None or sent(normal_rig.step(), BrakeStatus) is not None
    half = front_motor(normal_rig.step())
    normal_rig.car.silent.add(StimulusEcu)
    assert front_motor(normal_rig.step(20)) == pytest.approx(half)
    assert not math.isnan(half)
