"""The closed list of trouble codes, its memory, and how it is told."""

import re

import cantools

from dbc.contract import contract, database_text, spec_of
from dbc.frame import BusName, LinkEvent, LinkState
from dbc.messages import BrakeMode, BrakeStatus, BrakeTroubleCode, Fault, MotorStatusFront, Steering, TroubleStatus
from ecu.law.trouble_codes import CODES
from ecu.parameters.control import SupervisionParameters
from ecu.parameters.plausibility import PlausibilityParameters

DATABASE = cantools.database.load_string(database_text(BusName.VEHICLE), database_format="dbc")


def test_numbers_and_names_are_unique_and_those_of_the_database():
    signal = DATABASE.get_message_by_name("BRAKE_TROUBLE_CODE").get_signal_by_name("TROUBLE_CODE")
    names = {code.number: code.name.upper() for code in CODES}
    assert len(names) == len({code.name for code in CODES}) == len(CODES) < 256
    assert {raw: str(name) for raw, name in signal.choices.items()} == {0: "NONE", **names}


def test_every_code_shows_as_a_fault_and_has_a_reaction():
    known = {*SupervisionParameters.__dataclass_fields__, *PlausibilityParameters.__dataclass_fields__}
    for code in CODES:
        assert code.fault, code.name
        assert BrakeMode.DEGRADED <= code.reaction <= BrakeMode.SAFE_STOP
        for name in re.findall(r"{(\w+)}", code.debounce + code.healing):
            assert name in known, code.name
    assert {fault for fault in Fault if fault} == {f for code in CODES for f in code.fault}


def told(rig, ticks):
    """Trouble codes on the wire."""
    spec = spec_of(BrakeTroubleCode)
    frames = [f for _ in range(ticks) for f in rig.step() if (f.bus, f.can_id) == (spec.bus, spec.can_id)]
    return [spec.decode(frame.data) for frame in frames]


def test_without_trouble_the_wire_says_none(normal_rig):
    assert set(told(normal_rig, 50)) == {BrakeTroubleCode(0, TroubleStatus.NONE, 0, 0, 0)}
    assert normal_rig.node.trouble_codes == ()


def test_the_memory_keeps_what_was_and_tells_one_after_the_other(normal_rig):
    start = normal_rig.tick
    for _ in range(2):
        normal_rig.car.silent.add(Steering)
        normal_rig.step(20)
        normal_rig.car.silent.clear()
        normal_rig.step(200)
    normal_rig.car.failed_wheels = {0}
    normal_rig.step(5)
    steering, motor = normal_rig.node.trouble_codes
    assert (steering.code.name, steering.active, steering.occurrences) == ("steering_lost", False, 2)
    assert (motor.code.name, motor.active, motor.occurrences) == ("motor_fl_failed", True, 1)
    assert 0.0 <= steering.first_s - 0.01 * start <= 0.05
    assert 2.2 <= steering.last_s - steering.first_s <= 2.45  # the second time, until its next frame
    freeze = steering.freeze_frame
    assert freeze.mode == BrakeMode.NORMAL
    assert 15.0 < freeze.speed_mps < 25.0
    assert freeze.demanded_deceleration_mps2 > 3.0
    assert freeze.pedal[0] == freeze.pedal[1] > 0.59
    cycle = told(normal_rig, 40)
    assert {(m.code_index, m.trouble_code, m.status, m.occurrences, m.stored_codes) for m in cycle} == {
        (0, steering.code.number, TroubleStatus.STORED, 2, 2),
        (1, motor.code.number, TroubleStatus.ACTIVE, 1, 2),
    }
    assert [m.code_index for m in cycle] in ([0, 1, 0, 1], [1, 0, 1, 0])


def test_what_is_not_there_at_the_start_is_no_trouble_before_the_time_for_it(parameters, rig):
    rig.car.silent.add(MotorStatusFront)
    ticks = round(parameters.supervision.start_tolerated_s / 0.01)
    rig.step(ticks - 1)
    assert rig.node.trouble_codes == ()
    rig.step(3)
    assert [t.code.name for t in rig.node.trouble_codes] == ["motor_front_lost"]
    assert rig.node.memory.modes.mode == BrakeMode.INIT


def test_the_link_has_its_code_and_the_database_its_message(normal_rig):
    normal_rig.step(1, extra=[LinkEvent(BusName.VEHICLE, LinkState.BUS_OFF)])
    assert [t.code.name for t in normal_rig.node.trouble_codes] == ["link_down"]
    status = spec_of(BrakeStatus)
    frames = [f for _ in range(2) for f in normal_rig.step() if f.can_id == status.can_id]
    assert status.decode(frames[-1].data).active_faults == Fault.LINK
    assert contract(BusName.VEHICLE).by_id[320].cycle_ns == 100_000_000
