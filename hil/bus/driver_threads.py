"""A python-can driver in threads of its own, since any of its calls may block: for a time, or for ever.

One thread opens the driver, reads it, reopens it after a disconnection and closes it; another one sends. Whoever uses
them waits for neither longer than a stated time. Both are daemons: one that never comes back ends with the process.
"""

import contextlib
import os
import select
import termios
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from dbc.frame import LinkState
from hil.bus.bus import BusError, BusSpec
from hil.bus.python_can_driver import descriptor, has_buffered, is_gone, open_driver, shut
from hil.rt.clock import monotonic_ns

if TYPE_CHECKING:
    import can

OPEN_S = 10.0  # a driver may sleep after it has opened its port (slcan: 2 s), or load firmware
CLOSE_S = 0.5  # then the node ends without the driver
_HANDOVER_NS = 2_000_000  # how long a sender may be held up, so that a burst does not overtake the driver
_MOST_WAITING = 1024  # frames; at 500 kbit/s a bus carries about 4000 a second
MOST_AGE_NS = 50_000_000  # older than the time-outs of those who wait for it: as good as lost, or worse
_TURN_S = 0.05  # of a reader that nothing can wake
_WAITED_NS = 200_000  # a driver that hands a message over at once had it already
_PAUSE_S = 0.001  # between two looks at a driver that does not wait
FIRST_RETRY_S, LAST_RETRY_S = 0.05, 0.2


class DriverThreads:
    """Opens a driver and runs it until closed.

    Parameters
    ----------
    spec : what to open.
    took : takes a message that was received (None: there was none), and whether it had been waited for; called by one
        thread of ours.
    told : takes a link state, a number and a detail; called by any thread.
    timeout : of the driver's ``send``, s; None waits.

    Raises
    ------
    BusError : it cannot be opened, or not within 10 s.
    """

    def __init__(
        self,
        spec: BusSpec,
        took: "Callable[[can.Message | None, bool], None]",
        told: Callable[[LinkState, int, str], None],
        timeout: float | None,
    ) -> None:
        self._spec = spec
        self._took = took
        self._told = told
        self._timeout = timeout
        self._changed = threading.Condition()
        self._driver: can.BusABC | None = None
        self._waiting: deque[tuple[int, can.Message]] = deque()
        self._busy_since_ns: int | None = None  # the sender has a frame in hand
        self._closing = threading.Event()
        self._closing_seen, self._closing_told = os.pipe()
        self._opened = threading.Event()
        self._refusal: BusError | None = None
        self._owner = threading.Thread(target=self._own, name=f"{spec.name}: driver", daemon=True)
        self._sender = threading.Thread(target=self._send_all, name=f"{spec.name}: sender", daemon=True)
        self._owner.start()
        try:
            if not self._opened.wait(OPEN_S):
                raise BusError(f"bus {spec.name}: did not open within {OPEN_S:g} s: does the adapter answer?")
            if self._refusal is not None:
                raise self._refusal
        except BaseException:  # a signal too
            self._ask_to_close()
            os.close(self._closing_seen)
            raise
        self._sender.start()

    def send(self, messages: "Sequence[can.Message]") -> None:
        """Hand messages to the sender; what has no room is refused and told."""
        refused = ""
        now_ns = monotonic_ns()
        with self._changed:
            room = max(0, _MOST_WAITING - len(self._waiting))
            if self._driver is None:
                room, refused = 0, "disconnected"
            elif room < len(messages):
                refused = "the driver takes no more"
            self._waiting.extend((now_ns, message) for message in messages[:room])
            self._changed.notify_all()
            held_up = self._busy_since_ns is not None and now_ns - self._busy_since_ns > _HANDOVER_NS
            if room and not held_up:
                self._changed.wait_for(self._idle, _HANDOVER_NS * 1e-9)
        if refused and len(messages) > room:
            self._told(LinkState.TX_OVERFLOW, len(messages) - room, refused)

    def close(self) -> bool:
        """Send what waits and shut the driver; False where that takes longer than half a second: it is left alone."""
        self._ask_to_close()
        deadline_ns = monotonic_ns() + int(CLOSE_S * 1e9)
        for thread in (self._sender, self._owner):
            thread.join(max(0.0, (deadline_ns - monotonic_ns()) * 1e-9))
        if self._owner.is_alive() or self._sender.is_alive():
            return False
        os.close(self._closing_seen)
        return True

    def _ask_to_close(self) -> None:
        with self._changed:
            if not self._closing.is_set():
                self._closing.set()
                os.close(self._closing_told)  # its other end becomes readable
                self._changed.notify_all()

    # the owner's thread

    def _own(self) -> None:
        try:
            driver, first = open_driver(self._spec)
        except BusError as error:
            self._refusal = error
            self._opened.set()
            return
        if self._closing.is_set():  # nobody waits for it any more
            shut(driver)
            return
        self._driver = driver
        self._opened.set()
        while True:
            if first is not None:
                self._took(first, False)
            self._read(driver)
            with self._changed:
                self._changed.wait_for(self._idle, CLOSE_S / 2 if self._closing.is_set() else 0.0)
                self._driver = None
                self._waiting.clear()
                if not (self._idle() and has_room(driver, 0)):
                    discard_output(driver)  # else it holds up the sender, or the driver's own last words
                self._changed.notify_all()
                self._changed.wait_for(self._idle)  # never shut under the sender's hands
            shut(driver)
            reopened = self._reopen()
            if reopened is None:
                return
            driver, first = reopened
            with self._changed:
                self._driver = driver
            self._told(LinkState.RESTARTED, 1, "reconnected")

    def _idle(self) -> bool:
        return not self._waiting and self._busy_since_ns is None

    def _read(self, driver: "can.BusABC") -> None:
        """Read until the driver is lost or the bus is closed; an error twice running is a disconnection."""
        failed = False
        while self._driver is driver and not self._closing.is_set():
            began_ns = monotonic_ns()
            try:
                message = driver.recv(self._await(driver))
            except Exception as error:  # drivers raise what they like; a node must live
                if failed or is_gone(error):
                    self._lose(driver, error)
                failed = True
                continue
            waited_ns = monotonic_ns() - began_ns
            self._took(message, waited_ns > _WAITED_NS)
            if message is not None:
                failed = False
            elif waited_ns < _PAUSE_S * 1e9 and not has_buffered(driver):  # it does not wait
                self._closing.wait(_PAUSE_S)

    def _await(self, driver: "can.BusABC") -> float:
        """Wait on the driver's descriptor where it has one; return what is left to wait for ``recv``."""
        if has_buffered(driver):
            return 0.0
        file = descriptor(driver)
        if file == -1:
            return _TURN_S
        ready = select.poll()
        ready.register(file, select.POLLIN)
        ready.register(self._closing_seen, 0)
        ready.poll(_TURN_S * 1e3)
        return 0.0

    def _lose(self, driver: "can.BusABC", error: Exception) -> None:
        """Take the driver out of use; its thread will reopen it."""
        with self._changed:
            if self._driver is not driver:
                return
            self._driver = None
            dropped = len(self._waiting)
            self._waiting.clear()
            self._changed.notify_all()
        self._told(LinkState.DISCONNECTED, 1, f"{self._spec.name}: {error}")
        if dropped:
            self._told(LinkState.TX_OVERFLOW, dropped, "disconnected")

    def _reopen(self) -> "tuple[can.BusABC, can.Message | None] | None":
        """Try until it opens; None where the bus is closed before."""
        retry_s = FIRST_RETRY_S
        while not self._closing.wait(retry_s):
            retry_s = min(2.0 * retry_s, LAST_RETRY_S)
            try:
                opened = open_driver(self._spec)
            except BusError:
                continue
            if self._closing.is_set():
                shut(opened[0])
                return None
            return opened
        return None

    # the sender's thread

    def _send_all(self) -> None:
        while True:
            with self._changed:
                self._busy_since_ns = None
                if not self._waiting:
                    self._changed.notify_all()
                self._changed.wait_for(lambda: self._waiting or self._closing.is_set())
                if not self._waiting:
                    return
                driver = self._driver
                began_ns, message = self._waiting.popleft()
                self._busy_since_ns = monotonic_ns()
            self._send(driver, message, began_ns)

    def _send(self, driver: "can.BusABC | None", message: "can.Message", began_ns: int) -> None:
        if driver is None:
            self._told(LinkState.TX_OVERFLOW, 1, "disconnected")
            return
        if self._late(began_ns) or not self._await_room(driver) or self._late(began_ns):
            self._told(LinkState.TX_OVERFLOW, 1, "the driver takes nothing")
            return
        try:
            driver.send(message, self._timeout)
        except Exception as error:  # as in reading
            self._told(LinkState.TX_OVERFLOW, 1, str(error))
            discard_output(driver)  # half a line, with nothing but older ones before it
            if is_gone(error):
                self._lose(driver, error)

    def _late(self, began_ns: int) -> bool:
        return monotonic_ns() - began_ns > MOST_AGE_NS

    def _await_room(self, driver: "can.BusABC") -> bool:
        """Wait until the driver's descriptor takes something, at most for the age of a frame.

        pyserial, under slcan, would spin on a port that takes nothing. What the port still holds then is older than
        the frame that waits, and is taken back.
        """
        if has_room(driver, MOST_AGE_NS * 1e-6):
            return True
        discard_output(driver)
        return False


def has_room(driver: "can.BusABC", timeout_ms: float) -> bool:
    """Whether a driver takes something, or does not tell."""
    file = descriptor(driver)
    if file == -1:
        return True
    room = select.poll()
    room.register(file, select.POLLOUT)
    return bool(room.poll(timeout_ms))


def discard_output(driver: "can.BusABC") -> None:
    """Take back what a serial port has not sent yet; nothing happens with any other driver."""
    file = descriptor(driver)
    if file != -1 and os.isatty(file):
        with contextlib.suppress(termios.error):
            termios.tcflush(file, termios.TCOFLUSH)
