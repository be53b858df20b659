"""``brakebench record --trigger`` on a real bus."""

import signal

from processes import RUN_LIMIT_S, wait_until

from dbc.contract import encode, spec_of
from dbc.frame import BusName, Frame
from dbc.messages import BrakeMode, BrakeStatus
from hil.bus.open import open_bus
from hil.log.read import read_log

STATUS = spec_of(BrakeStatus).can_id


def status(faults):
    return Frame(BusName.VEHICLE, STATUS, encode(BrakeStatus(BrakeMode.NORMAL, faults, 0.0, 0.0)))


def waiting(start, *arguments):
    process = start("record", "trip.log", *arguments)
    wait_until(lambda: "waiting for" in process.stderr.readline(), "that it waits")
    return process


def test_it_writes_what_surrounds_a_fault_and_ends_after_the_file(start, channel, tmp_path):
    condition = "BRAKE_STATUS.ACTIVE_FAULTS & PEDAL_1"
    around = ("--before", "2", "--after", "0.1", "--count", "1")
    with open_bus(channel, BusName.VEHICLE) as bus:
        process = waiting(start, "--bus", channel, "--trigger", condition, *around)
        bus.send([status(0), status(2), status(1)])
        _, err = process.communicate(timeout=RUN_LIMIT_S)
    assert process.returncode == 0, err
    assert "triggered 1 times, 1 files written; heard 3 frames" in err
    frames = read_log(tmp_path / "trip-1.log").frames
    assert frames.can_id.tolist() == [STATUS] * 3


def test_ctrl_c_before_any_trigger_says_so(start, channel, tmp_path):
    with open_bus(channel, BusName.VEHICLE) as bus:
        for count, code in ((), 0), (("--count", "1"), 5):
            process = waiting(start, "--bus", channel, "--trigger", "0x7E8", *count)
            bus.send([status(0)])
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=RUN_LIMIT_S)
            assert process.returncode == code, err
            assert "never triggered, nothing written; heard" in err
    assert not list(tmp_path.glob("trip*"))


def test_wrong_use_is_said(brakebench, channel):
    done = brakebench("record", "trip.log", "--bus", channel, "--before", "0", check=2)
    assert "--before without --trigger" in done.stderr
    done = brakebench("record", "trip.log", "--bus", channel, "--trigger", "BRAKE_STATUS.FAULTS != 0", check=2)
    assert "did you mean ACTIVE_FAULTS" in done.stderr
