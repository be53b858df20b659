"""The recorder: what was received is in the file at once, and nothing is overwritten."""

import os

import pytest

from dbc.contract import encode, spec_of
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.messages import BrakePedal
from hil.bench.recorder import FLUSH_PERIOD_NS, Recorder, RecorderError
from hil.bus.error_frame import error_frame, events_of
from hil.log.read import read_log
from hil.log.signals.decode import decode_log


class Heard:
    """A source that gives what a test puts into it."""

    def __init__(self):
        self.items = []

    def receive(self, timeout_s):
        items, self.items = self.items, []
        return items


def pedal(counter, time_ns, bus=BusName.VEHICLE):
    return Frame(bus, spec_of(BrakePedal).can_id, encode(BrakePedal(0.5, 0.5), counter), time_ns)


def test_a_flush_puts_all_into_the_file_before_anything_is_closed(tmp_path):
    source = Heard()
    recorder = Recorder(tmp_path / "a.log", [source], epoch_ns=0)
    source.items = [pedal(i, i * 10_000_000) for i in range(5)]
    recorder.flush()
    log = decode_log(read_log(tmp_path / "a.log"))
    assert (log.frames, log.decoded, log.recording.truncated_at) == (5, 5, None)
    assert log.time_s.tolist() == pytest.approx([0.0, 0.01, 0.02, 0.03, 0.04])
    recorder.close()


def test_a_kill_costs_less_than_a_tenth_of_a_second():
    assert FLUSH_PERIOD_NS <= 50_000_000  # and a flush leaves nothing behind, see above


def test_both_buses_in_order_of_time(tmp_path):
    vehicle, bench = Heard(), Heard()
    recorder = Recorder(tmp_path / "a.log", [vehicle, bench], epoch_ns=1_000_000_000)
    vehicle.items = [pedal(0, 3000), pedal(1, 5000)]
    bench.items = [Frame(BusName.BENCH, 0x20, bytes(8), 4000), Frame(BusName.BENCH, 0x12345, b"\x01", 6000, True)]
    recorder.close()
    lines = [line.split("#")[0].split() for line in (tmp_path / "a.log").read_text().splitlines()]
    assert lines == [
        ["(1.000003)", "vehicle", "0A0"],
        ["(1.000004)", "bench", "020"],
        ["(1.000005)", "vehicle", "0A0"],
        ["(1.000006)", "bench", "00012345"],
    ]
    assert recorder.lines.frames == 4


def test_nothing_is_overwritten(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("precious")
    with pytest.raises(RecorderError, match="exists already"):
        Recorder(path, [])
    assert path.read_text() == "precious"


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(RecorderError, match="cannot be created"):
        Recorder(tmp_path / "none" / "a.log", [])


def test_a_full_disk_is_said(tmp_path):
    source = Heard()
    recorder = Recorder(tmp_path / "a.log", [source])
    source.items = [pedal(0, 0)]
    os.close(recorder._file)
    recorder._file = os.open("/dev/full", os.O_WRONLY)
    with pytest.raises(RecorderError, match=r"INCOMPLETE \(No space left on device\)"):
        recorder.flush()


@pytest.mark.parametrize("state", list(LinkState))
def test_link_events_read_back_as_what_they_were(state):
    event = LinkEvent(BusName.VEHICLE, state, 7)
    assert [e.state for e in events_of(*error_frame(event), BusName.VEHICLE, 7)] == [state]


def test_a_lost_link_makes_the_recording_incomplete(tmp_path):
    source = Heard()
    recorder = Recorder(tmp_path / "a.log", [source], epoch_ns=0)
    source.items = [LinkEvent(BusName.VEHICLE, LinkState.BUS_OFF, 5, detail="bus-off")]
    with pytest.raises(RecorderError, match=r"INCOMPLETE: the vehicle bus went bus-off"):
        recorder.close()
    other = Recorder(tmp_path / "b.log", [source], epoch_ns=0)
    source.items = [
        LinkEvent(BusName.VEHICLE, LinkState.BUS_OFF, 5),
        LinkEvent(BusName.VEHICLE, LinkState.RESTARTED, 6),
    ]
    other.close()


def test_lost_frames_are_counted(tmp_path):
    source = Heard()
    recorder = Recorder(tmp_path / "a.log", [source], epoch_ns=0)
    source.items = [LinkEvent(BusName.BENCH, LinkState.RX_OVERFLOW, 5, 12)]
    recorder.flush()
    assert recorder.lines.lost == 12
    recorder.close()
