import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bus.error_frame import append_event, link_events

VEHICLE = BusName.VEHICLE


def states(error_class, **data):
    payload = bytearray(8)
    for position, value in data.items():
        payload[int(position[1:])] = value
    return {event.state: event.detail for event in link_events(error_class, bytes(payload), VEHICLE, 5)}


@pytest.mark.parametrize(
    ("error_class", "data", "expected"),
    [
        (0x001, {}, {LinkState.BUS_ERROR: "transmission timed out"}),
        (0x002, {"d0": 7}, {}),
        (0x004, {"d1": 0x00}, {LinkState.BUS_ERROR: "controller problem"}),
        (0x004, {"d1": 0x01}, {LinkState.RX_OVERFLOW: "controller's receive buffer"}),
        (0x004, {"d1": 0x02}, {LinkState.TX_OVERFLOW: "controller's transmit buffer"}),
        (0x004, {"d1": 0x04}, {LinkState.ERROR_WARNING: "receive errors"}),
        (0x004, {"d1": 0x08}, {LinkState.ERROR_WARNING: "transmit errors"}),
        (0x004, {"d1": 0x0C}, {LinkState.ERROR_WARNING: "receive errors, transmit errors"}),
        (0x004, {"d1": 0x10}, {LinkState.ERROR_PASSIVE: "receive errors"}),
        (0x004, {"d1": 0x20}, {LinkState.ERROR_PASSIVE: "transmit errors"}),
        (0x004, {"d1": 0x40}, {LinkState.ERROR_ACTIVE: "recovered"}),
        (0x008, {"d2": 0x04, "d3": 0x0A}, {LinkState.BUS_ERROR: "bit stuffing, at 0x0a"}),
        (0x088, {"d2": 0x90}, {LinkState.BUS_ERROR: "recessive bit not sent, on transmission"}),
        (0x080, {}, {LinkState.BUS_ERROR: "bus error"}),
        (0x010, {"d4": 0x04}, {LinkState.BUS_ERROR: "transceiver status 0x04"}),
        (0x020, {}, {LinkState.NO_ACK: "no acknowledge"}),
        (0x0A8, {"d3": 0x19}, {LinkState.NO_ACK: "no acknowledge"}),
        (0x040, {}, {LinkState.BUS_OFF: "bus-off"}),
        (0x100, {}, {LinkState.RESTARTED: "controller restarted"}),
        (0x200, {"d6": 1}, {}),
        (0x204, {"d1": 0x20, "d6": 130, "d7": 3}, {LinkState.ERROR_PASSIVE: "transmit errors; counters tx 130 rx 3"}),
        (0x044, {"d1": 0x20}, {LinkState.ERROR_PASSIVE: "transmit errors", LinkState.BUS_OFF: "bus-off"}),
    ],
)
def test_what_the_kernel_says(error_class, data, expected):
    assert states(error_class, **data) == expected


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8))
def test_every_error_frame_gives_well_formed_events(error_class, data):
    events = link_events(error_class, data, VEHICLE, 5)
    assert len({event.state for event in events}) == len(events)
    assert all(event.bus is VEHICLE and event.time_ns == 5 and event.number == 1 and event.detail for event in events)


def test_a_flood_of_one_kind_is_one_event():
    received = []
    for state in [LinkState.BUS_ERROR] * 1000 + [LinkState.BUS_OFF]:
        append_event(LinkEvent(VEHICLE, state), received)
    received.append(Frame(VEHICLE, 1, b""))
    append_event(LinkEvent(VEHICLE, LinkState.BUS_OFF), received)
    assert [getattr(item, "number", None) for item in received] == [1000, 1, None, 1]
