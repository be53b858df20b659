"""A serial adapter that hangs: python-can's own slcan driver, pyserial and a real port, the device in our hands."""

import contextlib
import itertools
import signal
import uuid
from pathlib import Path

import pytest
from processes import wait_until
from slcan_device import SlcanDevice, SlcanFrame

from dbc.bench_messages import EcuTiming
from dbc.contract import contract, spec_of
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bus import BusError, open_bus
from hil.bus.channel import bench_channel

pytest.importorskip("serial", reason="python-can's slcan needs pyserial")
TIMING = spec_of(EcuTiming)
VEHICLE = BusName.VEHICLE
TAKEN_BYTES = 4096  # of a pty, at the adapter's end (n_tty): read or not, they have arrived
END_TICKS = 150  # of 10 ms: half a second for the driver, and an interpreter that ends


@pytest.fixture
def device():
    with SlcanDevice() as device:
        yield device


@pytest.fixture
def spec(device):
    return f"slcan:{device.port},sleep_after_open=0"


def open_files(pid):
    """Names of what a process has open."""
    names = []
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(OSError):
            names.append(str(link.readlink()))
    return names


def lost(bus):
    """Frames that a bus did not take, since last asked."""
    return sum(e.number for e in bus.receive(0.01) if isinstance(e, LinkEvent) and e.state is LinkState.TX_OVERFLOW)


class Health:
    """What an ECU tells of its ticks on the bench bus."""

    def __init__(self, bus):
        self._bus = bus
        self.numbers = []

    def more(self, count):
        """Wait for so many more ticks; the numbers of all."""
        wanted = len(self.numbers) + count
        wait_until(lambda: self.hear() >= wanted, f"{count} more ticks", 60)
        return self.numbers

    def hear(self):
        """Take what was told; how many ticks in all."""
        for item in self._bus.receive(0.05):
            if isinstance(item, Frame) and item.can_id == TIMING.can_id:
                self.numbers.append(int(TIMING.decode(item.data)[0]))
        return len(self.numbers)


@pytest.fixture
def health(spec):
    with open_bus(bench_channel(spec), BusName.BENCH) as bus:
        yield Health(bus)


@pytest.mark.slow
@pytest.mark.parametrize("stop", [signal.SIGTERM, signal.SIGINT])
def test_a_node_goes_on_beside_an_adapter_that_hangs_and_ends_when_told(start, device, spec, health, stop):
    ecu = start("ecu", "--bus", spec, "--transmit")
    health.more(50)
    assert device.receive().can_id in {message.can_id for message in contract(VEHICLE).sent_by("ECU")}
    with device.stalled():
        ticks = health.more(200)  # more than the port and any queue hold
        assert all(0 < b - a < 100 for a, b in itertools.pairwise(ticks))
        ecu.send_signal(stop)
        told = len(health.numbers)
        ecu.wait(60)
        assert ecu.returncode == 0
        assert health.hear() - told < END_TICKS


@pytest.mark.slow
def test_a_node_ends_while_it_waits_for_an_adapter(start, device):
    """The driver sleeps for a minute while it opens."""
    ecu = start("ecu", "--bus", f"slcan:{device.port},sleep_after_open=60")
    wait_until(lambda: device.port in open_files(ecu.pid), "the port to be opened", 60)
    ecu.terminate()
    assert ecu.wait(30) == 0


def test_what_an_adapter_did_not_take_is_counted_and_never_comes_later(device, spec):
    with open_bus(spec, VEHICLE) as bus:
        device.wait_open()
        bus.send([Frame(VEHICLE, 1, b"\x01")])
        assert device.receive() == SlcanFrame(1, b"\x01")
        refused, sent = 0, 0
        with device.stalled():
            for _ in range(300):
                bus.send([Frame(VEHICLE, 2, (sent + number).to_bytes(4, "big")) for number in range(20)])
                sent += 20
                refused += sum(e.number for e in bus.receive(0.002))
        arrived = []

        def fresh_frame_arrives():
            bus.send([Frame(VEHICLE, 3, b"")])
            with contextlib.suppress(TimeoutError):
                while not arrived or arrived[-1].can_id != 3:
                    arrived.append(device.receive(0.02))
                return True

        wait_until(fresh_frame_arrives, "a fresh frame", 20)
        kept = [int.from_bytes(frame.data, "big") for frame in arrived if frame.can_id == 2]
        assert kept == sorted(kept)
        with_the_adapter = TAKEN_BYTES // len(SlcanFrame(2, bytes(4)).line()) + 1
        assert all(number > sent / 2 for number in kept[with_the_adapter:])  # what the port held longer was taken back
        assert 0 < refused <= sent - len(kept)


def test_an_unplugged_adapter_is_a_lost_link_and_what_is_sent_meanwhile_is_counted():
    device = SlcanDevice()
    with open_bus(f"slcan:{device.port},sleep_after_open=0", VEHICLE) as bus:
        device.wait_open()
        device.close()
        states = []

        def disconnected():
            states.extend(event.state for event in bus.receive(0.1))
            return LinkState.DISCONNECTED in states

        wait_until(disconnected, "the lost link", 20)
        bus.send([Frame(VEHICLE, 2, bytes(8))] * 3)
        assert lost(bus) == 3


def test_a_port_that_is_none_is_refused():
    with pytest.raises(BusError, match="could not open port"):
        open_bus(f"slcan:/dev/{uuid.uuid4().hex}", VEHICLE)
