"""What is beyond all limits, the order of the parameters, and the verdict as the supervision takes it."""

from dataclasses import fields, replace
from math import inf, nan

import pytest
from plausibility_samples import LIMITS, beyond, one, same

from ecu.law.joint.layout import (
    ASKED_MOTOR,
    ASKED_PRESSURE,
    AVAILABLE,
    AX,
    AY,
    DEMAND,
    INPUTS,
    MOTOR,
    PRESSURE,
    STEER,
    WHEEL,
    YAW_RATE,
)
from ecu.law.plausibility import layout
from ecu.law.plausibility.judge import initial_state, judge_parameters, opposing_torque, plausibility_of
from ecu.law.types import PLAUSIBLE

TABLE = {"AX": 500.0, "AY": 500.0, "YAW_RATE": 50.0, "STEER": 200.0}


@pytest.mark.parametrize("name", TABLE)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_beyond_all_limits_is_no_value(judged, name, sign):
    place = {"AX": AX, "AY": AY, "YAW_RATE": YAW_RATE, "STEER": STEER}[name]
    for value, there in ((TABLE[name], True), (beyond(TABLE[name]), False), (inf, False)):
        judged.state = initial_state()
        judged.sample(**{name: sign * value})
        assert (judged.z[place] == sign * value) == there
        assert sum(judged.z != judged.z) == (not there)  # nothing else is lost


@pytest.mark.parametrize("i", range(4))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_wheels_pressures_and_motors_beyond_all_limits_are_missing_and_no_fault(judged, i, sign):
    """Just within, they are values, and wrong."""
    for value, fault in ((5000.0, True), (beyond(5000.0), False), (inf, False)):
        judged.state = initial_state()
        judged.sample(times=3, WHEEL=one(i, sign * value, 80.0))
        assert judged.bits == (1 << layout.WHEEL_BIT + i if fault else 0)
        assert same(judged.four(WHEEL), one(i, nan, 80.0))
    for value, fault in ((5e8, True), (beyond(5e8), False), (inf, False)):
        judged.state = initial_state()
        judged.sample(times=5, PRESSURE=one(i, sign * value, 1e5))
        assert judged.bits == (1 << layout.PRESSURE_BIT + i if fault else 0)
        assert (judged.four(PRESSURE), judged.hold) == ((1e5,) * 4, 1.0)
    for value, there in ((2e4, True), (beyond(2e4), False), (inf, False)):
        judged.state = initial_state()
        judged.sample(MOTOR=one(i, sign * value, 5.0))
        assert judged.four(MOTOR) == one(i, sign * value if there else 0.0, 5.0)
        assert judged.hold == (0.0 if there else 1.0)


def test_demands_have_no_such_limits(judged):
    judged.sample(
        DEMAND=1e9, AVAILABLE=(1e9,) * 4, ASKED_PRESSURE=(1e9,) * 4, ASKED_MOTOR=(1e9,) * 4, PRESSURE=(1e6,) * 4
    )
    assert judged.z[DEMAND] == 1e9
    for place in (AVAILABLE, ASKED_PRESSURE, ASKED_MOTOR):
        assert judged.four(place) == (1e9,) * 4
    assert not any(judged.z[:INPUTS] != judged.z[:INPUTS])


def test_each_parameter_lies_where_the_checks_look_for_it(parameters):
    """As many numbers as names, and those of the checks are all there."""
    numbers = {f.name: 1000.0 + k for k, f in enumerate(fields(LIMITS))}
    vector = judge_parameters(replace(parameters, plausibility=type(LIMITS)(**numbers)))
    names = {
        "FORGET": "forget", "HEAL_S": "heal_s", "WHEEL_S": "wheel_s", "FALL": "wheel_fall_rad_s2",
        "RISE": "wheel_rise_rad_s2", "ABOVE": "wheel_above", "ABOVE_MPS": "wheel_above_mps",
        "SPEED_MAX": "speed_max_mps", "PRESSURE_S": "pressure_s", "PRESSURE_PA": "pressure_pa",
        "PRESSURE_SHARE": "pressure_share", "PRESSURE_LAG_S": "pressure_lag_s", "MOTOR_S": "motor_s",
        "MOTOR_NM": "motor_nm", "MOTOR_SHARE": "motor_share", "MOTOR_LAG_S": "motor_lag_s",
        "MOTOR_RATE": "motor_rate_nm_s", "START_S": "motor_start_s", "RETRY_S": "motor_retry_s",
        "ACCELERATION_S": "acceleration_s", "ACCELERATION": "acceleration_mps2",
        "ACCELERATION_SHARE": "acceleration_share", "ACCELERATION_LAG_S": "acceleration_lag_s",
        "JUMP": "acceleration_jump_mps2", "ROUGH": "acceleration_rough_mps2",
    }  # fmt: skip
    for name, parameter in names.items():
        assert vector[getattr(layout, name)] == numbers[parameter], name
    v = parameters.vehicle
    assert vector[layout.RADIUS] == v.rolling_radius_m
    assert vector[layout.MASS] == v.mass_kg
    assert vector[layout.ARM] == v.force_arm_m
    assert vector[layout.MOTOR_MAX] == parameters.motor.torque_max_nm
    assert len(vector) == len(names) + 4


def test_the_verdict_as_the_supervision_takes_it():
    nothing = plausibility_of(0, (False,) * 4, False, (False, False), False)
    assert nothing == PLAUSIBLE
    for i in range(4):
        alone = one(i, True, False)
        assert plausibility_of(1 << i, (False,) * 4, False, (False,) * 2, False) == PLAUSIBLE._replace(
            wheel_speed=alone
        )
        assert plausibility_of(0, alone, False, (False,) * 2, False) == PLAUSIBLE._replace(wheel_speed=alone)
        assert plausibility_of(16 << i, (False,) * 4, False, (False,) * 2, False) == PLAUSIBLE._replace(pressure=alone)
        assert plausibility_of(256 << i, (False,) * 4, False, (False,) * 2, False) == PLAUSIBLE._replace(
            motor_torque=alone
        )
    stuck = PLAUSIBLE._replace(acceleration=True)
    assert plausibility_of(1 << 12, (False,) * 4, False, (False,) * 2, False) == stuck
    assert plausibility_of(0, (False,) * 4, True, (False,) * 2, False) == stuck
    everything = plausibility_of(0x1FFF, (False,) * 4, False, (True, False), True)
    assert everything == ((True,) * 4, (True,) * 4, (True,) * 4, (True, False), True, True)


def test_the_state_begins_with_zeros_and_opposing_torques_are_read_from_it():
    state = initial_state()
    assert state.shape == (layout.SIZE,)
    assert not state.any()
    state[layout.OPPOSING : layout.OPPOSING + 4] = 1.0, 2.0, 3.0, 4.0
    assert opposing_torque(state) == (1.0, 2.0, 3.0, 4.0)


def test_what_was_believed_of_reports_ends_where_no_motor_is_excluded(judged):
    judged.state[layout.REPORTED] = 1.0
    judged.state[layout.MOTOR_LEVEL : layout.MOTOR_LEVEL + 4] = 0.01
    assert judged.sample().state[layout.REPORTED] == 0.0
    assert judged.state[layout.BEGUN] == 1.0
