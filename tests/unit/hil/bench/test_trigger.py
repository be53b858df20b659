"""Conditions on live traffic: when they hold, and when they are refused."""

import pytest

from dbc.bench_messages import PlantTiming
from dbc.contract import encode, spec_of
from dbc.database import parse_database
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.messages import BrakeMode, BrakePedal, BrakeStatus, BrakeTroubleCode, TroubleStatus
from hil.bench.trigger import ConditionError, Trigger
from hil.log.signals.databases import Databases


def frame(message, time_ns):
    spec = spec_of(type(message))
    return Frame(spec.bus, spec.can_id, encode(message), time_ns)


def status(time_ns, mode=BrakeMode.NORMAL, faults=0, blending=0.5):
    return frame(BrakeStatus(mode, faults, blending, 0.0), time_ns)


def hits(conditions, *frames):
    return [hit.time_ns for hit in Trigger(conditions, Databases.own()).hear(frames)]


COURSE = [
    status(1),
    status(2, faults=3),
    status(3, faults=3),
    status(4, mode=BrakeMode.SAFE_STOP),
    status(5, faults=2, blending=None),
    status(6, blending=0.3),
]


@pytest.mark.parametrize(
    ("condition", "times"),
    [
        ("BRAKE_STATUS.ACTIVE_FAULTS != 0", [2, 5]),
        ("brake_status.active_faults==0", [1, 4, 6]),
        ("BRAKE_STATUS.ACTIVE_FAULTS & PEDAL_1", [2]),
        ("BRAKE_STATUS.ACTIVE_FAULTS & 0x2", [2, 5]),
        ("BRAKE_STATUS.MODE == SAFE_STOP", [4]),
        ("BRAKE_STATUS.MODE == 4", [4]),
        ("BRAKE_STATUS.MODE >= DEGRADED and BRAKE_STATUS.ACTIVE_FAULTS == 0", [4]),
        ("BRAKE_STATUS.BLENDING_FACTOR < 0.45", [6]),
        ("BRAKE_STATUS.BLENDING_FACTOR != 0.5", [6]),  # not available is no value
        ("BRAKE_STATUS.BLENDING_FACTOR <= 0.3", [6]),  # 60 steps of 0.005 are not quite 0.3
        ("BRAKE_STATUS.BLENDING_FACTOR > 0.3", [1]),
        ("0x130", [1, 2, 3, 4, 5, 6]),
        ("BRAKE_STATUS and BRAKE_STATUS.ACTIVE_FAULTS != 0", [2, 3, 5]),
        ("0x131", []),
    ],
)
def test_it_triggers_when_the_condition_begins_to_hold(condition, times):
    assert hits([condition], *COURSE) == times


def test_it_is_the_same_frame_by_frame():
    trigger = Trigger(["BRAKE_STATUS.ACTIVE_FAULTS != 0"], Databases.own())
    assert [hit.time_ns for one in COURSE for hit in trigger.hear([one])] == [2, 5]


def test_a_code_that_is_set_and_any_of_several_conditions():
    code = BrakeTroubleCode(0x1001, TroubleStatus.ACTIVE, 1, 1, 0)
    none = code._replace(trouble_code=0)
    frames = [frame(none, 1), frame(code, 2), frame(none, 3), status(4, faults=1)]
    trigger = Trigger(["BRAKE_TROUBLE_CODE.TROUBLE_CODE != 0", "BRAKE_STATUS.ACTIVE_FAULTS  != 0"], Databases.own())
    found = trigger.hear(frames)
    assert [hit.time_ns for hit in found] == [2, 4]
    assert found[1].text == "BRAKE_STATUS.ACTIVE_FAULTS != 0 (BRAKE_STATUS.ACTIVE_FAULTS is 1)"


def test_terms_of_both_buses():
    timing = spec_of(PlantTiming)
    both = f"BRAKE_PEDAL.PEDAL_TRAVEL_1 > 20 and {timing.name}"
    clock = Frame(BusName.BENCH, timing.can_id, bytes(timing.length), 3)
    elsewhere = clock._replace(bus=BusName.VEHICLE, time_ns=2)
    assert hits([both], frame(BrakePedal(0.5, 0.5), 1), elsewhere, clock) == [3]


def test_extended_identifiers_are_told_from_standard_ones_and_events_are_none():
    frames = [Frame(BusName.VEHICLE, 0x123, b"", 1), Frame(BusName.VEHICLE, 0x12345, b"", 2, True)]
    assert hits(["0x12345"], LinkEvent(BusName.VEHICLE, LinkState.BUS_OFF, 1), *frames) == [2]
    assert hits(["0x123"], *frames) == [1]


def test_any_database():
    foreign = parse_database(
        'BO_ 256 RPM: 4 E\n SG_ RPM : 7|16@0+ (0.25,0) [0|0] "" X\n SG_ TEMP : 16|8@1- (1,-40) [0|0] "" X\n'
    )
    trigger = Trigger(["RPM.RPM >= 3000 and RPM.TEMP < -50"], Databases(foreign))
    cold, warm = bytes.fromhex("2EE0F000"), bytes.fromhex("2EE01000")
    assert [
        h.time_ns for t, d in enumerate((warm, cold)) for h in trigger.hear([Frame(BusName.VEHICLE, 256, d, t)])
    ] == [1]


@pytest.mark.parametrize(
    ("condition", "error"),
    [
        ("", "expected MESSAGE.SIGNAL OPERATOR VALUE"),
        ("BRAKE_STATUS.MODE = 4", "expected MESSAGE.SIGNAL OPERATOR VALUE"),
        ("BRAKE_STATUS.MODE", "expected an operator and a value, as BRAKE_STATUS.MODE != 0"),
        ("BRAKE_STATUS == 4", "compares a message; name a signal, BRAKE_STATUS.CRC or"),
        ("BRAKE_STATS.MODE == 4", "no message is called 'BRAKE_STATS'; did you mean BRAKE_STATUS"),
        ("BRAKE_STATUS.FAULTS != 0", "no signal of BRAKE_STATUS is called 'FAULTS'; did you mean ACTIVE_FAULTS"),
        ("BRAKE_STATUS.MODE == STOP", "expected a number or one of INIT, NORMAL"),
        ("BRAKE_STATUS.BLENDING_FACTOR & 1", "& asks for bits"),
        ("0x130 == 1", "an identifier has no value"),
        ("0x20000000", "at most 29 bits"),
        ("BRAKE_STATUS.MODE == 4 and", "expected MESSAGE.SIGNAL OPERATOR VALUE|no message"),
    ],
)
def test_what_is_wrong_is_said(condition, error):
    with pytest.raises(ConditionError, match=error):
        Trigger([condition], Databases.own())
