import errno
import os
import socket
import struct
import subprocess
import time

import pytest

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bus import BusError, open_bus, socketcan
from hil.bus.bus import parse_spec
from hil.bus.socketcan import SocketcanBus

VEHICLE = BusName.VEHICLE
CAN_FRAME = struct.Struct("=IB3x8s")
FRAME = Frame(VEHICLE, 1, b"")


def states(received):
    return [item.state if isinstance(item, LinkEvent) else item.can_id for item in received]


# ---- without a kernel's help: a link that behaves by a script ----


class Link:
    """Stands for the raw socket; an exception is raised, records are received with their ancillary data."""

    def __init__(self, arriving=(), refusing=()):
        self.arriving, self.refusing, self.sent, self.closed = list(arriving), list(refusing), [], False
        self.drops = 0
        self.file, self.far = socket.socketpair()

    def recvmsg(self, size, ancillary_size):
        item = self.arriving.pop(0) if self.arriving else BlockingIOError(errno.EAGAIN, "nothing")
        if isinstance(item, Exception):
            raise item
        return item

    def getsockopt(self, level, option, size):
        assert (level, option, size) == (socket.SOL_SOCKET, 55, 36)  # SO_MEMINFO
        return struct.pack("=9I", *range(8), self.drops)

    def send(self, record):
        item = self.refusing.pop(0) if self.refusing else None
        if item is not None:
            raise item
        self.sent.append(CAN_FRAME.unpack(record)[0])

    def fileno(self):
        return self.file.fileno()

    def close(self):
        self.file.close()
        self.far.close()


def record(can_id, data=b"", *, wall_ns=None, drops=None):
    ancillary = []
    if wall_ns is None:
        wall_ns = time.time_ns()
    ancillary.append((socket.SOL_SOCKET, 35, struct.pack("@ll", *divmod(wall_ns, 10**9))))
    if drops is not None:
        ancillary.append((socket.SOL_SOCKET, 40, struct.pack("=I", drops)))
    return CAN_FRAME.pack(can_id, len(data), data), ancillary, 0, None


@pytest.fixture
def bus_on(monkeypatch):
    opened = []

    def bus_on(*links):
        waiting = list(links)

        def open_link(interface):
            link = waiting.pop(0)
            if link is None:
                raise OSError(errno.ENODEV, "No such device")
            opened.append(link)
            return link

        monkeypatch.setattr(socketcan, "_open", open_link)
        monkeypatch.setattr(socketcan, "_FIRST_RETRY_NS", 1_000_000)
        opened.append(SocketcanBus(parse_spec("socketcan:can7"), VEHICLE))
        return opened[-1]

    yield bus_on
    for one in opened:
        one.close()


def test_frames_of_all_kinds(bus_on):
    bus = bus_on(
        Link([record(0x7FF, b"abc"), record(0x80000001, b""), record(0x40000001), record(0x9FFFFFFF, bytes(8))])
    )
    received = bus.receive()
    assert [(f.can_id, f.data, f.extended) for f in received] == [
        (0x7FF, b"abc", False),
        (1, b"", True),
        (0x1FFFFFFF, bytes(8), True),
    ]
    assert bus.ignored == 1  # the remote frame


def test_stamps_become_monotonic_time(bus_on):
    (frame,) = bus_on(Link([record(1, wall_ns=time.time_ns() - 50_000_000)])).receive()
    assert frame.time_ns == pytest.approx(time.monotonic_ns() - 50_000_000, abs=5_000_000_000)


def test_what_the_kernel_dropped_is_reported_where_it_is_missing(bus_on):
    link = Link([record(1), record(2, drops=5), record(3, drops=5), record(4, drops=7)])
    link.drops = 7
    received = bus_on(link).receive()
    assert states(received) == [1, LinkState.RX_OVERFLOW, 2, 3, LinkState.RX_OVERFLOW, 4]
    assert [item.number for item in received if isinstance(item, LinkEvent)] == [5, 2]


def test_what_was_dropped_after_the_last_frame_is_reported_although_nothing_follows(bus_on):
    link = Link([record(1), record(2, drops=1)])
    link.drops = 4
    bus = bus_on(link)
    received = bus.receive()
    assert states(received) == [1, LinkState.RX_OVERFLOW, 2, LinkState.RX_OVERFLOW]
    assert [item.number for item in received if isinstance(item, LinkEvent)] == [1, 3]
    assert bus.receive() == []
    link.arriving = [record(3, drops=3)]  # queued before the kernel's count was asked for
    assert states(bus.receive()) == [3]


def test_the_count_of_drops_may_wrap(bus_on):
    link = Link([record(1, drops=2**31 - 1), record(2, drops=2**32 - 2), record(3, drops=1)])
    link.drops = 1
    received = bus_on(link).receive()
    assert [item.number for item in received if isinstance(item, LinkEvent)] == [2**31 - 1, 2**31 - 1, 3]


def test_error_frames_become_events_and_floods_are_counted(bus_on):
    errors = [record(0x20000088, bytes(8))] * 700
    received = bus_on(Link([record(1), *errors, record(0x20000040, bytes(8)), record(2)])).receive()
    assert states(received) == [1, LinkState.BUS_ERROR, LinkState.BUS_OFF, 2]
    assert received[1].number == 700


@pytest.mark.parametrize("code", [errno.ENOBUFS, errno.EAGAIN])
def test_a_full_transmit_queue_is_counted_and_nothing_is_kept_for_later(bus_on, code):
    full = OSError(code, os.strerror(code))
    link = Link(refusing=[None, full, full, None])
    bus = bus_on(link)
    bus.send([FRAME._replace(can_id=n) for n in range(4)])
    (event,) = bus.receive()
    assert (event.state, event.number) == (LinkState.TX_OVERFLOW, 2)
    bus.send([FRAME._replace(can_id=9)])
    assert link.sent == [0, 3, 9]
    assert bus.receive() == []


def test_an_interface_that_goes_is_reported_and_reopened(bus_on):
    gone = OSError(errno.ENETDOWN, "Network is down")
    second = Link([record(2)])
    bus = bus_on(Link([record(1), gone]), None, None, second)
    assert states(bus.receive()) == [1, LinkState.DISCONNECTED]
    assert bus.fileno() == -1
    bus.send([FRAME] * 3)
    received = bus.receive(20.0)
    while 2 not in states(received):
        received += bus.receive(20.0)
    assert states(received) == [LinkState.TX_OVERFLOW, LinkState.RESTARTED, 2]
    assert received[0].number == 3
    assert second.sent == []
    bus.send([FRAME])
    assert second.sent == [1]


def test_an_interface_that_goes_while_sending(bus_on):
    bus = bus_on(Link(refusing=[None, OSError(errno.ENXIO, "No such device or address")]), None)
    bus.send([FRAME] * 5)
    received = bus.receive()
    assert states(received) == [LinkState.DISCONNECTED, LinkState.TX_OVERFLOW]
    assert received[1].number == 4


def test_options_belong_to_the_link():
    with pytest.raises(BusError, match="sudo ip link set can0 type can bitrate"):
        open_bus("socketcan:can0,bitrate=500000", VEHICLE)


@pytest.mark.parametrize(
    ("code", "remedy"), [(errno.EAFNOSUPPORT, "modprobe"), (errno.ENODEV, "type vcan"), (errno.ENETDOWN, "can7 up")]
)
def test_why_it_cannot_be_opened_and_what_to_do(monkeypatch, code, remedy):
    def refuse(interface):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(socketcan, "_open", refuse)
    with pytest.raises(BusError, match=f"socketcan:can7: {os.strerror(code)}.*{remedy}"):
        open_bus("socketcan:can7", VEHICLE)


# ---- on a real interface of its own ----


def ip(*arguments):
    return subprocess.run(["ip", "link", *arguments], capture_output=True, text=True, check=False)


@pytest.fixture
def interface():
    name = f"vt{os.getpid()}"
    made = ip("add", "dev", name, "type", "vcan") if os.geteuid() == 0 else None
    if made is None or made.returncode or ip("set", name, "up").returncode:
        pytest.skip("making a vcan needs root and a kernel with SocketCAN; .ci/vcan-lab has both")
    yield name
    ip("delete", name)


def test_a_real_interface_that_goes_down_and_comes_back(interface):
    with open_bus(f"socketcan:{interface}", VEHICLE) as bus, open_bus(f"socketcan:{interface}", VEHICLE) as other:
        bus.send([FRAME])
        assert states(other.receive(20.0)) == [1]
        ip("set", interface, "down")
        bus.send([FRAME])
        assert LinkState.DISCONNECTED in states(bus.receive(20.0))
        ip("set", interface, "up")
        received = []
        while LinkState.RESTARTED not in states(received):
            received += bus.receive(20.0)
        events = other.receive(20.0)
        while LinkState.RESTARTED not in states(events):
            events += other.receive(20.0)
        bus.send([FRAME._replace(can_id=2)])
        assert states(other.receive(20.0)) == [2]


def test_a_real_interface_that_is_unplugged(interface):
    with open_bus(f"socketcan:{interface}", VEHICLE) as bus:
        ip("delete", interface)
        assert states(bus.receive(20.0)) == [LinkState.DISCONNECTED]
        bus.send([FRAME])
        assert states(bus.receive(0.05)) == [LinkState.TX_OVERFLOW]
        ip("add", "dev", interface, "type", "vcan")
        ip("set", interface, "up")
        received = []
        while LinkState.RESTARTED not in states(received):
            received += bus.receive(20.0)


def test_a_real_interface_that_is_down_is_refused(interface):
    ip("set", interface, "down")
    with pytest.raises(BusError, match=f"sudo ip link set {interface} up"):
        open_bus(f"socketcan:{interface}", VEHICLE)


def test_real_error_frames(interface):
    with (
        open_bus(f"socketcan:{interface}", VEHICLE) as bus,
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as driver,
    ):
        driver.bind((interface,))
        driver.send(CAN_FRAME.pack(0x20000204, 8, bytes([0, 0x20, 0, 0, 0, 0, 136, 1])))
        driver.send(CAN_FRAME.pack(0x20000040, 8, bytes(8)))
        driver.send(CAN_FRAME.pack(0x123, 1, b"x"))
        received = bus.receive(20.0)
        while len(received) < 3:
            received += bus.receive(20.0)
    assert states(received) == [LinkState.ERROR_PASSIVE, LinkState.BUS_OFF, 0x123]
    assert received[0].detail == "transmit errors; counters tx 136 rx 1"
