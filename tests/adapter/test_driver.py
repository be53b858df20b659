"""The lab itself: the driver is the real one, and what it does with frames, bit rate and queue."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import can
import pytest
from processes import wait_until

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bus import BusError, open_bus

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Adapter

    Cards = tuple[Adapter, Adapter]

QUEUE = 3  # txqueuelen
BEYOND = 2  # one frame in the card's transmit buffer, one that the kernel holds ready for it
BURST = 20


def test_the_driver_is_the_kernels_own(adapters: Cards, figure: Callable[[str], None]) -> None:
    modules = {line.split()[0] for line in Path("/proc/modules").read_text().splitlines()}
    assert {"kvaser_pci", "sja1000", "can_dev", "can_raw"} <= modules
    for adapter in adapters:
        details = adapter.details()
        assert adapter.driver == "kvaser_pci"
        assert details["linkinfo"]["info_kind"] == "can"
        data = details["linkinfo"]["info_data"]
        assert data["bittiming_const"]["name"] == "sja1000"
        assert (data["bittiming"]["bitrate"], data["state"]) == (500_000, "ERROR-ACTIVE")
        figure(f"{adapter.name}: driver {adapter.driver} on chip {data['bittiming_const']['name']}, PCI {adapter.slot}")


@pytest.mark.parametrize(
    ("can_id", "extended", "data"),
    [(0x7A0, False, b""), (0x7FF, False, bytes(range(8))), (0x1ABCDEF0, True, b"\x01")],
)
def test_frames_pass_both_ways(adapters: Cards, can_id: int, extended: bool, data: bytes) -> None:
    message = can.Message(arbitration_id=can_id, is_extended_id=extended, data=data)
    buses = [can.Bus(interface="socketcan", channel=adapter.name) for adapter in adapters]
    try:
        for sender, receiver in (buses, buses[::-1]):
            sender.send(message)
            heard = receiver.recv(5.0)
            assert heard is not None
            assert heard.equals(message, timestamp_delta=None, check_channel=False, check_direction=False)
            assert sender.recv(0.0) is None
    finally:
        for bus in buses:
            bus.shutdown()


def test_an_interface_that_is_down_is_refused_with_the_command_that_mends_it(cards: Cards) -> None:
    cards[1].down()
    with pytest.raises(BusError, match="sudo ip link set can1 up"):
        open_bus(cards[1].spec, BusName.VEHICLE)


def test_an_adapter_without_its_driver_is_refused(cards: Cards) -> None:
    cards[1].unbind()
    with pytest.raises(BusError, match="can1: No such device"):
        open_bus(cards[1].spec, BusName.VEHICLE)


def test_a_queue_that_nobody_empties_costs_what_it_does_not_take_and_no_more(cards: Cards) -> None:
    theirs, ours = cards
    ours.set("txqueuelen", str(QUEUE))
    with open_bus(theirs.spec, BusName.VEHICLE) as there, open_bus(ours.spec, BusName.VEHICLE) as here:
        ours.interrupts(False)
        here.send([Frame(BusName.VEHICLE, 0x7A1, bytes([n])) for n in range(BURST)])
        (event,) = here.receive()
        assert isinstance(event, LinkEvent)
        assert (event.state, event.number) == (LinkState.TX_OVERFLOW, BURST - QUEUE - BEYOND)
        ours.interrupts(True)
        heard: list[int] = []

        def came() -> bool:
            heard.extend(item.data[0] for item in there.receive(0.1) if isinstance(item, Frame))
            return len(heard) >= QUEUE + BEYOND

        wait_until(came, "the frames that were taken", 10.0)
        here.send([Frame(BusName.VEHICLE, 0x7A1, b"\xff")])
        wait_until(lambda: came() and 0xFF in heard, "the next frame", 10.0)
        assert heard == [*range(QUEUE + BEYOND), 0xFF]  # what was refused never comes
        assert here.receive() == []
