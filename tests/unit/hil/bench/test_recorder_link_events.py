import json

import pytest

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bench.recorder import Recorder, RecorderError
from hil.bench.result import Signals, measure
from hil.bench.result import link_events as link_events_of
from hil.bus.error_frame import error_frame, events_of, link_events
from hil.rt.clock import monotonic_ns

VEHICLE = BusName.VEHICLE


class Script:
    """A bus that gives what a test hands it."""

    def __init__(self):
        self.next = []

    def receive(self, timeout_s=0.0):
        now, self.next = self.next, []
        return now


@pytest.fixture
def bus():
    return Script()


@pytest.fixture
def recorder(tmp_path, bus):
    return Recorder(tmp_path / "r.log", [bus])


def event(state, number=1, detail="why"):
    return LinkEvent(VEHICLE, state, monotonic_ns(), number, detail)


def lines(recorder):
    return [line.split(" ", 1)[1] for line in recorder.path.read_text().splitlines()]


def test_frames_are_candump_lines_in_order_of_time(recorder, bus):
    now_ns = monotonic_ns()
    bus.next = [
        Frame(VEHICLE, 0x1ABCDE, b"\x01\xff", now_ns + 5000, True),
        Frame(BusName.BENCH, 0x20, b"", now_ns),
    ]
    recorder.close()
    assert lines(recorder) == ["bench 020#", "vehicle 001ABCDE#01FF"]
    first, second = (float(line.split()[0].strip("()")) for line in recorder.path.read_text().splitlines())
    assert second - first == pytest.approx(5e-6, abs=1.1e-6)


def test_a_recording_is_never_overwritten(recorder, bus):
    with pytest.raises(RecorderError, match="never overwrites"):
        Recorder(recorder.path, [bus])


@pytest.mark.parametrize(
    ("error_class", "data"),
    [
        (0x204, "0004000000000060"),
        (0x204, "0008000000006400"),
        (0x204, "000C000000006464"),
        (0x204, "0010000000000082"),
        (0x204, "0020000000008200"),
        (0x204, "0040000000000000"),
        (0x040, "0000000000000000"),
    ],
)
def test_a_change_of_state_is_written_as_the_kernel_said_it(recorder, bus, error_class, data):
    bus.next = link_events(error_class, bytes.fromhex(data), VEHICLE, monotonic_ns())
    recorder.flush()
    assert lines(recorder) == [f"vehicle {0x20000000 | error_class:08X}#{data}"]


@pytest.mark.parametrize("state", LinkState)
def test_every_link_event_can_be_read_back(state):
    error_class, data = error_frame(LinkEvent(VEHICLE, state, 7, 1, "whatever a driver says"))
    assert [(e.state, e.time_ns) for e in events_of(error_class, data, VEHICLE, 7)] == [(state, 7)]


def test_events_are_counted_one_by_one_and_lost_frames_once(recorder, bus):
    bus.next = [
        event(LinkState.NO_ACK, 40),
        event(LinkState.BUS_ERROR, 3),
        event(LinkState.RX_OVERFLOW, 500),
        event(LinkState.DISCONNECTED),
        event(LinkState.RESTARTED),
    ]
    recorder.close()
    assert recorder.lines.lost == 500
    signals = Signals(recorder.path)
    states = measure(signals).link_states
    assert states == {"no_ack": 40, "bus_error": 3, "rx_overflow": 1, "disconnected": 1, "restarted": 1}
    assert json.dumps(states)
    assert all(e.bus is VEHICLE for e in link_events_of(signals))


@pytest.mark.parametrize("state", [LinkState.BUS_OFF, LinkState.DISCONNECTED])
def test_a_link_that_stays_away_makes_the_recording_incomplete(recorder, bus, state):
    bus.next = [event(state)]
    recorder.flush()
    bus.next = [Frame(VEHICLE, 1, b"", monotonic_ns()), event(LinkState.NO_ACK)]
    with pytest.raises(RecorderError, match=r"INCOMPLETE: the vehicle bus .* and did not come back"):
        recorder.close()
    assert len(lines(recorder)) == 3


@pytest.mark.parametrize("state", [LinkState.BUS_OFF, LinkState.DISCONNECTED])
@pytest.mark.parametrize("back", [LinkState.RESTARTED, LinkState.ERROR_ACTIVE])
def test_a_link_that_came_back_does_not(recorder, bus, state, back):
    bus.next = [event(state), event(back)]
    recorder.close()
    assert len(lines(recorder)) == 2
