"""The recorder: a process of its own that appends every frame of both buses to one candump file."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from dbc.frame import BusName, LinkEvent, LinkState, Received
from hil.bus.error_frame import error_frame
from hil.errors import BrakebenchError, Verdict
from hil.rt.clock import clocks_ns

FLUSH_PERIOD_NS = 20_000_000

_LOST_FRAMES = {LinkState.RX_OVERFLOW, LinkState.TX_OVERFLOW}  # their number counts frames, not events
_DOWN = {LinkState.BUS_OFF: "went bus-off", LinkState.DISCONNECTED: "was disconnected"}
_UP = {LinkState.ERROR_ACTIVE, LinkState.RESTARTED}


class RecorderError(BrakebenchError):
    """The recording cannot go on."""

    exit_code = Verdict.INCOMPLETE.exit_code


class Source(Protocol):
    """What a recorder listens to."""

    def receive(self, timeout_s: float) -> list[Received]:
        """Return what arrived since the last call."""
        ...


class Recorder:
    """Appends frames to a candump log; what was received 20 ms before a kill is in the file.

    Frames keep their monotonic times, all shifted by the time of day at which the recorder began, whatever is done to
    the time of day afterwards; link events are written as the
    kernel's CAN error frames. Lines of one flush are in order of time.

    Parameters
    ----------
    path : file to create; never overwritten.
    buses : what to listen to.
    epoch_ns : time of day of monotonic time 0; None takes this machine's.
    """

    def __init__(self, path: Path, buses: Sequence[Source], epoch_ns: int | None = None) -> None:
        self.path = path
        self.frames = 0
        self.lost = 0
        self._buses = buses
        self._down: dict[BusName, LinkEvent] = {}
        self._wall_offset_ns = clocks_ns()[1] if epoch_ns is None else epoch_ns
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError as error:
            raise RecorderError(f"{path}: exists already; a recording never overwrites, name another file") from error
        except OSError as error:
            raise RecorderError(f"{path}: cannot be created ({error.strerror})") from error

    def clock_set_ns(self) -> int:
        """How far the time of day was set forward since the recorder began, ns."""
        return clocks_ns()[1] - self._wall_offset_ns

    def flush(self) -> None:
        """Take what arrived and append it."""
        received = [item for bus in self._buses for item in bus.receive(0.0)]
        if not received:
            return
        received.sort(key=lambda item: item.time_ns)
        text = "".join(map(self._line, received)).encode("ascii")
        try:
            while text:
                text = text[os.write(self._file, text) :]
        except OSError as error:
            raise RecorderError(f"{self.path}: recording is INCOMPLETE ({error.strerror})") from error

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

    def close(self) -> None:
        """Write what is left and close the file.

        Raises
        ------
        RecorderError
            A link had failed and not come back, so that the file is not what was on the bus.
        """
        self.flush()
        os.close(self._file)
        if self._down:
            bus, event = next(iter(self._down.items()))
            raise RecorderError(
                f"{self.path}: recording is INCOMPLETE: the {bus} bus {_DOWN[event.state]} and did not come back; "
                "frames recorded after that were heard on this machine only. Check wires, bit rate and the other "
                "nodes, then take the link down and up"
            )
