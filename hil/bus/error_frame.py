"""What Linux reports as error frames, as link events. Field names and values: linux/can/error.h."""

import re

from dbc.frame import BusName, LinkEvent, LinkState, Received
from hil.bus.can_frame import ERROR_FLAG

CAN_ERR_TX_TIMEOUT = 0x001
CAN_ERR_CRTL = 0x004
CAN_ERR_PROT = 0x008
CAN_ERR_TRX = 0x010
CAN_ERR_ACK = 0x020
CAN_ERR_BUSOFF = 0x040
CAN_ERR_BUSERROR = 0x080
CAN_ERR_RESTARTED = 0x100
CAN_ERR_CNT = 0x200
MOST_NUMBER = 0xFFFFFF  # occurrences that the three bytes of a record hold

# data[1]: a state is reported once, with the side that caused it
_CONTROLLER = (
    (0x01, LinkState.RX_OVERFLOW, "controller's receive buffer"),
    (0x02, LinkState.TX_OVERFLOW, "controller's transmit buffer"),
    (0x04, LinkState.ERROR_WARNING, "receive errors"),
    (0x08, LinkState.ERROR_WARNING, "transmit errors"),
    (0x10, LinkState.ERROR_PASSIVE, "receive errors"),
    (0x20, LinkState.ERROR_PASSIVE, "transmit errors"),
    (0x40, LinkState.ERROR_ACTIVE, "recovered"),
)

# data[2]
_PROTOCOL = (
    (0x01, "single bit"),
    (0x02, "frame format"),
    (0x04, "bit stuffing"),
    (0x08, "dominant bit not sent"),
    (0x10, "recessive bit not sent"),
    (0x20, "overload"),
    (0x40, "active error announcement"),
    (0x80, "on transmission"),
)


def link_events(error_class: int, data: bytes, bus: BusName, time_ns: int) -> list[LinkEvent]:
    """Return what one error frame says, the lasting state last; a lost arbitration is none.

    Parameters
    ----------
    error_class : the frame's identifier without flags.
    data : 8 bytes; missing ones count as 0 (unspecified).
    """
    data = data.ljust(8, b"\0")
    counters = f"; counters tx {data[6]} rx {data[7]}" if error_class & CAN_ERR_CNT else ""
    found: dict[LinkState, list[str]] = {}
    if error_class & CAN_ERR_TX_TIMEOUT:
        found.setdefault(LinkState.BUS_ERROR, []).append("transmission timed out")
    if error_class & CAN_ERR_TRX:
        found.setdefault(LinkState.BUS_ERROR, []).append(f"transceiver status 0x{data[4]:02x}")
    if error_class & CAN_ERR_ACK:
        found[LinkState.NO_ACK] = ["no acknowledge"]
    elif error_class & (CAN_ERR_PROT | CAN_ERR_BUSERROR):
        kinds = [text for bit, text in _PROTOCOL if data[2] & bit] or ["bus error"]
        where = [f"at 0x{data[3]:02x}"] if data[3] else []
        found.setdefault(LinkState.BUS_ERROR, []).extend(kinds + where)
    if error_class & CAN_ERR_CRTL:
        flagged = [(state, text) for bit, state, text in _CONTROLLER if data[1] & bit]
        for state, text in flagged or [(LinkState.BUS_ERROR, "controller problem")]:
            found.setdefault(state, []).append(text)
    if error_class & CAN_ERR_BUSOFF:
        found[LinkState.BUS_OFF] = ["bus-off"]
    if error_class & CAN_ERR_RESTARTED:
        found[LinkState.RESTARTED] = ["controller restarted"]
    return [LinkEvent(bus, state, time_ns, 1, ", ".join(texts) + counters) for state, texts in found.items()]


# link state -> class, data[1], data[4] of the error frame that says it
_ERROR_FRAMES: dict[LinkState, tuple[int, int, int]] = {
    LinkState.RX_OVERFLOW: (CAN_ERR_CRTL, 0x01, 0),
    LinkState.TX_OVERFLOW: (CAN_ERR_CRTL, 0x02, 0),
    LinkState.ERROR_WARNING: (CAN_ERR_CRTL, 0x0C, 0),
    LinkState.ERROR_PASSIVE: (CAN_ERR_CRTL, 0x30, 0),
    LinkState.ERROR_ACTIVE: (CAN_ERR_CRTL, 0x40, 0),
    LinkState.DISCONNECTED: (CAN_ERR_TRX, 0, 0x44),  # transceiver: no wire on either line
    LinkState.NO_ACK: (CAN_ERR_ACK, 0, 0),
    LinkState.BUS_OFF: (CAN_ERR_BUSOFF, 0, 0),
    LinkState.BUS_ERROR: (CAN_ERR_BUSERROR, 0, 0),
    LinkState.RESTARTED: (CAN_ERR_RESTARTED, 0, 0),
}
_RECEIVING, _SENDING = 0x14, 0x28  # bits of data[1]: which side's errors led to warning or passive
_COUNTED = re.compile(r"counters tx (\d+) rx (\d+)")


def error_frame(event: LinkEvent) -> tuple[int, bytes]:
    """Class and data of the error frame that says what a link event says; several occurrences are as many frames."""
    error_class, controller, transceiver = _ERROR_FRAMES[event.state]
    if event.state in (LinkState.ERROR_WARNING, LinkState.ERROR_PASSIVE):
        sides = _RECEIVING * ("receive" in event.detail) | _SENDING * ("transmit" in event.detail)
        controller &= sides or controller
    sent = received = 0
    if counted := _COUNTED.search(event.detail):
        error_class |= CAN_ERR_CNT
        sent, received = (min(int(count), 255) for count in counted.groups())
    return error_class, bytes((0, controller, 0, 0, transceiver, 0, sent, received))


def events_of(error_class: int, data: bytes, bus: BusName, time_ns: int) -> list[LinkEvent]:
    """Link events of an error frame of ours: those of the kernel, and the one it has no frame of."""
    disconnected, _, no_wire = _ERROR_FRAMES[LinkState.DISCONNECTED]
    if error_class == disconnected and data[4] == no_wire:
        return [LinkEvent(bus, LinkState.DISCONNECTED, time_ns)]
    return link_events(error_class, data, bus, time_ns)


def event_of_record(
    flagged: int, length: int, number: int, data: bytes, bus: BusName, time_ns: int
) -> LinkEvent | None:
    """The link event of a record with an error frame of ours; None where it is none.

    Parameters
    ----------
    flagged : class of the error frame with the flags of `hil.bus.can_frame`.  length, data : its data bytes.
    number : occurrences.
    """
    found = events_of(flagged ^ ERROR_FLAG, data, bus, time_ns)
    if length != len(data) or flagged >> 30 or len(found) != 1:
        return None
    return found[0]._replace(number=number)


def append_event(event: LinkEvent, received: list[Received]) -> None:
    """Append an event, or count it into the last one of its kind: bus errors may come by the thousand."""
    last = received[-1] if received else None
    if isinstance(last, LinkEvent) and last.state == event.state:
        received[-1] = event._replace(number=last.number + event.number)
    else:
        received.append(event)
