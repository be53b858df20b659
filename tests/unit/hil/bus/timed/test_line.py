"""Our bench on a timed bus, and how it is named."""

import numpy as np
import pytest

from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from hil.bench.virtual import simulate
from hil.bus.bus import BusError
from hil.bus.timed.line import is_timed, open_line
from hil.rt.lockstep import Member
from hil.scenario.scenario import load_scenario

FRAME = Frame(BusName.VEHICLE, 0xA0, bytes(8))
BENCH = Frame(BusName.BENCH, 0xA0, b"bench")


class Talker:
    """Sends one frame on each bus a step and keeps what it hears."""

    def __init__(self, *frames: Frame) -> None:
        self.frames = frames
        self.heard: list[Received] = []

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        self.heard += inbox
        return list(self.frames)


def test_frames_arrive_when_they_end_on_the_wire() -> None:
    line = open_line("timed", 500_000, 1)
    talker, ear = Talker(FRAME, BENCH), Talker()
    for step in line.lockstep([Member(talker, 10_000_000), Member(ear, 100_000, 50_000)]):
        if step.now_ns >= 1_000_000:
            break
    (vehicle,) = [one for one in ear.heard if isinstance(one, Frame) and one.bus is BusName.VEHICLE]
    assert 200_000 < vehicle.time_ns < 270_000
    assert BENCH in ear.heard
    assert not talker.heard
    recorded = line.heard()
    assert [one.time_ns for one in recorded if isinstance(one, Frame)] == [0, vehicle.time_ns]


def test_a_node_hears_of_its_own_link() -> None:
    line = open_line("timed", 500_000, 1)
    lone = Talker(FRAME)
    for step in line.lockstep([Member(lone, 10_000_000)]):
        if step.now_ns >= 100_000_000:
            break
    states = [one.state for one in lone.heard if isinstance(one, LinkEvent)]
    assert states == [LinkState.NO_ACK, LinkState.ERROR_WARNING, LinkState.ERROR_PASSIVE]
    assert [one.state for one in line.heard() if isinstance(one, LinkEvent)] == states


def test_our_stop_on_a_timed_bus_is_the_same_stop() -> None:
    """Frames end later, none is lost, and the car stops within a decimetre of the stop without delays."""
    scenario = load_scenario("stop72")
    line = open_line("timed", 500_000, 1)
    ideal, timed = simulate(scenario), simulate(scenario, line=line)
    distances = [signals.get("TRUTH_MOTION.DISTANCE")[1][-1] for signals in (ideal, timed)]
    assert distances[1] == pytest.approx(distances[0], abs=0.1)
    frames = timed.decoded.recording.frames
    assert np.all(np.diff(frames.time_ns) >= 0)
    assert line.bus.errors == 0
    load = line.bus.busy_ns / line.bus.now_ns
    assert 0.3 < load < 0.394  # the analysis, with all stuff bits that frames may need, says 0.394


def test_bit_errors_are_seeded() -> None:
    def recorded(seed: int) -> list[Received]:
        line = open_line("timed,bit_error_rate=1e-4", 500_000, seed)
        for step in line.lockstep([Member(Talker(FRAME), 1_000_000), Member(Talker(), 1_000_000)]):
            if step.now_ns >= 500_000_000:
                break
        assert line.bus.errors > 1
        return line.heard()

    first, again, other = recorded(1), recorded(1), recorded(2)
    assert first == again
    assert first != other


def test_who_only_listens_acknowledges_from_its_first_frame_on() -> None:
    line = open_line("timed", 500_000, 1)
    lone, bench = Talker(FRAME), Talker()
    for step in line.lockstep([Member(lone, 10_000_000), Member(bench, 10_000_000)], listening=(1,)):
        if step.now_ns >= 50_000_000:
            bench.frames = (Frame(BusName.VEHICLE, 0xB0, bytes(8)),)
        if step.now_ns >= 100_000_000:
            break
    heard = [one for one in line.heard() if isinstance(one, Frame)]
    assert min(one.time_ns for one in heard) > 50_000_000
    assert {one.can_id for one in heard} == {0xA0, 0xB0}


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("timed:fast", "bit rate"),
        ("timed:10", "bit rate"),
        ("timed,x=1", "no option x"),
        ("timed,queue=lifo", "priority or fifo"),
        ("timed,bit_error_rate=1", "probability"),
        ("timed,bit_error_rate=often", "probability"),
        ("timed,bit_error_rate", "KEY=VALUE"),
    ],
)
def test_a_wrong_name_is_refused(spec: str, said: str) -> None:
    assert is_timed(spec)
    with pytest.raises(BusError, match=said):
        open_line(spec, 500_000, 1)


def test_names() -> None:
    line = open_line("timed:250000,queue=fifo", 500_000, 1)
    assert (line.spec, line.note) == ("timed:250000", "virtual time, 250 kbit/s, FIFO queues")
    assert not is_timed("loopback:timed")
