"""The values that travel between floors: CAN frames and link events."""

from enum import StrEnum
from typing import NamedTuple, Protocol


class BusName(StrEnum):
    """Which of the two buses a frame belongs to."""

    VEHICLE = "vehicle"  # what a real car has; described by brake.dbc
    BENCH = "bench"  # stimulus, truth and health; described by bench.dbc


class Frame(NamedTuple):
    """One classical CAN data frame.

    Attributes
    ----------
    bus : the bus it was sent on.
    can_id : 11-bit identifier, or 29-bit where ``extended``.
    data : 0 to 8 bytes.
    time_ns : monotonic time of sending (loopback) or reception (adapter), ns; 0 before it was
        sent. It is data for recorders and reports; a node never decides by it.
    extended : 29-bit identifier.
    """

    bus: BusName
    can_id: int
    data: bytes
    time_ns: int = 0
    extended: bool = False


class LinkState(StrEnum):
    """What a bus reports about itself, beside its frames."""

    ERROR_ACTIVE = "error_active"  # recovered: counters below the warning limit
    ERROR_WARNING = "error_warning"
    ERROR_PASSIVE = "error_passive"
    NO_ACK = "no_ack"
    BUS_OFF = "bus_off"
    RESTARTED = "restarted"
    BUS_ERROR = "bus_error"  # any other protocol violation
    RX_OVERFLOW = "rx_overflow"  # frames were lost on the way to this member
    TX_OVERFLOW = "tx_overflow"  # frames of this member were not taken (queue full)
    DISCONNECTED = "disconnected"  # adapter unplugged, interface down


class LinkEvent(NamedTuple):
    """A change of a link, delivered in order between the frames.

    Attributes
    ----------
    bus : the bus it happened on.
    state : what happened.
    time_ns : monotonic time, ns.
    number : how many (frames lost, errors seen) since the last event of this kind.
    detail : free text from the driver, for people.
    """

    bus: BusName
    state: LinkState
    time_ns: int = 0
    number: int = 1
    detail: str = ""


Received = Frame | LinkEvent


class Node(Protocol):
    """A participant without I/O: the ECU, the plant, or a user's own."""

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Advance to ``now_ns`` and return the frames to send.

        Parameters
        ----------
        now_ns : the tick's nominal deadline, a multiple of the node's period plus its phase
            counted from the node's start; never the time of waking.
        inbox : what arrived since the last call, in order of arrival.
        """
        ...
