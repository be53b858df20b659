"""Faults of a node's link: bus-off, adapter gone, queue full, frames lost on the way in. What a node sees of them.

The node gets the link events that a driver gives; frames do not pass meanwhile. The real thing is for the kernel's
slcan driver and for the timed bus.
"""

from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from dbc.messages import BrakeMode, Fault
from hil.faults.act import Act
from hil.faults.bus import NORMAL
from hil.faults.fault import Expected, FaultKind, Injection, Side
from hil.faults.targets import Takes

_ROW = "bus-off, queue full, overflow, unplugged"
_VEHICLE = BusName.VEHICLE


class _Down(Act):
    """No link for a while."""

    state = LinkState.BUS_OFF

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._down = False

    @property
    def holds(self) -> bool:
        """Whether the end is still to be told."""
        return self._down

    def hear(self, now_ns: int, inbox: list[Received]) -> list[Received]:
        """The bench bus alone while it is down, and the events of its begin and end."""
        acts = self.acts(now_ns)
        events: list[Received] = []
        if acts and not self._down:
            events = [LinkEvent(_VEHICLE, self.state, now_ns, detail="injected")]
        elif self._down and not acts:
            events = [LinkEvent(_VEHICLE, LinkState.RESTARTED, now_ns, detail="injected")]
        self._down = acts
        return events + ([item for item in inbox if item.bus is not _VEHICLE] if acts else inbox)

    def send(self, now_ns: int, frames: list[Frame]) -> list[Frame]:
        """The bench bus alone while it is down."""
        return [frame for frame in frames if frame.bus is not _VEHICLE] if self._down else frames


class BusOff(_Down):
    """The controller has left the bus."""


class Unplugged(_Down):
    """The adapter is gone."""

    state = LinkState.DISCONNECTED


class QueueFull(Act):
    """What is sent is not taken; the sender learns how much."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._lost = 0

    @property
    def holds(self) -> bool:
        """Whether lost frames are still to be told."""
        return bool(self._lost)

    def hear(self, now_ns: int, inbox: list[Received]) -> list[Received]:
        """The event of the last tick's loss first."""
        lost, self._lost = self._lost, 0
        return [LinkEvent(_VEHICLE, LinkState.TX_OVERFLOW, now_ns, lost, "injected"), *inbox] if lost else inbox

    def send(self, now_ns: int, frames: list[Frame]) -> list[Frame]:
        """Without those not taken."""
        if not self.acts(now_ns):
            return frames
        kept: list[Frame] = []
        for frame in frames:
            if frame.bus is _VEHICLE and self.left > 0:
                self._lost += 1
                self.left -= 1
            else:
                kept.append(frame)
        return kept


class RxOverflow(Act):
    """What arrives is lost in the receive queue; the receiver learns how much."""

    def hear(self, now_ns: int, inbox: list[Received]) -> list[Received]:
        """Without those lost, and the event."""
        if not self.acts(now_ns):
            return inbox
        kept: list[Received] = []
        lost = 0
        for item in inbox:
            if isinstance(item, Frame) and item.bus is _VEHICLE and self.left > 0:
                lost += 1
                self.left -= 1
            else:
                kept.append(item)
        return [LinkEvent(_VEHICLE, LinkState.RX_OVERFLOW, now_ns, lost, "injected"), *kept] if lost else kept


_MODES = frozenset({BrakeMode.FRICTION_ONLY, BrakeMode.SAFE_STOP})
_EVERYTHING = Fault((1 << 14) - 1)  # a node without a link misses all messages
_DOWN = Expected(_MODES, _EVERYTHING, detect_ms=10.0, motor_zero_ms=50.0)
_LOSES = Expected(_MODES | NORMAL | {BrakeMode.DEGRADED}, _EVERYTHING)


def _kind(number: int, name: str, text: str, side: Side, reaction: Expected, for_s: float) -> FaultKind:
    return FaultKind(
        number, name, "link", text, _ROW, side, Takes.PROCESS, ("ECU", "PLANT"), reaction, of_target=False,
        usual_values=(("for_s", for_s),),
    )  # fmt: skip


FAULTS: tuple[tuple[FaultKind, type[Act]], ...] = (
    (_kind(40, "bus_off", "The node is off the vehicle bus: neither sends nor hears; restarted at the end.",
           Side.RECEIVER, _DOWN, 0.3), BusOff),
    (_kind(41, "unplugged", "The node's adapter is gone, and comes back at the end.", Side.RECEIVER, _DOWN, 0.3),
     Unplugged),
    (_kind(42, "queue_full", "Frames of the node are not taken by its transmit queue, and do not come later.",
           Side.SENDER, _LOSES, 0.05), QueueFull),
    (_kind(43, "rx_overflow", "Frames are lost in the node's receive queue; others get them.", Side.RECEIVER, _LOSES,
           0.05), RxOverflow),
)  # fmt: skip
