"""Any adapter python-can opens, behind our protocol.

python-can is imported on first use (it takes 0.4 s) and kept quiet: what it would log becomes a link event or an error.
"""

import errno
import select
import threading
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Self

from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from hil.bus.bus import BusError, BusSpec
from hil.bus.can_frame import pack_frame
from hil.bus.error_frame import append_event, link_events
from hil.bus.python_can_driver import error_number, open_driver, shut
from hil.rt.clock import monotonic_ns, wall_time_ns

if TYPE_CHECKING:
    import can

_MOST_MESSAGES = 4096  # per receive: a babbling bus does not hold the caller up
_STAMP_TRUST_NS = 10_000_000_000  # a driver's stamp further from now counts from elsewhere
_FIRST_RETRY_S, _LAST_RETRY_S = 0.1, 5.0
_GONE = {errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EIO, errno.EBADF, errno.EPIPE, errno.ENETUNREACH}
_WAITING_DRIVERS = {"slcan", "canalystii"}  # with a timeout of 0 these write half a line, or fail although they sent


class PythonCanBus:
    """A member on a bus of python-can.

    Parameters
    ----------
    spec : interface, channel and the interface's own options; ``listen_only=true`` where the driver can.
    bus : which of the two buses it carries.

    Raises
    ------
    BusError : no such interface or channel, driver missing, interface down, wrong option.
    """

    def __init__(self, spec: BusSpec, bus: BusName) -> None:
        self.name = spec.name
        self.bus = bus
        self.ignored = 0
        """Remote and CAN FD frames received: not of a classical data bus."""
        self._spec = spec
        self._pending: list[Received] = []
        self._refused: dict[str, int] = {}
        self._closing = threading.Event()
        self._reopened = threading.Event()
        self._driver: can.BusABC | None
        self._first: can.Message | None
        self._driver, self._first = open_driver(spec)

    def send(self, frames: Sequence[Frame]) -> None:
        """Send frames; what the driver's queue does not take is dropped, not kept for later."""
        import can

        self._refuse_closed()
        timeout = None if self._spec.kind in _WAITING_DRIVERS else 0.0
        messages = []
        for frame in frames:
            pack_frame(frame, self.bus)  # for what it refuses
            _, can_id, data, _, extended = frame
            messages.append(can.Message(arbitration_id=can_id, is_extended_id=extended, data=data))
        for number, message in enumerate(messages):
            if (driver := self._current()) is None:
                self._refuse("disconnected", len(messages) - number)
                return
            try:
                driver.send(message, timeout)
            except Exception as error:  # drivers raise what they like; a node must live
                self._refuse(str(error), 1)
                if error_number(error) in _GONE:
                    self._disconnect(error)

    def receive(self, timeout_s: float = 0.0) -> list[Received]:
        """Return everything there is, in order; wait up to ``timeout_s`` for the first."""
        self._refuse_closed()
        received, self._pending = self._pending, []
        for detail, count in self._refused.items():
            received.append(LinkEvent(self.bus, LinkState.TX_OVERFLOW, monotonic_ns(), count, detail))
        self._refused.clear()
        deadline_ns = monotonic_ns() + int(timeout_s * 1e9)
        wait_s = 0.0 if received else timeout_s
        while True:
            self._read(wait_s, received)
            left_ns = deadline_ns - monotonic_ns()
            if received or left_ns <= 0:
                return received
            wait_s = left_ns * 1e-9

    def fileno(self) -> int:
        """Return the driver's descriptor; -1 where it has none or is disconnected."""
        if self._driver is None or self._first is not None or self._pending:
            return -1
        try:
            return self._driver.fileno()
        except Exception:  # it has none; or it is just being unplugged
            return -1

    def close(self) -> None:
        """Leave the bus and end reconnecting."""
        self._closing.set()
        driver, self._driver = self._driver, None
        if driver is not None:
            shut(driver)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _read(self, wait_s: float, received: list[Received]) -> None:
        """Append one wait's worth of messages; an error twice running is a disconnection."""
        failed = False
        offset_ns = wall_time_ns() - monotonic_ns()
        for _ in range(_MOST_MESSAGES):
            driver = self._current(wait_s)
            if self._pending:
                received += self._pending
                self._pending.clear()
                wait_s = 0.0
            if driver is None:
                return
            try:
                message = self._first or driver.recv(self._await(wait_s))
                self._first = None
            except Exception as error:  # as in send
                if failed or error_number(error) in _GONE:
                    self._disconnect(error)
                failed = True
                continue
            if message is None:
                return
            failed, wait_s = False, 0.0
            self._take(message, offset_ns, received)

    def _await(self, wait_s: float) -> float:
        """Wait on the descriptor where there is one (python-can waits in wall time); return what is left to wait."""
        if wait_s > 0 and (file := self.fileno()) != -1:
            ready = select.poll()
            ready.register(file, select.POLLIN)
            ready.poll(wait_s * 1e3)
            return 0.0
        return wait_s

    def _take(self, message: "can.Message", offset_ns: int, received: list[Received]) -> None:
        now_ns = monotonic_ns()
        time_ns = int(message.timestamp * 1e9) - offset_ns
        if abs(time_ns - now_ns) > _STAMP_TRUST_NS:
            time_ns = now_ns
        if message.is_error_frame:
            for event in link_events(message.arbitration_id, bytes(message.data), self.bus, time_ns):
                append_event(event, received)
        elif message.is_remote_frame or message.is_fd:
            self.ignored += 1
        else:
            data = bytes(message.data[:8])
            received.append(Frame(self.bus, message.arbitration_id, data, time_ns, message.is_extended_id))

    def _refuse_closed(self) -> None:
        if self._closing.is_set():
            raise ValueError(f"{self.name} is closed")

    def _refuse(self, detail: str, count: int) -> None:
        self._refused[detail] = self._refused.get(detail, 0) + count

    def _current(self, wait_s: float = 0.0) -> "can.BusABC | None":
        """Return the driver; after a disconnection, wait for the one a thread reopens."""
        if self._driver is None and not self._closing.is_set() and not self._pending:
            self._reopened.wait(wait_s)
        if self._reopened.is_set():
            self._reopened.clear()
            self._pending.append(LinkEvent(self.bus, LinkState.RESTARTED, monotonic_ns(), 1, "reconnected"))
        return self._driver

    def _disconnect(self, error: Exception) -> None:
        driver, self._driver = self._driver, None
        if driver is None:
            return
        shut(driver)
        self._pending.append(LinkEvent(self.bus, LinkState.DISCONNECTED, monotonic_ns(), 1, f"{self.name}: {error}"))
        threading.Thread(target=self._reopen, name=f"reopen {self.name}", daemon=True).start()

    def _reopen(self) -> None:
        """Try until it opens: some drivers take seconds, which a node's loop does not have."""
        retry_s = _FIRST_RETRY_S
        while not self._closing.wait(retry_s):
            retry_s = min(2.0 * retry_s, _LAST_RETRY_S)
            try:
                driver, first = open_driver(self._spec)
            except BusError:
                continue
            self._driver, self._first = driver, first
            self._reopened.set()
            if self._closing.is_set():
                self.close()
            return
