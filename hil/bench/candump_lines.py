"""What buses deliver as lines of a candump log, with an account of what was lost and which link went down."""

from collections.abc import Iterable
from pathlib import Path

from dbc.frame import BusName, LinkEvent, LinkState, Received
from hil.bus.error_frame import error_frame
from hil.errors import BrakebenchError, Verdict
from hil.rt.clock import clocks_ns

_LOST_FRAMES = {LinkState.RX_OVERFLOW, LinkState.TX_OVERFLOW}  # their number counts frames, not events
_DOWN = {LinkState.BUS_OFF: "went bus-off", LinkState.DISCONNECTED: "was disconnected"}
_UP = {LinkState.ERROR_ACTIVE, LinkState.RESTARTED}


class RecorderError(BrakebenchError):
    """The recording cannot go on."""

    exit_code = Verdict.INCOMPLETE.exit_code


class CandumpLines:
    """Writes down what arrived.

    Frames keep their monotonic times, all shifted by the time of day at which this began, whatever is done to the time
    of day afterwards; link events are written as the kernel's CAN error frames.

    Parameters
    ----------
    epoch_ns : time of day of monotonic time 0; None takes this machine's.

    Attributes
    ----------
    frames, lost : frames written down; frames lost before they reached us.
    """

    def __init__(self, epoch_ns: int | None = None) -> None:
        self.frames = self.lost = 0
        self._down: dict[BusName, LinkEvent] = {}
        self._wall_offset_ns = clocks_ns()[1] if epoch_ns is None else epoch_ns

    def clock_set_ns(self) -> int:
        """How far the time of day was set forward since this began, ns."""
        return clocks_ns()[1] - self._wall_offset_ns

    def text(self, received: Iterable[Received]) -> bytes:
        """Return the lines, in the order given."""
        return "".join(map(self._line, received)).encode("ascii")

    def _line(self, item: Received) -> str:
        times = 1
        if isinstance(item, LinkEvent):
            self._note(item)
            error_class, data = error_frame(item)
            identifier = f"{0x20000000 | error_class:08X}"
            times = 1 if item.state in _LOST_FRAMES else item.number
        else:
            self.frames += 1
            identifier, data = f"{item.can_id:08X}" if item.extended else f"{item.can_id:03X}", item.data
        seconds, rest = divmod(item.time_ns + self._wall_offset_ns, 1_000_000_000)
        return f"({seconds}.{rest // 1000:06d}) {item.bus} {identifier}#{data.hex().upper()}\n" * times

    def _note(self, event: LinkEvent) -> None:
        """Keep in mind what the end of the recording has to tell."""
        if event.state is LinkState.RX_OVERFLOW:
            self.lost += event.number
        elif event.state in _DOWN:
            self._down[event.bus] = event
        elif event.state in _UP:
            self._down.pop(event.bus, None)

    def check_links(self, path: Path) -> None:
        """Refuse a recording whose link failed and did not come back, so that it is not what was on the bus.

        Raises
        ------
        RecorderError : it says which.
        """
        if self._down:
            bus, event = next(iter(self._down.items()))
            raise RecorderError(
                f"{path}: recording is INCOMPLETE: the {bus} bus {_DOWN[event.state]} and did not come back; "
                "frames recorded after that were heard on this machine only. Check wires, bit rate and the other "
                "nodes, then take the link down and up"
            )


def by_time(received: list[Received]) -> list[Received]:
    """Sort what several buses delivered."""
    return sorted(received, key=lambda item: item.time_ns)
