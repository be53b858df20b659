"""The mode and the trouble codes of one tick after the other: which input means which code, and when a mode changes."""

import math
from dataclasses import replace

import pytest

from dbc.messages import BrakeMode, Fault
from ecu.law.base_brake import PedalReading
from ecu.law.communication import ALL_CLEAN, CLEAN
from ecu.law.modes import ModeMemory, initial_modes, lost_sources, supervise, timed_out_sources
from ecu.law.trouble_codes import SOURCES, codes_of
from ecu.law.types import PLAUSIBLE, WELL, Brake, Health, Source

DT_S = 1 / 64
IN_TIME = (False,) * len(Source)
NAMES = {source: name for source, name, *_ in SOURCES}
GOOD_PEDAL = PedalReading(0.6, False, False, False)
WHEELS = ("fl", "fr", "rl", "rr")


def with_one(values, i, value):
    return tuple(value if k == i else old for k, old in enumerate(values))


class Supervision:
    """Advances the mode; ``codes``, ``mode``, ``faults``: of the last tick."""

    def __init__(self, parameters, inputs, mode=BrakeMode.NORMAL, since_upgrade_s=math.inf):
        self.p = replace(
            parameters.supervision, own_map_tolerated_s=4 * DT_S, upgrade_interval_s=64 * DT_S, frames_to_upgrade=10
        )
        self.inputs = inputs
        self.memory = initial_modes()
        if mode != BrakeMode.INIT:
            self.memory = ModeMemory(mode, (10,) * len(Source), since_upgrade_s, 0.0)

    def tick(self, times=1, timed_out=IN_TIME, streams=ALL_CLEAN, pedal=GOOD_PEDAL, plausible=PLAUSIBLE, **inputs):
        for _ in range(times):
            now = self.inputs._replace(**inputs)
            lost = lost_sources(timed_out, streams)
            self.memory, active, self.faults = supervise(
                self.memory, now, timed_out, lost, streams, pedal, plausible, self.p, DT_S
            )
            self.codes = {code.name for code in codes_of(active)}
            self.mode = self.memory.mode
        return self

    def health(self, source, **changes):
        return with_one(self.inputs.health, source, WELL._replace(**changes))


@pytest.fixture
def running(parameters, good_inputs):
    """In NORMAL for long."""
    return Supervision(parameters, good_inputs)


@pytest.fixture
def starting(parameters, good_inputs):
    return Supervision(parameters, good_inputs, BrakeMode.INIT)


def out(*sources):
    return tuple(source in sources for source in Source)


def test_a_healthy_tick_says_nothing(running):
    running.tick(times=5)
    assert (running.codes, running.mode, running.faults) == (set(), BrakeMode.NORMAL, Fault.NONE)
    assert running.memory.valid_counts == (10,) * len(Source)
    assert running.memory.own_map_s == 0.0


@pytest.mark.parametrize("source", Source)
def test_a_source_has_timed_out_at_its_limit(running, source):
    p = running.p
    limit = p.battery_timeout_s if source == Source.BATTERY else p.timeout_s
    for age, is_out in (
        (0.0, False),
        (math.nextafter(limit, 0.0), False),
        (limit, True),
        (math.inf, True),
        (math.nan, True),
    ):
        inputs = running.inputs._replace(health=running.health(source, age_s=age))
        assert timed_out_sources(inputs, p) == (out(source) if is_out else IN_TIME)
        both = with_one(inputs.health, Source.BATTERY, WELL._replace(age_s=math.inf))
        assert timed_out_sources(inputs._replace(health=both), p) == (
            out(source, Source.BATTERY) if is_out else out(Source.BATTERY)
        )


@pytest.mark.parametrize("source", Source)
def test_a_source_is_lost_where_it_has_timed_out_or_another_speaks_for_it(source):
    other = Source((source + 3) % len(Source))
    for flag, lost in (("second_sender", True), ("out_of_time", True), ("corrupted", False)):
        streams = with_one(ALL_CLEAN, source, CLEAN._replace(**{flag: True}))
        assert lost_sources(IN_TIME, streams) == (out(source) if lost else IN_TIME)
        assert lost_sources(out(other), streams) == (out(source, other) if lost else out(other))
    assert lost_sources(out(source), ALL_CLEAN) == out(source)
    assert lost_sources(out(source), (*ALL_CLEAN[:-1], CLEAN._replace(bad=1))) == out(source)


@pytest.mark.parametrize("source", Source)
def test_codes_of_frames_that_do_not_come_or_cannot_be_believed(running, parameters, good_inputs, source):
    name, memory = NAMES[source], running.memory
    for flags, timed_out, what in (
        ({}, True, {"lost"}),
        ({"corrupted": True}, False, {"corrupt"}),
        ({"corrupted": True}, True, {"corrupt", "lost"}),
        ({"second_sender": True}, False, {"second_sender"}),
        ({"second_sender": True}, True, {"second_sender"}),
        ({"out_of_time": True}, False, {"out_of_time"}),
        ({"out_of_time": True}, True, {"out_of_time"}),
        ({"out_of_time": True, "second_sender": True}, True, {"second_sender"}),
        ({"bad": 1}, False, set()),
    ):
        running.memory = memory
        streams = with_one(ALL_CLEAN, source, CLEAN._replace(**flags)) if flags else ALL_CLEAN
        running.tick(timed_out=out(source) if timed_out else IN_TIME, streams=streams)
        assert running.codes == {f"{name}_{w}" for w in what}
        assert (running.mode == BrakeMode.NORMAL) == (not what)
        assert bool(running.faults & Fault.COMMUNICATION) == bool(what - {"lost"})


FIELDS = [
    ("acceleration_x_mps2", None, Source.BODY_MOTION),
    ("acceleration_y_mps2", None, Source.BODY_MOTION),
    ("yaw_rate_rad_s", None, Source.BODY_MOTION),
    ("steering_wheel_angle_rad", None, Source.STEERING),
    ("charge_power_w", None, Source.BATTERY),
    *[
        (field, i, (front, rear)[i // 2])
        for field, front, rear in (
            ("wheel_speed_rad_s", Source.WHEEL_SPEED_FRONT, Source.WHEEL_SPEED_REAR),
            ("pressure_pa", Source.EHB_PRESSURE_FRONT, Source.EHB_PRESSURE_REAR),
            ("motor_current_a", Source.MOTOR_FRONT, Source.MOTOR_REAR),
            ("motor_available_nm", Source.MOTOR_FRONT, Source.MOTOR_REAR),
        )
        for i in range(4)
    ],
]


@pytest.mark.parametrize(("field", "i", "source"), FIELDS)
@pytest.mark.parametrize("absent", [math.nan, math.inf])
def test_a_value_that_is_not_available_is_its_sources_code_unless_that_is_lost(running, field, i, source, absent):
    value = absent if i is None else with_one(getattr(running.inputs, field), i, absent)
    running.tick(**{field: value})
    assert running.codes == {f"{NAMES[source]}_not_available"}
    assert running.mode == (BrakeMode.FRICTION_ONLY if source == Source.BATTERY else BrakeMode.DEGRADED)
    running.tick(**{field: value}, timed_out=out(source))
    assert running.codes == {f"{NAMES[source]}_lost"}


@pytest.mark.parametrize("i", range(4))
def test_a_motor_that_says_it_has_failed_unless_its_message_is_lost(running, i):
    failed = with_one((False,) * 4, i, True)
    source = (Source.MOTOR_FRONT, Source.MOTOR_REAR)[i // 2]
    assert running.tick(motor_failed=failed).codes == {f"motor_{WHEELS[i]}_failed"}
    assert running.mode == BrakeMode.DEGRADED
    assert running.tick(motor_failed=failed, timed_out=out(source)).codes == {f"{NAMES[source]}_lost"}
    other = (Source.MOTOR_REAR, Source.MOTOR_FRONT)[i // 2]
    codes = running.tick(motor_failed=failed, timed_out=out(other)).codes
    assert codes == {f"motor_{WHEELS[i]}_failed", f"{NAMES[other]}_lost"}


@pytest.mark.parametrize(
    ("axle", "name", "source"), [(0, "front", Source.EHB_PRESSURE_FRONT), (1, "rear", Source.EHB_PRESSURE_REAR)]
)
def test_a_brake_that_says_it_has_failed_unless_its_message_is_lost(running, axle, name, source):
    brake = with_one((Brake.DEMAND, Brake.DEMAND), axle, Brake.FAILED)
    assert running.tick(brake=brake).codes == {f"brake_{name}_failed"}
    assert running.tick(brake=brake, timed_out=out(source)).codes == {f"{NAMES[source]}_lost"}
    both = running.tick(brake=(Brake.FAILED, Brake.FAILED), timed_out=out(source)).codes
    assert both == {f"{NAMES[source]}_lost", f"brake_{'rear' if axle == 0 else 'front'}_failed"}


def test_what_is_implausible_has_its_code(running):
    for i, wheel in enumerate(WHEELS):
        alone = with_one((False,) * 4, i, True)
        for field, code in (
            ("wheel_speed", f"wheel_speed_{wheel}_implausible"),
            ("pressure", f"pressure_{wheel}_implausible"),
            ("motor_torque", f"motor_{wheel}_torque"),
        ):
            assert running.tick(plausible=PLAUSIBLE._replace(**{field: alone})).codes == {code}
            assert running.mode == BrakeMode.DEGRADED
    for plausible, code in (
        (PLAUSIBLE._replace(pedal=(True, False)), "pedal_1_implausible"),
        (PLAUSIBLE._replace(pedal=(False, True)), "pedal_2_implausible"),
        (PLAUSIBLE._replace(pedal_disagree=True), "pedal_disagree"),
        (PLAUSIBLE._replace(acceleration=True), "acceleration_implausible"),
    ):
        assert running.tick(plausible=plausible).codes == {code}
    assert running.tick().codes == set()


@pytest.mark.parametrize("front", [0, 1, "lost", "odd"])
@pytest.mark.parametrize("rear", [2, 3, "lost", "odd"])
def test_wheel_speeds_of_both_axles(running, front, rear):
    def tick(*parts):
        speeds, odd, timed_out = [65.0] * 4, [False] * 4, []
        for axle, part in parts:
            if part == "lost":
                timed_out.append((Source.WHEEL_SPEED_FRONT, Source.WHEEL_SPEED_REAR)[axle])
            elif part == "odd":
                odd[2 * axle] = True
            else:
                speeds[part] = math.nan
        plausible = PLAUSIBLE._replace(wheel_speed=tuple(odd))
        return running.tick(wheel_speed_rad_s=tuple(speeds), plausible=plausible, timed_out=out(*timed_out)).codes

    assert "wheel_speed_both_axles" not in tick((0, front)) | tick((1, rear))
    assert "wheel_speed_both_axles" in tick((0, front), (1, rear))
    assert running.mode == BrakeMode.FRICTION_ONLY


def test_no_motor_is_left_where_both_of_each_axle_are_gone(running):
    def tick(failed, torque=(), lost=()):
        return running.tick(
            motor_failed=tuple(i in failed for i in range(4)),
            plausible=PLAUSIBLE._replace(motor_torque=tuple(i in torque for i in range(4))),
            timed_out=out(*lost),
        ).codes

    for failed, torque, lost in (
        ({0, 1, 2, 3}, (), ()),
        ({0, 1}, {2, 3}, ()),
        ({0, 2}, {1, 3}, ()),
        ({0, 1}, (), (Source.MOTOR_REAR,)),
        ({2, 3}, (), (Source.MOTOR_FRONT,)),
        ((), (), (Source.MOTOR_FRONT, Source.MOTOR_REAR)),
    ):
        assert "motors_none" in tick(failed, torque, lost)
        assert running.mode == BrakeMode.FRICTION_ONLY
        for i in failed:
            assert "motors_none" not in tick(set(failed) - {i}, torque, lost)
        for i in torque:
            assert "motors_none" not in tick(failed, set(torque) - {i}, lost)
    assert "motors_none" not in tick((), (), (Source.MOTOR_FRONT,)) | tick((), (), (Source.MOTOR_REAR,))


@pytest.mark.parametrize("gone_1", ["", "lost", "implausible"])
@pytest.mark.parametrize("gone_2", ["", "lost", "implausible"])
def test_pedal_channels(running, gone_1, gone_2):
    pedal = PedalReading(0.6, gone_1 == "lost", gone_2 == "lost", False)
    plausible = PLAUSIBLE._replace(pedal=(gone_1 == "implausible", gone_2 == "implausible"))
    plausible = PLAUSIBLE if plausible == PLAUSIBLE else plausible
    expected = {f"pedal_{k}_{gone}" for k, gone in ((1, gone_1), (2, gone_2)) if gone}
    both = {"pedal_none"} if gone_1 and gone_2 else set()
    assert running.tick(pedal=pedal, plausible=plausible).codes == expected | both
    assert running.mode == (BrakeMode.SAFE_STOP if both else BrakeMode.DEGRADED if expected else BrakeMode.NORMAL)
    lost = running.tick(pedal=pedal, plausible=plausible, timed_out=out(Source.PEDAL)).codes
    assert lost == {"pedal_lost"} | {c for c in expected if c.endswith("implausible")}


@pytest.mark.parametrize("brake", [(Brake.OWN_MAP, Brake.DEMAND), (Brake.DEMAND, Brake.OWN_MAP)])
def test_a_brake_on_its_own_map_is_tolerated_for_a_time_and_not_while_it_is_wanted(parameters, good_inputs, brake):
    for mode, told in (
        (BrakeMode.NORMAL, True), (BrakeMode.DEGRADED, True), (BrakeMode.FRICTION_ONLY, True),
        (BrakeMode.SAFE_STOP, False), (BrakeMode.INIT, False),
    ):  # fmt: skip
        s = Supervision(parameters, good_inputs, mode, since_upgrade_s=0.0)
        s.tick(times=4, brake=brake)
        assert s.codes == set()
        s.tick(brake=brake)
        assert s.codes == ({"brake_own_map"} if told else set())
        assert s.memory.own_map_s == (5 * DT_S if told else 0.0)
        if told:
            assert s.mode == BrakeMode.FRICTION_ONLY
            assert s.tick(times=20, brake=brake).memory.own_map_s == 8 * DT_S
        assert s.tick().codes == set()
        assert s.memory.own_map_s == 0.0


def test_a_link_that_is_down(running):
    assert running.tick(link_down=True).codes == {"link_down"}
    assert (running.mode, running.faults) == (BrakeMode.FRICTION_ONLY, Fault.LINK)


def test_init_goes_straight_to_what_is_allowed_after_ten_valid_frames_of_each(starting):
    late = starting.health(Source.STEERING, fresh=False)
    for n in range(12):
        starting.tick(health=late if n < 2 else starting.inputs.health)
        assert starting.mode == (BrakeMode.INIT if n < 11 else BrakeMode.NORMAL)
    assert starting.memory.since_upgrade_s == 0.0
    assert starting.tick().memory.since_upgrade_s == DT_S


def test_init_goes_straight_down_and_tells_its_codes_before(starting):
    starting.tick(times=9, motor_failed=(True,) * 4)
    assert (starting.mode, starting.codes >= {"motors_none"}) == (BrakeMode.INIT, True)
    starting.tick(motor_failed=(True,) * 4)
    assert starting.mode == BrakeMode.FRICTION_ONLY


def test_initially_nothing_was_received():
    assert initial_modes() == ModeMemory(BrakeMode.INIT, (0,) * 10, math.inf, 0.0)


@pytest.mark.parametrize("source", Source)
def test_valid_frames_of_a_source_are_counted_in_sequence(starting, source):
    def count(*ticks):
        for changes in ticks:
            starting.tick(health=starting.health(source, **changes))
        return starting.memory.valid_counts[source]

    assert count({}, {"fresh": False}, {}) == 2
    assert count({"bad_in_row": 1, "fresh": False}) == 0
    assert starting.memory.valid_counts == tuple(0 if s == source else 4 for s in Source)
    assert count({}, {}, {}) == 3
    assert starting.tick(timed_out=out(source)).memory.valid_counts[source] == 0
    streams = with_one(ALL_CLEAN, source, CLEAN._replace(second_sender=True))
    assert count({}) == 1
    assert starting.tick(streams=streams).memory.valid_counts[source] == 0
    assert starting.memory.valid_counts[(source + 1) % 10] == 10
    assert count(*[{}] * 12) == 10
    assert starting.mode == BrakeMode.NORMAL
    assert count({"bad_in_row": 1, "fresh": False}) == 0
    assert starting.memory.valid_counts == tuple(0 if s == source else 10 for s in Source)
    assert count({}) == 1


def test_upgrades_go_one_mode_at_a_time_and_one_a_second(running):
    running.tick(timed_out=out(Source.PEDAL))
    assert running.mode == BrakeMode.SAFE_STOP  # at once
    modes = [running.tick().mode for _ in range(10 + 2 * 64)]
    assert modes.index(BrakeMode.FRICTION_ONLY) == 9  # the last change was long ago
    assert modes.index(BrakeMode.DEGRADED) == 9 + 64
    assert modes.index(BrakeMode.NORMAL) == 9 + 128
    assert running.memory.since_upgrade_s == 0.0


def test_an_upgrade_waits_for_ten_valid_frames_of_each_source_and_stops_at_what_is_allowed(running):
    failed = with_one((False,) * 4, 0, True)
    running.tick(link_down=True, motor_failed=failed)
    assert running.mode == BrakeMode.FRICTION_ONLY
    bad = running.health(Source.BATTERY, bad_in_row=1, fresh=False)
    running.tick(motor_failed=failed, health=bad)
    running.tick(times=9, motor_failed=failed)
    assert running.mode == BrakeMode.FRICTION_ONLY
    running.tick(motor_failed=failed)
    assert running.mode == BrakeMode.DEGRADED
    running.tick(times=100, motor_failed=failed)
    assert running.mode == BrakeMode.DEGRADED
    assert running.tick().mode == BrakeMode.NORMAL  # a second has passed since


def test_a_downgrade_leaves_the_time_since_the_last_upgrade_alone(parameters, good_inputs):
    s = Supervision(parameters, good_inputs, BrakeMode.DEGRADED)
    assert s.tick().mode == BrakeMode.NORMAL
    s.tick(link_down=True)
    assert (s.mode, s.memory.since_upgrade_s) == (BrakeMode.FRICTION_ONLY, DT_S)
    modes = [s.tick().mode for _ in range(64)]
    assert modes[:63] == [BrakeMode.FRICTION_ONLY] * 62 + [BrakeMode.DEGRADED]


def test_frames_of_a_slow_source_do_not_disturb_the_count(running):
    health = running.health(Source.BATTERY, fresh=False, age_s=0.09)
    running.tick(times=3, health=health)
    assert running.memory.valid_counts == (10,) * 10
    assert isinstance(Health(0.0, True, 0), tuple)


def test_all_sources_lost_at_once(running):
    running.tick(timed_out=(True,) * len(Source))
    assert running.codes >= {f"{name}_lost" for name in NAMES.values()}
    assert running.memory.valid_counts == (0,) * len(Source)


@pytest.mark.parametrize("source", Source)
def test_a_bad_frame_some_time_after_the_last_good_one_is_counted(running, source):
    for changes in ({"age_s": 0.01, "fresh": False}, {"age_s": 0.0, "fresh": True}):
        running.memory = running.memory._replace(valid_counts=(10,) * len(Source))
        running.tick(health=running.health(source, bad_in_row=1, **changes))
        assert running.memory.valid_counts[source] == 0


def test_a_source_without_a_new_frame_hides_no_other(running):
    health = with_one(running.health(Source.PEDAL, fresh=False), Source.STEERING, WELL._replace(age_s=math.inf))
    assert timed_out_sources(running.inputs._replace(health=health), running.p) == out(Source.STEERING)
