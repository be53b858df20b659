import errno
import itertools
import logging
import threading
import time
import uuid

import can
import pytest
from processes import wait_until

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bus import BusError, driver_threads, open_bus
from hil.bus.bus import parse_spec
from hil.bus.python_can import PythonCanBus

VEHICLE = BusName.VEHICLE
FRAME = Frame(VEHICLE, 1, b"")


class Driver:
    """A python-can driver that does what a script says: an exception is raised, anything else returned."""

    def __init__(self, arriving=(), refusing=()):
        self.arriving, self.refusing = list(arriving), list(refusing)
        self.sent, self.closed = [], False

    def recv(self, timeout):
        if not self.arriving:
            time.sleep(min(timeout, 0.002))
        item = self.arriving.pop(0) if self.arriving else None
        if isinstance(item, Exception):
            raise item
        return item

    def send(self, message, timeout):
        item = self.refusing.pop(0) if self.refusing else None
        if item is not None:
            raise item
        self.sent.append(message.arbitration_id)

    def fileno(self):
        raise NotImplementedError  # as python-can does for drivers without a descriptor

    def shutdown(self):
        self.closed = True
        raise can.CanOperationError("there is nothing left to shut down")


@pytest.fixture
def bus_on(monkeypatch):
    """Open a bus on the first of some drivers; reopening takes the next, or fails while it is None."""
    opened = []

    def bus_on(*drivers):
        waiting = list(drivers)

        def open_driver(spec):
            driver = waiting.pop(0)
            if driver is None:
                raise BusError("still unplugged")
            return driver, None

        monkeypatch.setattr(driver_threads, "open_driver", open_driver)
        monkeypatch.setattr(driver_threads, "FIRST_RETRY_S", 0.001)
        opened.append(PythonCanBus(parse_spec("fake:0"), VEHICLE))
        return opened[-1]

    yield bus_on
    for bus in opened:
        bus.close()


def message(can_id=1, **more):
    return can.Message(timestamp=time.time(), arbitration_id=can_id, is_extended_id=False, **more)


def states(received):
    return [item.state if isinstance(item, LinkEvent) else item.can_id for item in received]


def receive_until(bus, wanted):
    """Receive until a state or identifier has come; all that came."""
    received, give_up = [], time.monotonic() + 20.0
    while wanted not in states(received):
        received += bus.receive(1.0)
        assert time.monotonic() < give_up, received
    return received


def test_a_full_transmit_queue_is_counted_and_nothing_is_kept_for_later(bus_on):
    full = can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)
    driver = Driver(refusing=[None, full, full, None])
    bus = bus_on(driver)
    bus.send([FRAME._replace(can_id=n) for n in range(4)])
    events = receive_until(bus, LinkState.TX_OVERFLOW)
    bus.send([FRAME._replace(can_id=9)])
    wait_until(lambda: driver.sent == [0, 3, 9], "the last frame", 20)
    events += bus.receive()
    assert {event.state for event in events} == {LinkState.TX_OVERFLOW}
    assert sum(event.number for event in events) == 2
    assert all("No buffer space" in event.detail for event in events)


def test_an_unplugged_adapter_is_reported_and_reopened(bus_on):
    gone = can.CanOperationError("Error receiving: No such device", errno.ENODEV)
    first, second = Driver([message(1), gone]), Driver([message(2)])
    bus = bus_on(first, None, None, second)
    received = receive_until(bus, 2)
    assert states(received) == [1, LinkState.DISCONNECTED, LinkState.RESTARTED, 2]
    assert first.closed
    bus.send([FRAME])
    wait_until(lambda: second.sent == [1], "the frame", 20)


def test_while_it_is_unplugged_nothing_is_sent_later(bus_on):
    driver, later = Driver(refusing=[OSError(errno.ENETDOWN, "Network is down")]), Driver()
    bus = bus_on(driver, *[None] * 6, later)
    bus.send([FRAME] * 3)
    bus.send([FRAME] * 2)
    received = receive_until(bus, LinkState.RESTARTED) + bus.receive()
    events = [item for item in received if item.state is not LinkState.RESTARTED]
    assert {event.state for event in events} == {LinkState.DISCONNECTED, LinkState.TX_OVERFLOW}
    assert sum(event.number for event in events if event.state is LinkState.TX_OVERFLOW) == 5
    assert later.sent == []


def test_one_unreadable_message_is_no_disconnection(bus_on):
    bus = bus_on(Driver([ValueError("invalid literal"), message(1)]))
    assert states(receive_until(bus, 1)) == [1]


def test_a_driver_that_keeps_failing_is_reopened(bus_on):
    bus = bus_on(Driver([message(1), ValueError("bad"), ValueError("bad")]), Driver([message(2)]))
    assert states(receive_until(bus, 2)) == [1, LinkState.DISCONNECTED, LinkState.RESTARTED, 2]


def test_closing_ends_reconnecting(bus_on):
    bus = bus_on(Driver([OSError(errno.ENODEV, "gone")]), *[None] * 1000)
    assert states(receive_until(bus, LinkState.DISCONNECTED)) == [LinkState.DISCONNECTED]
    bus.close()
    with pytest.raises(ValueError, match="closed"):
        bus.receive()


def test_what_is_no_classical_data_frame_is_ignored_and_counted(bus_on):
    bus = bus_on(Driver([message(1, is_remote_frame=True), message(2, is_fd=True, data=bytes(12)), message(3)]))
    assert states(receive_until(bus, 3)) == [3]
    assert bus.ignored == 2


def test_error_frames_become_events_and_floods_are_counted(bus_on):
    errors = [message(0x088, is_error_frame=True, data=bytes(8))] * 500
    bus = bus_on(Driver([message(1), *errors, message(0x040, is_error_frame=True, data=bytes(8)), message(2)]))
    received = receive_until(bus, 2)
    told = [(key, list(group)) for key, group in itertools.groupby(received, lambda item: item[:2])]
    assert [states(group)[0] for _, group in told] == [1, LinkState.BUS_ERROR, LinkState.BUS_OFF, 2]
    assert sum(event.number for event in told[1][1]) == 500


def test_a_stamp_that_counts_from_elsewhere_is_replaced(bus_on):
    early = message(1)
    early.timestamp = 12.5  # seconds since the adapter was plugged in
    before_ns = time.monotonic_ns()
    (frame,) = receive_until(bus_on(Driver([early])), 1)
    assert before_ns <= frame.time_ns <= time.monotonic_ns()


def test_error_frames_of_another_program_arrive_as_events():
    name = uuid.uuid4().hex
    with open_bus(f"virtual:{name}", VEHICLE) as bus, can.Bus(name, interface="virtual") as other:
        other.send(can.Message(arbitration_id=0x100, is_error_frame=True, is_extended_id=False, data=bytes(8)))
        other.send(can.Message(arbitration_id=0x7FF, is_extended_id=False, data=b"x"))
        assert states(receive_until(bus, 0x7FF)) == [LinkState.RESTARTED, 0x7FF]


def test_python_can_is_kept_quiet(caplog):
    open_bus(f"virtual:{uuid.uuid4().hex}", VEHICLE).close()
    assert not logging.getLogger("can").isEnabledFor(logging.ERROR)


@pytest.mark.parametrize("kind", ["virtual", "gs_usb"])
def test_listen_only_is_refused_where_the_driver_cannot(kind):
    with pytest.raises(BusError, match=r"0: listen_only is known of .*kvaser, .*slcan, .*, not of"):
        open_bus(f"{kind}:0,listen_only=true", VEHICLE)


# ---- drivers that do not come back ----


class Hanging(Driver):
    """A driver one of whose calls blocks until it is let go."""

    def __init__(self, call, arriving=()):
        super().__init__(arriving)
        self.call, self.let_go, self.reached = call, threading.Event(), threading.Event()

    def hang(self, call):
        if call == self.call:
            self.reached.set()
            self.let_go.wait(60.0)

    def recv(self, timeout):
        self.hang("recv")
        return super().recv(timeout)

    def send(self, message, timeout):
        self.hang("send")
        super().send(message, timeout)

    def shutdown(self):
        self.hang("shutdown")
        super().shutdown()


@pytest.fixture
def hanging():
    made = []

    def hanging(*arguments):
        made.append(Hanging(*arguments))
        return made[-1]

    yield hanging
    for driver in made:
        driver.let_go.set()


def test_a_send_that_hangs_holds_nobody_up_and_what_waited_is_never_sent(bus_on, hanging):
    driver = hanging("send", [message(7)])
    bus = bus_on(driver)
    for number in range(3000):
        bus.send([FRAME._replace(can_id=number & 0x7FF)])
    assert driver.reached.is_set()
    received = receive_until(bus, LinkState.TX_OVERFLOW)
    assert 7 in states(received)  # it still hears
    time.sleep(0.06)  # longer than a frame may wait
    driver.let_go.set()
    wait_until(lambda: driver.sent, "the one in hand to be sent", 20)
    bus.send([FRAME._replace(can_id=0x7FF)])
    wait_until(lambda: 0x7FF in driver.sent, "a fresh frame", 20)
    assert driver.sent == [0, 0x7FF]
    received += bus.receive()
    assert sum(item.number for item in received if isinstance(item, LinkEvent)) == 2999


def test_reading_that_hangs_holds_nobody_up(bus_on, hanging):
    driver = hanging("recv")
    bus = bus_on(driver)
    assert driver.reached.wait(20.0)
    assert bus.receive(0.01) == []
    bus.send([FRAME])
    wait_until(lambda: driver.sent == [1], "the frame", 20)


@pytest.mark.parametrize("call", ["recv", "send", "shutdown"])
def test_closing_a_driver_that_hangs_gives_up(bus_on, hanging, call, monkeypatch):
    monkeypatch.setattr(driver_threads, "CLOSE_S", 0.05)
    driver = hanging(call)
    bus = bus_on(driver)
    bus.send([FRAME])
    bus.close()  # the test's own time limit would end it
    assert driver.reached.is_set()
    assert not driver.closed
    driver.let_go.set()
    wait_until(lambda: driver.closed, "the driver to be closed by its own thread", 20)


def test_a_driver_that_does_not_open_is_an_error_and_closed_when_it_does(monkeypatch):
    driver, let_go = Driver(), threading.Event()

    def open_driver(spec):
        let_go.wait(60.0)
        return driver, None

    monkeypatch.setattr(driver_threads, "open_driver", open_driver)
    monkeypatch.setattr(driver_threads, "OPEN_S", 0.01)
    with pytest.raises(BusError, match=r"fake:0: did not open within 0.01 s"):
        PythonCanBus(parse_spec("fake:0"), VEHICLE)
    let_go.set()
    wait_until(lambda: driver.closed, "the late driver to be closed", 20)
