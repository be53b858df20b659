"""What a page asks for, as frames of the bench bus: read by plant, controller and the fault lines themselves."""

import pytest

from dbc.bench_messages import FaultCommand, PhysicalFault, StimulusDriver, StimulusEcu, StimulusRoad, TruthMotion
from dbc.commands import CommandReader
from dbc.contract import spec_of
from dbc.exchange import Receiver, Transmitter
from dbc.frame import BusName, Frame
from hil.bench.stimulus import Channel, StimulusNode
from hil.errors import BrakebenchError
from hil.faults.catalogue import FAULTS
from hil.faults.fault import Side
from hil.faults.wire import Commands
from hil.live.controls import CONTROLS, Controls, described

TICK_NS = 10_000_000


@pytest.fixture
def controls():
    """Controls of a page beside a bench that is heard."""
    one = Controls()
    one.hear(0, Transmitter().frames(0, [TruthMotion(20.0, 0.0, 0.0, 1)]))
    return one


def test_values_go_out_with_every_tick_until_they_are_released(controls):
    receiver = Receiver((StimulusDriver, StimulusRoad, StimulusEcu))
    controls.command(0, {"do": "set", "name": "pedal", "value": 0.5})
    controls.command(0, {"do": "set", "name": "friction_left", "value": 0.3})
    for n in range(4):
        receiver.accept(n * TICK_NS, controls.frames())
    assert receiver.latest(StimulusDriver) == (pytest.approx(0.5), None, None)
    assert receiver.latest(StimulusRoad) == (pytest.approx(0.3), None, None)
    assert receiver.latest(StimulusEcu) is None
    assert receiver.lost == receiver.corrupt == 0
    controls.command(0, {"do": "set", "name": "pedal", "value": None})
    assert [frame.can_id for frame in controls.frames()] == [spec_of(StimulusRoad).can_id]


@pytest.mark.parametrize("control", CONTROLS, ids=lambda one: one.name)
def test_every_value_reaches_its_field_at_both_ends(controls, control):
    receiver = Receiver((control.message,))
    for n, value in enumerate([control.low] * 4 + [control.high] * 2):
        controls.command(0, {"do": "set", "name": control.name, "value": value})
        receiver.accept(n * TICK_NS, controls.frames())
        if n > 2:
            got = getattr(receiver.latest(control.message), control.field)
            assert got == pytest.approx(value, abs=0.01)


def test_the_benchs_own_stimulus_gives_way_and_its_counter_goes_on(controls):
    """The bench sends blending; a person takes it over and gives it back, without a break for the controller."""
    node = StimulusNode(((0.0, 0.2),))
    receiver = Receiver((StimulusEcu,))
    mine: list[Frame] = []
    seen = []
    for n in range(60):
        now_ns = n * TICK_NS
        node.give_way(now_ns, mine)
        bench = node.step(now_ns, [])
        controls.hear(now_ns, [f for f in bench if f.bus is BusName.BENCH])
        if n == 10:
            controls.command(now_ns, {"do": "set", "name": "blending", "value": 0.8})
        if n == 40:
            controls.command(now_ns, {"do": "set", "name": "blending", "value": None})
        mine = controls.frames()
        receiver.accept(now_ns, [*bench, *mine])
        seen.append(receiver.latest(StimulusEcu))
    assert seen[8] == (pytest.approx(0.2),)
    assert seen[20] == seen[38] == (pytest.approx(0.8),)
    assert seen[-1] == (pytest.approx(0.2),)
    assert node.value(Channel.BLENDING) == 0.2


FRAME_FAULTS = [kind for kind in FAULTS if kind.side not in (Side.HOST, Side.PLANT)]


@pytest.mark.parametrize("kind", FRAME_FAULTS, ids=lambda kind: kind.name)
def test_every_fault_of_frames_is_armed_and_ended_as_by_hand(controls, kind):
    reader = Commands()
    controls.command(0, {"do": "fault", "name": kind.name, "on": kind.usual[0]})
    (command,) = reader.read(controls.frames())
    assert (command.start.kind, command.start.target.name) == (kind, kind.usual[0])
    assert controls.armed == [f"{kind.name} on {kind.usual[0]}"]
    assert controls.frames() == []
    controls.command(0, {"do": "clear", "name": kind.name, "on": kind.usual[0]})
    (command,) = reader.read(controls.frames())
    assert command.stop == kind.on(kind.usual[0]).key
    assert controls.armed == []


@pytest.mark.parametrize("kind", [kind for kind in FAULTS if kind.side is Side.PLANT], ids=lambda kind: kind.name)
def test_every_fault_of_the_car_is_switched_on_and_off(controls, kind):
    reader = CommandReader((FaultCommand,))
    for do, active in (("fault", 1), ("clear", 0)):
        controls.command(0, {"do": do, "name": kind.name, "on": "rl"})
        assert list(reader.read(controls.frames())) == [(PhysicalFault[kind.name.upper()], active, 0b0100)]


def test_the_page_is_told_of_every_fault_but_those_of_the_laboratory():
    told = described()
    assert [one["name"] for one in told["faults"]] == [kind.name for kind in FAULTS if kind.side is not Side.HOST]
    assert all(one["usual"][0] in one["targets"] for one in told["faults"])


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({}, "expected set, fault or clear"),
        ({"do": "set", "name": "handbrake", "value": 1}, "expected one of pedal"),
        ({"do": "set", "name": "pedal", "value": 1.5}, "from 0 to 1, got 1.5"),
        ({"do": "set", "name": "pedal", "value": float("nan")}, "got nan"),
        ({"do": "set", "name": "pedal", "value": 10**4000}, "got 1000"),
        ({"do": "set", "name": "pedal", "value": -float("inf")}, "got -inf"),
        ({"do": "set", "name": "pedal", "value": "1"}, "got '1'"),
        ({"do": "set", "name": "pedal", "value": True}, "got True"),
        ({"do": "set", "name": ["pedal"], "value": 1}, "expected one of"),
        ({"do": "fault", "name": "motor_ded", "on": "fl"}, "did you mean 'motor_dead'"),
        ({"do": "fault", "name": "motor_dead", "on": "xx"}, "expected fl, fr, rl, rr"),
        ({"do": "fault", "name": "silent"}, "cannot be armed on 'None'"),
    ],
)
def test_what_cannot_be_done_is_refused_and_sends_nothing(controls, asked, words):
    with pytest.raises(BrakebenchError, match=words):
        controls.command(0, asked)
    assert controls.frames() == []
    assert controls.armed == []


def test_nothing_is_commanded_where_no_bench_is_heard():
    controls = Controls()
    with pytest.raises(BrakebenchError, match="nobody is on the bench bus"):
        controls.command(0, {"do": "set", "name": "pedal", "value": 0.5})
    controls.hear(0, [Frame(BusName.BENCH, 32, bytes(8))])
    controls.command(0, {"do": "set", "name": "pedal", "value": 0.5})
    with pytest.raises(BrakebenchError, match="nobody is on the bench bus"):
        controls.command(2_000_000_000, {"do": "set", "name": "pedal", "value": 0.5})
