"""Any adapter python-can opens, behind our protocol.

python-can is imported on first use (it takes 0.4 s) and kept quiet: what it would log becomes a link event or an error.
"""

import contextlib
import os
import select
import threading
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Self

from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from hil.bus.bus import JOINABLE, BusSpec
from hil.bus.can_frame import pack_frame
from hil.bus.channel import claim_adapter
from hil.bus.driver_threads import MOST_AGE_NS, DriverThreads
from hil.bus.error_frame import append_event, link_events
from hil.bus.wall_stamps import WallStamps
from hil.rt.clock import monotonic_ns

if TYPE_CHECKING:
    import can

_MOST_RECEIVED = 1 << 16  # frames and events that wait to be received; beyond it they are lost and counted
# with a timeout of 0 these write half a line, or fail although they sent; None waits
_SEND_TIMEOUTS_S: dict[str, float | None] = {"slcan": MOST_AGE_NS * 1e-9, "canalystii": None}


class PythonCanBus:
    """A member on a bus of python-can; the driver runs in threads of its own, so no call here waits for it.

    Parameters
    ----------
    spec : interface, channel and the interface's own options; ``listen_only=true`` where the driver can.
    bus : which of the two buses it carries.

    Raises
    ------
    BusError : no such interface or channel, driver missing, interface down, wrong option, no answer within 10 s.
    """

    def __init__(self, spec: BusSpec, bus: BusName) -> None:
        self.name = spec.name
        self.bus = bus
        self.ignored = 0
        """Remote and CAN FD frames received: not of a classical data bus."""
        self._stamps = WallStamps()
        self._lock = threading.Lock()  # held for moments, never while a driver is called
        self._received: list[Received] = []
        self._refused: dict[str, int] = {}
        self._overrun = 0
        self._closed = False
        claim = contextlib.ExitStack()
        if spec.kind not in JOINABLE:
            claim.enter_context(claim_adapter(spec))
        self._claim = claim
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        try:
            self._driver = DriverThreads(spec, self._take, self._tell, _SEND_TIMEOUTS_S.get(spec.kind, 0.0))
        except BaseException:
            os.close(self._wake)
            claim.close()
            raise

    def send(self, frames: Sequence[Frame]) -> None:
        """Send frames; what the driver does not take soon is dropped, not kept for later."""
        import can

        self._refuse_closed()
        messages = []
        for frame in frames:
            pack_frame(frame, self.bus)  # for what it refuses
            _, can_id, data, _, extended = frame
            messages.append(can.Message(arbitration_id=can_id, is_extended_id=extended, data=data))
        self._driver.send(messages)

    def receive(self, timeout_s: float = 0.0) -> list[Received]:
        """Return everything there is, in order; wait up to ``timeout_s`` for the first."""
        self._refuse_closed()
        deadline_ns = monotonic_ns() + int(timeout_s * 1e9)
        ready = select.poll()
        ready.register(self._wake, select.POLLIN)
        while True:
            received = self._collect()
            left_ns = deadline_ns - monotonic_ns()
            if received or left_ns <= 0:
                return received
            ready.poll(left_ns * 1e-6)

    def fileno(self) -> int:
        """Return what becomes readable with something to receive; -1 once closed."""
        return -1 if self._closed else self._wake

    def close(self) -> None:
        """Leave the bus, with or without the driver's consent: after half a second it is left to itself."""
        if not self._closed:
            self._closed = True
            if self._driver.close():
                os.close(self._wake)
            self._claim.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _collect(self) -> list[Received]:
        """Everything that arrived or happened since the last time."""
        with self._lock:
            received, self._received = self._received, []
            refused, self._refused = self._refused, {}
            overrun, self._overrun = self._overrun, 0
            if received or refused or overrun:
                os.eventfd_read(self._wake)
        now_ns = monotonic_ns()
        if overrun:
            received.append(LinkEvent(self.bus, LinkState.RX_OVERFLOW, now_ns, overrun, "nobody received"))
        for detail, count in refused.items():
            received.append(LinkEvent(self.bus, LinkState.TX_OVERFLOW, now_ns, count, detail))
        return received

    def _tell(self, state: LinkState, number: int, detail: str) -> None:
        """Take what happened to the link, of any thread."""
        with self._lock:
            self._waken()
            if state is LinkState.TX_OVERFLOW:
                self._refused[detail] = self._refused.get(detail, 0) + number
            else:
                self._received.append(LinkEvent(self.bus, state, monotonic_ns(), number, detail))

    def _take(self, message: "can.Message | None", waited: bool) -> None:
        """Take a message, of the driver's thread."""
        self._stamps.look(message is None or waited)
        if message is None:
            return
        time_ns = self._stamps.monotonic_of(int(message.timestamp * 1e9))
        with self._lock:
            if message.is_error_frame:
                self._waken()
                for event in link_events(message.arbitration_id, bytes(message.data), self.bus, time_ns):
                    append_event(event, self._received)
            elif message.is_remote_frame or message.is_fd:
                self.ignored += 1
            else:
                self._waken()
                if len(self._received) >= _MOST_RECEIVED:
                    self._overrun += 1
                    return
                data = bytes(message.data[:8])
                self._received.append(Frame(self.bus, message.arbitration_id, data, time_ns, message.is_extended_id))

    def _waken(self) -> None:
        """Make the descriptor readable, once; under the lock, before anything is added."""
        if not (self._received or self._refused or self._overrun):
            os.eventfd_write(self._wake, 1)

    def _refuse_closed(self) -> None:
        if self._closed:
            raise ValueError(f"{self.name} is closed")
