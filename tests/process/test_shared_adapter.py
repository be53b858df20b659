"""An adapter that one process has and all others share; one that is missing or taken is one clear line."""

import signal

import pytest
from processes import RUN_LIMIT_S, result_of, wait_until
from slcan_device import SlcanDevice, SlcanFrame

from dbc.contract import contract
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bench.share import ShareError, serve_share
from hil.bus.bus import BusError
from hil.bus.channel import bench_channel, shared_channel
from hil.bus.open import open_bus

pytest.importorskip("serial", reason="python-can's slcan needs pyserial")
VEHICLE = BusName.VEHICLE


@pytest.fixture
def device():
    with SlcanDevice() as device:
        yield device


@pytest.fixture
def spec(device):
    return f"slcan:{device.port},sleep_after_open=0"


@pytest.mark.slow
def test_a_run_over_an_adapter_loses_no_frame(start, brakebench, device, spec, short):
    bench = start("run", short, "--bus", spec, "--transmit", "--json", "--out", "out")
    result = result_of(bench, (0, 4))
    assert (result["frames_lost"], result["frames_corrupt"]) == (0, 0)
    assert set(result["link_states"]) <= {"tx_overflow"}  # a busy machine's driver thread comes too late
    assert result["bus"] == spec
    sent = [int(line[1:4], 16) for line in device.commands if line[:1] == "t"]
    refused = result["link_states"].get("tx_overflow", 0)
    assert len(sent) + refused >= 0.99 * result["frames_sent"]  # those of the last moment may be on their way
    assert {message.can_id for message in contract(VEHICLE).sent_by("ECU")} <= set(sent)
    assert {message.can_id for message in contract(VEHICLE).sent_by("SENSORS", "IWM")} <= set(sent)


@pytest.mark.slow
def test_frames_and_link_events_pass_with_their_times_and_a_second_owner_is_refused(start):
    device = SlcanDevice()  # it is unplugged here
    spec = f"slcan:{device.port},sleep_after_open=0"
    channel = shared_channel(spec)
    assert bench_channel(channel) == bench_channel(spec)
    share = start("share", "--bus", spec, "--transmit")
    assert f"is {channel} for all others" in share.stderr.readline()
    with open_bus(channel, VEHICLE) as one, open_bus(channel, VEHICLE) as other:
        one.send([Frame(VEHICLE, 0x123, b"\x01")])
        assert [frame.can_id for frame in other.receive(5.0)] == [0x123]
        assert device.receive(RUN_LIMIT_S) == SlcanFrame(0x123, b"\x01")
        device.send(SlcanFrame(0x1ABCDEF0, b"\x02", extended=True))
        heard = one.receive(5.0)
        assert [(frame.can_id, frame.data, frame.extended) for frame in heard] == [(0x1ABCDEF0, b"\x02", True)]
        assert [frame.time_ns for frame in other.receive(5.0)] == [heard[0].time_ns]
        with pytest.raises(BusError, match=rf"busy, process {share.pid} has it, .* brakebench share --bus slcan:"):
            open_bus(spec, VEHICLE)
        device.close()
        told = []

        def lost():
            told.extend(item for item in one.receive(0.1) if isinstance(item, LinkEvent))
            return LinkState.DISCONNECTED in [event.state for event in told]

        wait_until(lost, "the lost link", 30)
        share.send_signal(signal.SIGINT)
        words = share.communicate(timeout=RUN_LIMIT_S)[1]
    assert "1 frames sent on slcan:" in words
    assert "disconnected" in words


@pytest.mark.slow
def test_what_the_sharer_itself_lost_of_the_loopback_is_said(start, device, spec):
    share = start("share", "--bus", spec, "--transmit")
    share.stderr.readline()
    with open_bus(shared_channel(spec), VEHICLE) as one:
        share.send_signal(signal.SIGSTOP)
        for _ in range(200):  # more than its queue holds
            one.send([Frame(VEHICLE, 0x123, b"\x01")] * 64)
        share.send_signal(signal.SIGCONT)
        one.send([Frame(VEHICLE, 0x124, b"\x02")])
        wait_until(
            lambda: any(line.startswith("t124") for line in device.commands) or share.poll(), "the last frame", 30
        )
        share.send_signal(signal.SIGINT)
        words = share.communicate(timeout=RUN_LIMIT_S)[1]
    assert f"{shared_channel(spec)}: rx_overflow (" in words


@pytest.mark.parametrize(
    ("bus", "words"),
    [
        ("slcan:/dev/no-such-port", "could not open port /dev/no-such-port: there is none; ports here: "),
        ("slcan:/dev/null", "/dev/null is no serial port"),
        ("slcan:0", "expected the path of a serial port, such as slcan:/dev/ttyACM0, got 0"),
        ("kvaser:0", "the driver of kvaser is not here; take the kernel's: sudo modprobe kvaser_usb"),
        ("pcan:PCAN_USBBUS1", "the driver of pcan is not here"),
        ("vector:0", "python-can opens vector on Windows only"),
        ("socketcand:0", "missing 2 required positional arguments: 'host' and 'port'; give them as options"),
    ],
)
def test_why_an_adapter_does_not_open_is_said_with_what_mends_it(bus, words):
    with pytest.raises(BusError) as error:
        open_bus(bus, VEHICLE)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_a_run_on_an_adapter_that_is_not_there_says_so_in_one_line_and_leaves_nothing(brakebench, tmp_path):
    done = brakebench("run", "--bus", "kvaser:0", "--transmit", "--out", "out", check=2)
    assert "brakebench: bus kvaser:0: the driver of kvaser is not here; " in done.stderr
    assert not (tmp_path / "out").exists()


def test_what_everybody_can_join_is_not_shared(channel):
    with pytest.raises(ShareError, match="any number of processes"):
        serve_share(channel)
