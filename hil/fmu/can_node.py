"""A CAN controller between a node and an FMI-LS-BUS bus: queues, error counters, what the bus reports."""

from collections.abc import Sequence

from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from hil.fmu import ls_bus
from hil.fmu.ls_bus import (
    ArbitrationLost,
    BusError,
    Configuration,
    Confirm,
    ErrorCode,
    ErrorFlag,
    FormatError,
    Malformed,
    NodeStatus,
    Operation,
    Parameter,
    Status,
    Transmit,
)

MOST_BYTES = 8192  # of a data variable, its maxSize
PASSIVE_FROM, BUS_OFF_FROM = 128, 256  # ISO 11898-1, fault confinement
AFTER_PASSIVE = 127  # a passive receiver that takes a frame counts down to this, ISO 11898-1
SENDER_ERROR, PRIMARY_ERROR, SECONDARY_ERROR = 8, 8, 1  # ISO 11898-1: by how much counters grow
RECOVERY_BITS = 128 * 11  # recessive bits before a node is on the bus again, ISO 11898-1
_LINK = {
    NodeStatus.ERROR_ACTIVE: LinkState.ERROR_ACTIVE,
    NodeStatus.ERROR_PASSIVE: LinkState.ERROR_PASSIVE,
    NodeStatus.BUS_OFF: LinkState.BUS_OFF,
}
_LONGEST_REFUSED = 0xFFFF  # a format error holds the length of what it refuses in two bytes


class CanNode:
    """The controller of one node of the vehicle bus.

    Parameters
    ----------
    bit_rate : bit/s, told to the bus.
    notified : the bus confirms frames and reports errors (``Can_BusNotifications``); else what is sent has arrived.

    Attributes
    ----------
    transmit_errors, receive_errors : error counters.  status : what follows from them.
    """

    def __init__(self, bit_rate: int, notified: bool) -> None:
        self._recovery_ns = RECOVERY_BITS * 1_000_000_000 // bit_rate
        self._notified = notified
        self.transmit_errors = self.receive_errors = 0
        self.status = NodeStatus.ERROR_ACTIVE
        self._off_ns = 0
        self._inbox: list[Received] = []
        self._unconfirmed: dict[tuple[int, bool], Transmit] = {}
        self._again: list[Transmit] = []
        behaviour = Configuration(Parameter.ARBITRATION_LOST_BEHAVIOR, ls_bus.BUFFER_AND_RETRANSMIT)
        self._outgoing: list[Operation] = [Configuration(Parameter.CAN_BAUDRATE, bit_rate), behaviour]

    def receive(self, now_ns: int, data: bytes) -> None:
        """Take what the bus says at an event."""
        for operation in ls_bus.decode(data):
            match operation:
                case Transmit(can_id, content, extended, remote):
                    if self.status is NodeStatus.BUS_OFF:
                        continue
                    passive = self.receive_errors >= PASSIVE_FROM
                    self.receive_errors = AFTER_PASSIVE if passive else max(0, self.receive_errors - 1)
                    if not remote:
                        self._inbox.append(Frame(BusName.VEHICLE, can_id, content, 0, extended))
                case Confirm(can_id):
                    self._taken(can_id)
                    self.transmit_errors = max(0, self.transmit_errors - 1)
                case ArbitrationLost(can_id):
                    self._repeat(can_id)
                case BusError():
                    self._count(operation)
                case Malformed(refused, _):
                    self._outgoing.append(FormatError(refused[:_LONGEST_REFUSED]))
                case _:  # for the bus simulation, or of a newer controller
                    pass
            self._judge(now_ns)

    def _taken(self, can_id: int) -> Transmit | None:
        key = next((key for key in self._unconfirmed if key[0] == can_id), None)
        return None if key is None else self._unconfirmed.pop(key)

    def _repeat(self, can_id: int) -> None:
        frame = self._taken(can_id)
        if frame is not None:
            self._again.append(frame)

    def _count(self, error: BusError) -> None:
        if self.status is NodeStatus.BUS_OFF:
            return
        if error.sender:
            passive = self.status is NodeStatus.ERROR_PASSIVE
            if not (passive and error.code is ErrorCode.ACK_ERROR):  # a lone node does not go bus-off, ISO 11898-1
                self.transmit_errors += SENDER_ERROR
            self._repeat(error.can_id)
        else:
            self.receive_errors += PRIMARY_ERROR if error.flag is ErrorFlag.PRIMARY else SECONDARY_ERROR
        self._inbox.append(LinkEvent(BusName.VEHICLE, LinkState.BUS_ERROR, detail=error.code.name))

    def _judge(self, now_ns: int) -> None:
        if self.transmit_errors >= BUS_OFF_FROM:
            status = NodeStatus.BUS_OFF
        elif max(self.transmit_errors, self.receive_errors) >= PASSIVE_FROM:
            status = NodeStatus.ERROR_PASSIVE
        else:
            status = NodeStatus.ERROR_ACTIVE
        if status is not self.status:
            self._become(now_ns, status, _LINK[status])

    def _become(self, now_ns: int, status: NodeStatus, state: LinkState) -> None:
        self.status = status
        self._outgoing.append(Status(status))
        self._inbox.append(LinkEvent(BusName.VEHICLE, state))
        if status is NodeStatus.BUS_OFF:
            self._off_ns = now_ns
            self._unconfirmed.clear()
            self._again.clear()
            self._outgoing = [one for one in self._outgoing if not isinstance(one, Transmit)]

    def inbox(self, now_ns: int) -> list[Received]:
        """What has come since the last tick; a node that was off the bus long enough is back."""
        if self.status is NodeStatus.BUS_OFF and now_ns - self._off_ns >= self._recovery_ns:
            self.transmit_errors = self.receive_errors = 0
            self._become(now_ns, NodeStatus.ERROR_ACTIVE, LinkState.RESTARTED)
        came, self._inbox = self._inbox, []
        return came

    def send(self, frames: Sequence[Frame]) -> None:
        """Queue a tick's frames of the vehicle bus behind those that are to be repeated."""
        if self.status is NodeStatus.BUS_OFF:
            return
        new = [Transmit(f.can_id, f.data, f.extended) for f in frames if f.bus is BusName.VEHICLE]
        fresh = {(frame.can_id, frame.extended) for frame in new}
        again = [frame for frame in self._again if (frame.can_id, frame.extended) not in fresh]
        self._again.clear()
        self._outgoing += [*again, *new]
        if self._notified:
            self._unconfirmed |= {(frame.can_id, frame.extended): frame for frame in (*again, *new)}

    def outgoing(self) -> bytes:
        """What is to be said at the next event, at most `MOST_BYTES` of it; the rest follows."""
        said = bytearray()
        while self._outgoing and len(said) + len(one := ls_bus.encode(self._outgoing[0])) <= MOST_BYTES:
            said += one
            del self._outgoing[0]
        if not said and self._outgoing:  # an answer longer than the variable
            del self._outgoing[0]
        return bytes(said)
