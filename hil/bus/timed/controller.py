"""A CAN controller: what waits in it, its error counters, and what it tells its host."""

from typing import TYPE_CHECKING, NamedTuple

from dbc.frame import LinkEvent, LinkState
from hil.bus.timed.counters import ErrorCounters
from hil.bus.timed.noise import BitErrors
from hil.bus.timed.transmit_queue import Request, TransmitQueue
from hil.bus.timed.wire import WireFrame

if TYPE_CHECKING:
    from hil.bus.timed.bus import TimedBus

SEQUENCES_TO_RECOVER = 128  # of 11 recessive bits each, until a controller is back from bus-off


class Reception(NamedTuple):
    """A frame that a controller received, and when it ended."""

    frame: WireFrame
    time_ns: int


class Controller:
    """Made by `TimedBus.join`, which describes the parameters.

    Attributes
    ----------
    counters, state : error counters, and the state they are in.
    queue : what waits to be sent.
    unplugged : not joined to the wires; what is sent meanwhile waits. May be set at any time, as may ``bit_rate``.
    dropped : frames that were not taken, or were dropped at bus-off.
    """

    def __init__(
        self,
        bus: "TimedBus",
        name: str,
        queue: TransmitQueue,
        bit_rate: int,
        listen_only: bool,
        restart_after_ns: int | None,
        noise: BitErrors,
    ) -> None:
        self.name = name
        self.queue = queue
        self.bit_rate = bit_rate
        self.listen_only = listen_only
        self.restart_after_ns = restart_after_ns
        self.noise = noise
        self.counters = ErrorCounters()
        self.state = LinkState.ERROR_ACTIVE
        self.unplugged = False
        self.dropped = 0
        self.ready_ns = 0  # suspended until then, after a transmission in the passive state
        self.recover_from_ns: int | None = None
        self.sequences = 0
        self._bus = bus
        self._told_unacknowledged = False
        self._inbox: list[Reception | LinkEvent] = []

    def send(self, frame: WireFrame, now_ns: int) -> bool:
        """Ask for a frame to be sent; False where it is not taken (queue full, bus-off).

        Raises
        ------
        ValueError
            A frame that no bus can carry, a listen-only controller, or a time before the last one.
        """
        frame.check()
        if self.listen_only:
            raise ValueError(f"controller {self.name} only listens; it cannot send {frame.can_id:#x}")
        self._bus.advance(now_ns)
        if self.state is LinkState.BUS_OFF:
            self.dropped += 1
            return False
        if not self.queue.push(frame, now_ns):
            self.dropped += 1
            self.tell(LinkState.TX_OVERFLOW, now_ns, "transmit queue full")
            return False
        return True

    def receive(self) -> list[Reception | LinkEvent]:
        """Everything that arrived up to the time the bus has been advanced to, in order."""
        inbox, self._inbox = self._inbox, []
        return inbox

    def restart(self, now_ns: int) -> None:
        """Begin the recovery from bus-off, as the host asks for; of no effect in any other state."""
        self._bus.advance(now_ns)
        if self.state is LinkState.BUS_OFF and self.recover_from_ns is None:
            self.recover_from_ns = now_ns

    @property
    def present(self) -> bool:
        """Takes part in the traffic."""
        return not self.unplugged and self.state is not LinkState.BUS_OFF

    @property
    def flags(self) -> bool:
        """An error makes it send an active error flag."""
        return not self.listen_only and self.state not in (LinkState.ERROR_PASSIVE, LinkState.BUS_OFF)

    def tell(self, state: LinkState, time_ns: int, detail: str = "") -> None:
        """Put a link event into the inbox, counted into the last one where that is of its kind."""
        last = self._inbox[-1] if self._inbox else None
        if isinstance(last, LinkEvent) and last.state is state:
            self._inbox[-1] = last._replace(number=last.number + 1)
        else:
            self._inbox.append(LinkEvent(self._bus.name, state, time_ns, 1, detail))

    def take(self, reception: Reception) -> None:
        """Receive a frame."""
        self._inbox.append(reception)
        if self.counters.receive:
            self.counters.received()
            self.follow(reception.time_ns)

    def finish(self, request: Request, time_ns: int) -> None:
        """Be done with a frame that was acknowledged."""
        self.queue.remove(request)
        self._told_unacknowledged = False
        if self.counters.transmit:
            self.counters.sent()
            self.follow(time_ns)

    def unacknowledged(self, time_ns: int) -> None:
        """Tell the host, once until a frame is acknowledged again: tries follow each other by the thousand."""
        if not self._told_unacknowledged:
            self.tell(LinkState.NO_ACK, time_ns, "no acknowledge")
        self._told_unacknowledged = True

    def follow(self, time_ns: int) -> None:
        """Bring the state in line with the counters, and tell the host where it changes."""
        state = self.counters.state
        if state is self.state:
            return
        self.state = state
        sent, received = self.counters.transmit, self.counters.receive
        side = "transmit" if sent >= received else "receive"
        self.tell(state, time_ns, f"{side} errors; counters tx {sent} rx {received}")
        if state is LinkState.BUS_OFF:
            self.dropped += self.queue.clear()
            self.sequences = 0
            self.recover_from_ns = None if self.restart_after_ns is None else time_ns + self.restart_after_ns

    def recovered(self, time_ns: int) -> None:
        """Be back from bus-off."""
        self.counters.reset()
        self.recover_from_ns = None
        self.ready_ns = time_ns
        self.state = LinkState.ERROR_ACTIVE
        self.tell(LinkState.RESTARTED, time_ns, "back from bus-off")
