"""A tester's end of an ISO-TP connection on one of our buses: can-isotp without its threads, for udsoncan.

can-isotp's own thread ends for good at the first error of a bus; here the caller's thread drives its stack, and what a
bus does not take is told.
"""

import logging
from collections import deque

import isotp
from udsoncan.connections import BaseConnection
from udsoncan.exceptions import TimeoutException

from dbc.diagnostic_ids import FRAME_BYTES, PADDING
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.isotp import single_most
from hil.bus.bus import Bus
from hil.errors import BrakebenchError
from hil.rt.clock import monotonic_ns
from hil.uds.addresses import Identifier

SINGLE_MOST = single_most(FRAME_BYTES)
_MOST_BYTES = 1 << 24  # longest answer taken; memory is used as it comes
_STEP_S = 0.002  # longest wait while a segmented request is sent: separation times count in ms
_LOST = {LinkState.TX_OVERFLOW, LinkState.DISCONNECTED, LinkState.BUS_OFF, LinkState.NO_ACK}


class SilenceError(TimeoutException):
    """What udsoncan takes for a time-out, with types."""

    def __init__(self, text: str) -> None:
        Exception.__init__(self, text)


class IsoTpConnection(BaseConnection):
    """Messages to and from one ECU.

    Parameters
    ----------
    bus : joined by the caller, and left by it.
    request, answer : identifiers of the ECU.
    functional : requests go to this identifier, so to all ECUs; only this ECU's answers are taken.
    periodic : identifier of its periodic data, whose frames `take_periodic` gives.

    Raises
    ------
    BrakebenchError : one identifier for both, or one of 11 and one of 29 bits.
    """

    def __init__(
        self,
        bus: Bus,
        request: Identifier,
        answer: Identifier,
        functional: Identifier | None = None,
        periodic: Identifier | None = None,
    ) -> None:
        super().__init__(bus.name)
        if request == answer or request.extended != answer.extended:
            raise BrakebenchError(
                f"request {request} and answer {answer}: expected two different identifiers, both of 11 or of 29 bits"
            )
        self.trouble: list[str] = []
        """What went wrong below the messages since the last request."""
        self._bus, self._functional, self._periodic = bus, functional, periodic
        self._samples: list[tuple[int, bytes]] = []
        self._arrived: deque[isotp.CanMessage] = deque()
        self._open = False
        mode = isotp.AddressingMode.Normal_29bits if request.extended else isotp.AddressingMode.Normal_11bits
        logging.getLogger(isotp.TransportLayer.LOGGER_NAME).setLevel(logging.CRITICAL)  # told by `trouble`
        self._stack = isotp.TransportLayerLogic(
            rxfn=lambda _: self._arrived.popleft() if self._arrived else None,
            txfn=self._send_frame,
            address=isotp.Address(mode, txid=request.can_id, rxid=answer.can_id),
            error_handler=lambda error: self.trouble.append(str(error)),
            params={"tx_padding": PADDING, "blocksize": 0, "stmin": 0, "wftmax": 10, "max_frame_size": _MOST_BYTES},
        )

    def open(self) -> "IsoTpConnection":
        """Begin; the bus is open already."""
        self._open = True
        return self

    def close(self) -> None:
        """End; the bus stays open."""
        self._open = False

    def is_open(self) -> bool:
        """Whether messages can be sent."""
        return self._open

    def empty_rxqueue(self) -> None:
        """Forget what has arrived."""
        self._receive(0.0)
        self._stack.process()
        self._stack.clear_rx_queue()

    def specific_send(self, payload: bytes, timeout: float | None = None) -> None:
        """Send a whole message.

        Raises
        ------
        BrakebenchError : longer than one frame, but to all ECUs.
        SilenceError : the ECU does not take it.
        """
        self.trouble = []
        if self._functional is not None:
            if len(payload) > SINGLE_MOST:
                raise BrakebenchError(f"a request of {len(payload)} bytes to all ECUs; at most {SINGLE_MOST} fit")
            data = bytes((len(payload),)) + payload
            self._put(self._functional, data.ljust(FRAME_BYTES, bytes((PADDING,))))
            return
        self._stack.send(payload)
        self._stack.process()
        while self._stack.transmitting():
            self._receive(_STEP_S)
            self._stack.process()
        if self.trouble:
            raise SilenceError(f"the request was not taken: {'; '.join(self.trouble)}")

    def specific_wait_frame(self, timeout: float | None = None) -> bytes | None:
        """Wait for a message to begin within ``timeout`` seconds; then N_Cr of ISO-TP tells how long it may take.

        Raises
        ------
        SilenceError : none has begun, or it broke off.
        """
        until_ns = monotonic_ns() + int((10.0 if timeout is None else timeout) * 1e9)
        while True:
            self._stack.process()
            if self._stack.available():
                message = self._stack.recv()
                return None if message is None else bytes(message)
            left_s = (until_ns - monotonic_ns()) * 1e-9
            if left_s <= 0 and not self._stack.is_rx_active():
                raise SilenceError("no answer")
            self._receive(_STEP_S if self._stack.is_rx_active() else min(left_s, 0.05))

    def take_periodic(self, seconds: float) -> list[tuple[int, bytes]]:
        """Listen so long; time of reception, ns, and data of every frame of periodic data since the last call."""
        until_ns = monotonic_ns() + int(seconds * 1e9)
        while (left_ns := until_ns - monotonic_ns()) > 0:
            self._receive(left_ns * 1e-9)
            self._stack.process()
        taken, self._samples = self._samples, []
        return taken

    def _receive(self, timeout_s: float) -> None:
        for item in self._bus.receive(max(0.0, timeout_s)):
            if isinstance(item, LinkEvent):
                if item.state in _LOST:
                    self.trouble.append(f"{item.state}: {item.number} frames {item.detail}".rstrip())
                continue
            if (item.can_id, item.extended) == self._periodic:
                self._samples.append((item.time_ns, item.data))
                continue
            self._arrived.append(isotp.CanMessage(item.can_id, len(item.data), item.data, extended_id=item.extended))

    def _send_frame(self, message: isotp.CanMessage) -> None:
        self._put(Identifier(message.arbitration_id, message.is_extended_id), bytes(message.data))

    def _put(self, identifier: Identifier, data: bytes) -> None:
        self._bus.send([Frame(BusName.VEHICLE, identifier.can_id, data, 0, identifier.extended)])
