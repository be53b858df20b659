"""The error states of a real driver: the kernel's slcan, told by the adapter at its other end.

The bytes are those of linux/can/error.h: python-can's socketcan gives them as ``is_error_frame`` messages whose
identifier holds the error class.
"""

from __future__ import annotations

import errno
import subprocess
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

import can
import pytest
import slcan_device as adapter
from slcan_device import SlcanDevice, SlcanFrame

if TYPE_CHECKING:
    from conftest import SlcanInterface

# Classes, in the identifier; what follows them is in the data.
CRTL = 0x004  # data[1]: state of the controller
PROT = 0x008  # data[2]: kind of violation, data[3]: where
ACK = 0x020
BUSOFF = 0x040
BUSERROR = 0x080
CNT = 0x200  # data[6]: transmit, data[7]: receive error counter


@pytest.fixture
def bus(slcan: SlcanInterface) -> Iterator[can.BusABC]:
    with can.Bus(interface="socketcan", channel=slcan.name) as bus:
        yield bus


def _error(bus: can.BusABC) -> tuple[int, list[int]]:
    message = bus.recv(5.0)
    assert message is not None, "no frame from the driver"
    assert message.is_error_frame
    assert message.dlc == 8
    return message.arbitration_id, list(message.data)


@pytest.mark.parametrize(
    "frame",
    [
        SlcanFrame(0x123),
        SlcanFrame(0x7FF, bytes(range(8))),
        SlcanFrame(0x1ABCDEF0, b"\x01", extended=True),
        SlcanFrame(0x100, remote=True, dlc=4),
    ],
    ids=lambda frame: frame.line(),
)
def test_frames_pass_both_ways(slcan: SlcanInterface, bus: can.BusABC, frame: SlcanFrame) -> None:
    message = can.Message(
        arbitration_id=frame.can_id,
        data=frame.data,
        dlc=frame.dlc,
        is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
    )
    bus.send(message)
    assert slcan.device.receive() == frame
    slcan.device.send(frame)
    heard = bus.recv(5.0)
    assert heard is not None
    assert heard.equals(message, timestamp_delta=None, check_channel=False, check_direction=False)


def test_the_driver_sets_the_bit_rate_and_opens_and_closes_the_channel(slcan: SlcanInterface) -> None:
    assert list(slcan.device.commands) == ["C", "S6", "O"]
    assert slcan.device.bit_rate_bps == 500_000
    assert slcan.details()["linkinfo"]["info_data"]["bittiming_bitrate"] == 500_000
    slcan.down()
    assert slcan.state() == "STOPPED"
    slcan.up("listen-only", "on")
    assert slcan.device.listen_only


@pytest.mark.parametrize(
    ("line", "classes", "data", "state"),
    [
        (adapter.ERROR_WARNING, CRTL | CNT, [0, 0x04, 0, 0, 0, 0, 0, 96], "ERROR-WARNING"),  # receiving
        ("sw000100", CRTL | CNT, [0, 0x08, 0, 0, 0, 0, 100, 0], "ERROR-WARNING"),  # sending
        ("sp130000", CRTL | CNT, [0, 0x10, 0, 0, 0, 0, 0, 130], "ERROR-PASSIVE"),  # receiving
        (adapter.ERROR_PASSIVE, CRTL | CNT, [0, 0x20, 0, 0, 0, 0, 130, 0], "ERROR-PASSIVE"),  # sending
        (adapter.BUS_OFF, BUSOFF, [0, 0, 0, 0, 0, 0, 0, 0], "BUS-OFF"),
    ],
)
def test_a_change_of_state(
    slcan: SlcanInterface, bus: can.BusABC, line: str, classes: int, data: list[int], state: str
) -> None:
    slcan.device.send_line(line)
    assert _error(bus) == (classes, data)
    assert slcan.state() == state


@pytest.mark.parametrize(
    ("line", "classes", "data"),
    [
        (adapter.NO_ACK, PROT | ACK | BUSERROR, [0, 0, 0, 0x19, 0, 0, 0, 0]),
        ("e1b", PROT | BUSERROR, [0, 0, 0x08, 0, 0, 0, 0, 0]),  # dominant bit not on the bus
        ("e1B", PROT | BUSERROR, [0, 0, 0x10, 0, 0, 0, 0, 0]),  # recessive bit not on the bus
        ("e1c", PROT | BUSERROR, [0, 0, 0x01, 0x08, 0, 0, 0, 0]),  # checksum
        ("e1f", PROT | BUSERROR, [0, 0, 0x02, 0, 0, 0, 0, 0]),  # form
        ("e1s", PROT | BUSERROR, [0, 0, 0x04, 0, 0, 0, 0, 0]),  # stuffing
        ("e1o", CRTL | PROT | BUSERROR, [0, 0x01, 0, 0, 0, 0, 0, 0]),  # receive overflow
        ("e1O", CRTL | PROT | BUSERROR, [0, 0x02, 0, 0, 0, 0, 0, 0]),  # transmit overflow
        ("e2ac", PROT | ACK | BUSERROR, [0, 0, 0x01, 0x08, 0, 0, 0, 0]),  # two in one: the place is the last one's
    ],
)
def test_an_error_on_the_bus_leaves_the_state(
    slcan: SlcanInterface, bus: can.BusABC, line: str, classes: int, data: list[int]
) -> None:
    slcan.device.send_line(line)
    assert _error(bus) == (classes, data)
    assert slcan.state() == "ERROR-ACTIVE"


def test_a_state_is_told_once_and_recovery_too(slcan: SlcanInterface, bus: can.BusABC) -> None:
    for line in (adapter.ERROR_WARNING, "sw097000", adapter.ERROR_ACTIVE):
        slcan.device.send_line(line)
    assert _error(bus) == (CRTL | CNT, [0, 0x04, 0, 0, 0, 0, 0, 96])
    assert _error(bus) == (CRTL | CNT, [0, 0x40, 0, 0, 0, 0, 0, 0])
    assert slcan.state() == "ERROR-ACTIVE"
    counted = slcan.details()["linkinfo"]["info_xstats"]
    assert (counted["error_warning"], counted["error_passive"], counted["bus_off"]) == (1, 0, 0)


def test_after_bus_off_frames_are_lost_in_silence_until_the_interface_was_down_and_up(
    slcan: SlcanInterface, bus: can.BusABC
) -> None:
    with can.Bus(interface="socketcan", channel=slcan.name) as neighbour:
        slcan.device.send_line(adapter.BUS_OFF)
        assert _error(bus) == (BUSOFF, [0] * 8)
        assert _error(neighbour) == (BUSOFF, [0] * 8)
        bus.send(can.Message(arbitration_id=0x111, is_extended_id=False))  # no error, and the neighbour hears it ...
        heard = neighbour.recv(5.0)
        assert heard is not None
        assert heard.arbitration_id == 0x111
        slcan.down()
        slcan.up()
        for member in (bus, neighbour):  # the same socket goes on after having told it once
            with pytest.raises(can.CanOperationError) as lost:
                member.recv(5.0)
            assert lost.value.error_code == errno.ENETDOWN
        assert slcan.state() == "ERROR-ACTIVE"
        bus.send(can.Message(arbitration_id=0x222, is_extended_id=False))
        assert slcan.device.receive().can_id == 0x222  # ... but 0x111 never was on the bus


def test_an_adapter_that_recovers_by_itself_gets_no_carrier_back(slcan: SlcanInterface, bus: can.BusABC) -> None:
    slcan.device.send_line(adapter.BUS_OFF)
    assert _error(bus) == (BUSOFF, [0] * 8)
    slcan.device.send_line(adapter.ERROR_ACTIVE)
    assert _error(bus) == (CRTL | CNT, [0, 0x40, 0, 0, 0, 0, 0, 0])
    details = slcan.details()
    assert details["linkinfo"]["info_data"]["state"] == "ERROR-ACTIVE"
    assert "LOWER_UP" not in details["flags"]


def test_it_refuses_to_restart_by_itself(slcan: SlcanInterface) -> None:
    slcan.down()
    with pytest.raises(subprocess.CalledProcessError) as refused:
        slcan.up("restart-ms", "100")
    assert "restart" in refused.value.stderr


def test_an_interface_that_went_down_is_told_by_the_next_call_even_when_up_again(
    slcan: SlcanInterface, bus: can.BusABC
) -> None:
    slcan.down()
    slcan.up()
    with pytest.raises(can.CanOperationError) as lost:
        bus.send(can.Message(arbitration_id=0x111, is_extended_id=False))  # this frame is lost
    assert lost.value.error_code == errno.ENETDOWN
    bus.send(can.Message(arbitration_id=0x222, is_extended_id=False))
    assert slcan.device.receive().can_id == 0x222


def test_listen_only_drops_what_is_sent_and_counts_it(slcan: SlcanInterface) -> None:
    slcan.down()
    slcan.up("listen-only", "on")
    with can.Bus(interface="socketcan", channel=slcan.name) as bus:
        bus.send(can.Message(arbitration_id=0x123, is_extended_id=False))
    assert slcan.details()["stats64"]["tx"]["dropped"] == 1


def test_a_full_transmit_queue_refuses_and_drains(slcan: SlcanInterface, bus: can.BusABC) -> None:
    def flood() -> None:
        for number in range(10_000):
            bus.send(can.Message(arbitration_id=0x123, data=number.to_bytes(8, "big"), is_extended_id=False))
            taken.append(number)

    taken: list[int] = []
    with slcan.device.stalled(), pytest.raises(can.CanOperationError) as full:
        flood()
    assert full.value.error_code == errno.ENOBUFS
    assert len(taken) > 10  # txqueuelen
    assert [int.from_bytes(slcan.device.receive().data, "big") for _ in taken] == taken


def test_an_unplugged_adapter_takes_the_interface_away(slcan: SlcanInterface, bus: can.BusABC) -> None:
    slcan.unplug()
    with pytest.raises(can.CanOperationError) as lost:
        bus.recv(5.0)
    assert lost.value.error_code in (errno.ENETDOWN, errno.ENODEV)
    with pytest.raises(can.CanOperationError) as gone:
        bus.send(can.Message(arbitration_id=0x123, is_extended_id=False))
    assert gone.value.error_code in (errno.ENODEV, errno.ENXIO)


def test_slcand_attaches_and_sets_the_bit_rate_behind_the_drivers_back(
    slcan_device: SlcanDevice, can_utils: None
) -> None:
    command = ["slcand", "-F", "-o", "-c", "-s6", slcan_device.port, "slcan7"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as slcand:
        try:
            slcan_device.wait_open()
            assert slcan_device.bit_rate_bps == 500_000
            for _ in range(100):
                if subprocess.run(["ip", "link", "set", "slcan7", "up"], capture_output=True).returncode == 0:
                    break
                time.sleep(0.05)
            with can.Bus(interface="socketcan", channel="slcan7") as bus:
                slcan_device.send(SlcanFrame(0x321, b"\x07"))
                message = bus.recv(5.0)
                assert message is not None
                assert bytes(message.data) == b"\x07"
        finally:
            slcand.terminate()
    slcan_device.wait_open(False)
