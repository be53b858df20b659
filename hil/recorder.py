"""The recorder: a process of its own that appends every frame of both buses to one candump file."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from dbc.frame import LinkEvent, LinkState, Received
from hil.errors import BrakebenchError
from hil.rt.clock import WallClock, wall_time_ns

FLUSH_PERIOD_NS = 20_000_000

# link state -> class and data[1], data[4] of the CAN error frame that says it (linux/can/error.h)
_ERROR_FRAMES: dict[LinkState, tuple[int, int, int]] = {
    LinkState.RX_OVERFLOW: (0x004, 0x01, 0),
    LinkState.TX_OVERFLOW: (0x004, 0x02, 0),
    LinkState.ERROR_WARNING: (0x004, 0x08, 0),
    LinkState.ERROR_PASSIVE: (0x004, 0x20, 0),
    LinkState.ERROR_ACTIVE: (0x004, 0x40, 0),
    LinkState.DISCONNECTED: (0x010, 0, 0x44),  # transceiver: no wire on either line
    LinkState.NO_ACK: (0x020, 0, 0),
    LinkState.BUS_OFF: (0x040, 0, 0),
    LinkState.BUS_ERROR: (0x080, 0, 0),
    LinkState.RESTARTED: (0x100, 0, 0),
}


class RecorderError(BrakebenchError):
    """The recording cannot go on."""

    exit_code = 3


class Source(Protocol):
    """What a recorder listens to."""

    def receive(self, timeout_s: float) -> list[Received]:
        """Return what arrived since the last call."""
        ...


class Recorder:
    """Appends frames to a candump log; what was received 20 ms before a kill is in the file.

    Frames keep the monotonic times of their senders, shifted once to the time of day; link events are written as the
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
        self._wall_offset_ns = wall_time_ns() - WallClock().now_ns() if epoch_ns is None else epoch_ns
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError as error:
            raise RecorderError(f"{path}: exists already; a recording never overwrites, name another file") from error
        except OSError as error:
            raise RecorderError(f"{path}: cannot be created ({error.strerror})") from error

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
        if isinstance(item, LinkEvent):
            if item.state is LinkState.RX_OVERFLOW:
                self.lost += item.number
            error_class, controller, transceiver = _ERROR_FRAMES[item.state]
            identifier, data = f"{0x20000000 | error_class:08X}", bytes((0, controller, 0, 0, transceiver, 0, 0, 0))
        else:
            self.frames += 1
            identifier, data = f"{item.can_id:08X}" if item.extended else f"{item.can_id:03X}", item.data
        seconds, rest = divmod(item.time_ns + self._wall_offset_ns, 1_000_000_000)
        return f"({seconds}.{rest // 1000:06d}) {item.bus} {identifier}#{data.hex().upper()}\n"

    def close(self) -> None:
        """Write what is left and close the file."""
        self.flush()
        os.close(self._file)
