"""Recording around a trigger, in virtual time: what is written, what is kept, and what is said."""

import pytest

from dbc.contract import encode, spec_of
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.messages import BrakeMode, BrakeStatus
from hil.bench.recorder import FLUSH_PERIOD_NS, RecorderError
from hil.bench.trigger import Trigger
from hil.bench.trigger_recorder import TriggerRecorder
from hil.log.read import read_log
from hil.log.signals.databases import Databases

MS = 1_000_000
S = 1000 * MS
STEP_NS = 10 * MS


class Bench:
    """A recorder that hears BRAKE_STATUS every 10 ms, with faults at some times."""

    def __init__(self, path, before_s=0.5, after_s=0.3, conditions=("BRAKE_STATUS.ACTIVE_FAULTS != 0",), **options):
        self.now_ns = 0
        self.items = []
        self.said = []
        trigger = Trigger(conditions, Databases.own())
        around_ns = round(before_s * S), round(after_s * S)
        self.recorder = TriggerRecorder(path, [self], trigger, *around_ns, self.said.append, epoch_ns=0, **options)

    def receive(self, timeout_s):
        items, self.items = self.items, []
        return items

    def run(self, until_s, faults_s=()):
        while self.now_ns < until_s * S:
            self.now_ns += STEP_NS
            faults = int(any(abs(self.now_ns - at * S) < STEP_NS / 2 for at in faults_s))
            data = encode(BrakeStatus(BrakeMode.NORMAL, faults, 0.0, 0.0))
            self.items.append(Frame(BusName.VEHICLE, spec_of(BrakeStatus).can_id, data, self.now_ns))
            if self.now_ns % FLUSH_PERIOD_NS == 0:
                self.recorder.flush(self.now_ns)


def times_ms(path):
    times = read_log(path).frames.time_ns // MS
    assert (times[1:] - times[:-1] == 10).all()  # nothing is missing, nothing twice
    return int(times[0]), int(times[-1])


@pytest.fixture
def path(tmp_path):
    return tmp_path / "trip.log"


def test_a_file_holds_what_was_before_and_after_to_a_flush(path, tmp_path):
    bench = Bench(path)
    bench.run(3.0, faults_s=[1.55])
    bench.recorder.close(bench.now_ns)
    assert [one.name for one in tmp_path.iterdir()] == ["trip-1.log"]
    first, last = times_ms(tmp_path / "trip-1.log")
    flush = FLUSH_PERIOD_NS // MS
    assert 1050 - flush <= first <= 1050
    assert 1850 <= last <= 1850 + flush
    assert bench.said == [
        "trigger 1: BRAKE_STATUS.ACTIVE_FAULTS != 0 (BRAKE_STATUS.ACTIVE_FAULTS is 1); "
        f"{tmp_path / 'trip-1.log'} begins 0.50 s before it"
    ]


def test_a_trigger_within_a_file_is_counted_and_a_later_one_gets_its_own_with_its_past(path, tmp_path):
    bench = Bench(path, most_files=2)
    bench.run(4.0, faults_s=[1.5, 1.7, 2.0])
    assert (bench.recorder.triggers, [one.name for one in bench.recorder.files]) == (3, ["trip-1.log", "trip-2.log"])
    assert bench.recorder.done
    assert times_ms(tmp_path / "trip-2.log")[0] <= 1500  # overlaps the first: each file is whole


def test_two_triggers_in_one_flush(path):
    bench = Bench(path, before_s=0.0, after_s=0.0, conditions=["0x130"])
    bench.run(0.02)
    assert (bench.recorder.triggers, len(bench.recorder.files)) == (2, 2)


def test_the_last_file_ends_though_its_frame_keeps_coming(path, tmp_path):
    bench = Bench(path, before_s=0.0, after_s=0.1, conditions=["BRAKE_STATUS"], most_files=1)
    bench.run(FLUSH_PERIOD_NS / S)
    assert not bench.recorder.done
    bench.run(1.0)
    assert bench.recorder.done
    bench.recorder.close(bench.now_ns)
    assert [one.name for one in tmp_path.iterdir()] == ["trip-1.log"]
    assert 110 <= times_ms(tmp_path / "trip-1.log")[1] <= 110 + FLUSH_PERIOD_NS // MS
    assert len(bench.said) == 1  # nothing was cut short
    assert bench.recorder.triggers <= (110 * MS + FLUSH_PERIOD_NS) // STEP_NS  # those that are in the file


def test_a_trigger_right_at_the_begin_has_what_there_is(path):
    bench = Bench(path)
    bench.run(1.0, faults_s=[0.1])
    assert times_ms(bench.recorder.files[0])[0] == 10
    assert "begins 0.09 s before it" in bench.said[0]


def test_a_silent_bus_ends_the_file_in_time(path):
    bench = Bench(path, most_files=1)
    bench.run(1.0, faults_s=[1.0])
    assert not bench.recorder.done
    bench.recorder.flush(bench.now_ns + 2 * S)
    assert bench.recorder.done


def test_a_stop_ends_the_file_and_says_what_is_missing(path):
    bench = Bench(path)
    bench.run(1.1, faults_s=[1.0])
    bench.recorder.close(bench.now_ns)
    assert bench.said[-1] == f"{bench.recorder.files[0]} ends 0.20 s early: stopped"
    assert times_ms(bench.recorder.files[0])[1] == 1100


def test_without_a_trigger_nothing_is_written(path, tmp_path):
    bench = Bench(path)
    bench.run(2.0)
    bench.recorder.close(bench.now_ns)
    assert (list(tmp_path.iterdir()), bench.recorder.triggers, bench.said) == ([], 0, [])
    assert bench.recorder.lines.frames == 200


def test_memory_holds_the_past_alone_and_never_more_than_its_limit(path):
    bench = Bench(path, before_s=0.5)
    bench.run(5.0)
    line = len("(1.000000) vehicle 130#0011223344556677\n")
    assert 50 * line <= bench.recorder._kept <= 56 * line
    assert bench.recorder._kept == sum(len(piece.text) for piece in bench.recorder._ring)
    small = Bench(path, before_s=0.5, ring_bytes=20 * line)
    small.run(5.0, faults_s=[4.0])
    assert small.recorder._kept <= 20 * line
    assert 0.25 * S < small.recorder.shortened_ns < 0.35 * S
    assert bench.recorder.shortened_ns == 0


def test_nothing_is_overwritten(path, tmp_path):
    (tmp_path / "trip-7.log").write_text("precious")
    with pytest.raises(RecorderError, match=r"trip-7.log: exists already"):
        Bench(path)
    with pytest.raises(RecorderError, match="no folder"):
        Bench(tmp_path / "none" / "trip.log")


def test_a_lost_link_makes_it_incomplete(path):
    bench = Bench(path)
    bench.items = [LinkEvent(BusName.VEHICLE, LinkState.BUS_OFF, 5, detail="bus-off")]
    with pytest.raises(RecorderError, match=r"INCOMPLETE: the vehicle bus went bus-off"):
        bench.recorder.close(0)
