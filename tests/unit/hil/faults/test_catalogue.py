"""The catalogue is closed and whole: names, numbers, rows, targets, words on the bus, and the page made from it."""

from pathlib import Path

import pytest

from dbc.bench_messages import PAD_FACTOR, FaultSelect
from dbc.contract import database_text
from dbc.exchange import Transmitter
from dbc.frame import BusName
from dbc.messages import BrakeMode, Fault
from hil.errors import BrakebenchError
from hil.faults.catalogue import FAMILIES, FAULTS, ROWS, fault_named, injection, names
from hil.faults.clock import jump
from hil.faults.fault import Side
from hil.faults.targets import NodeCode, target_names
from hil.faults.wire import Commands, start_messages, stop_messages
from hil.validation.doc_pages.faults_page import page
from plant.faults import MOST_PAD_SHARE, PAD_SHARE

PAGE = Path(__file__).parents[4] / "docs" / "faults.md"
ON_THE_BUS = [(kind, target) for kind in FAULTS if kind.side not in (Side.PLANT, Side.HOST) for target in kind.usual]


def test_numbers_and_names_are_one_fault_each():
    assert len({kind.number for kind in FAULTS}) == len({kind.name for kind in FAULTS}) == len(FAULTS)
    assert all(0 < kind.number < 256 and len(kind.all_parameters) <= 16 for kind in FAULTS)
    assert names() == tuple(kind.name for kind in FAULTS)
    assert sum(len(names(family)) for family in FAMILIES) == len(FAULTS)


def test_the_plant_takes_the_factor_of_pads_where_the_catalogue_has_it():
    kind = fault_named("pad_friction")
    assert (kind.number, [p.name for p in kind.all_parameters].index("factor")) == PAD_FACTOR
    (factor,) = kind.parameters
    assert (factor.default, factor.high) == (PAD_SHARE, MOST_PAD_SHARE)


def test_every_row_of_the_table_has_a_fault():
    assert {kind.row for kind in FAULTS} == set(ROWS)


def test_the_page_is_current():
    assert PAGE.read_text(encoding="utf-8") == page(), "run python -m hil.validation.doc_pages.faults_page"


@pytest.mark.parametrize("kind", FAULTS, ids=names())
def test_what_a_campaign_arms_is_what_the_fault_takes(kind):
    assert kind.usual
    for target in kind.usual:
        armed = kind.on(target, at_s=1.0, values=dict(kind.usual_values))
        expected = armed.expected
        assert expected.detect_ms is None or expected.trouble, "what is to be found has a trouble code"
        assert expected.detect_ms is not None or BrakeMode.NORMAL in expected.modes
        assert all(p.low <= p.default <= p.high for p in kind.all_parameters if p.default is not None)


def test_trouble_follows_from_the_target():
    assert injection("silent", "WHEEL_SPEED_REAR").expected.trouble == Fault.WHEEL_SPEED_REAR
    assert BrakeMode.SAFE_STOP in injection("silent", "BRAKE_PEDAL").expected.modes
    assert BrakeMode.SAFE_STOP not in injection("silent", "BODY_MOTION").expected.modes
    assert injection("motor_dead", "fl,fr").expected.trouble == Fault.MOTOR_FRONT
    assert injection("ehb_circuit_failed", "rear").expected.trouble == Fault.EHB_PRESSURE_REAR
    assert injection("silent", "BRAKE_ESTIMATE_FRONT").expected.detect_ms is None
    assert injection("lost", "BRAKE_PEDAL").expected.trouble == Fault.NONE


@pytest.mark.parametrize(
    ("arm", "says"),
    [
        (lambda: fault_named("silnt"), "no fault 'silnt'; did you mean 'silent'"),
        (lambda: names("sygnal"), "did you mean 'signal'"),
        (lambda: injection("silent", "BRAKE_PEDL"), "did you mean 'BRAKE_PEDAL'"),
        (lambda: injection("silent", "BRAKE_PEDAL.PEDAL_TRAVEL_1"), "it takes: message, node or all"),
        (lambda: injection("signal_value", "BRAKE_PEDAL"), "it takes: signal"),
        (lambda: injection("signal_not_available", "MOTOR_STATUS_FRONT.FAULT_FL"), "no value that means not available"),
        (lambda: injection("motor_dead", "left"), "expected fl, fr, rl, rr"),
        (lambda: injection("lost", "ALL", share=1.5), "share: expected a number from 0 to 1, got 1.5"),
        (lambda: injection("lost", "ALL", chance=0.5), "no parameter 'chance'"),
        (lambda: injection("lost", "ALL", on_s=0.5), "on_s and off_s belong together"),
        (lambda: injection("lost", "ALL", seed=1 << 16), "seed: expected 0 to 65535"),
    ],
)
def test_what_cannot_be_is_refused_with_what_can(arm, says):
    with pytest.raises(BrakebenchError, match=says):
        arm()


@pytest.mark.parametrize(("kind", "target"), ON_THE_BUS, ids=lambda v: getattr(v, "name", v))
def test_an_armed_fault_survives_the_bench_bus(kind, target):
    values = {p.name: p.high * 0.3 + p.low * 0.7 for p in kind.parameters} | {"for_s": 0.123456, "count": 7.0}
    armed = kind.on(target, seed=4711, values=values)
    reader, sender = Commands(), Transmitter()
    (start,) = reader.read(sender.frames(0, start_messages(armed)))
    assert start.start == armed
    assert start.start.target == armed.target
    (stop,) = reader.read(sender.frames(0, stop_messages(armed)))
    assert stop.stop == armed.key


def test_damaged_commands_are_no_commands():
    frames = Transmitter().frames(0, start_messages(injection("silent", "BRAKE_PEDAL")))
    for bit in range(64):
        data = (int.from_bytes(frames[-1].data, "little") ^ 1 << bit).to_bytes(8, "little")
        assert Commands().read([frames[-1]._replace(data=data)]) == []
    assert Commands().read([frames[-1]._replace(bus=BusName.VEHICLE)]) == []
    assert len(Commands().read(frames)) == 1


def test_numbers_of_nobody_are_passed_over():
    frames = Transmitter().frames(0, [FaultSelect(255, 1, 160, 15, 0), FaultSelect(1, 1, 7, 15, 0)])
    assert Commands().read(frames) == []


def test_nodes_have_their_names_in_the_database():
    (line,) = [line for line in database_text(BusName.BENCH).splitlines() if line.startswith("VAL_ 21 TARGET")]
    words = line.split()[3:-1]
    assert dict(zip(words[1::2], map(int, words[::2]), strict=True)) == {f'"{c.name}"': c.value for c in NodeCode}


def test_all_targets_can_be_armed():
    for kind in FAULTS:
        for name in target_names(kind.takes):
            if kind.refuses is None:
                kind.on(name)


def test_the_clock_is_left_alone_outside_the_laboratory(monkeypatch):
    monkeypatch.delenv("VCAN_LAB", raising=False)
    with pytest.raises(BrakebenchError, match="only inside the vcan laboratory"):
        jump(3600.0)
