"""The UDS server of the controller: ISO-TP frames in, answers and orders to the node out, time passed in."""

from collections.abc import Sequence

from dbc.diagnostic_ids import FRAME_BYTES, PADDING, PERIODIC, REQUEST_FUNCTIONAL, RESPONSE
from dbc.frame import BusName, Frame
from dbc.isotp import Link, PduKind, parse, st_min_ns
from dbc.messages import BrakeMode
from ecu.diagnostics.exchange import NO_ORDERS, Orders, View
from ecu.diagnostics.protocol import (
    BURST,
    LATENESS_NS,
    MOST_ANSWER,
    MOST_REQUEST,
    NEGATIVE,
    P2_NS,
    POSITIVE,
    S3_NS,
    SILENT_WHEN_FUNCTIONAL,
    SUPPRESS,
    Nrc,
    Refused,
    Session,
)
from ecu.diagnostics.services import HARD_RESET, SERVICES, Services
from ecu.diagnostics.trouble_memory import TroubleCodeMemory
from ecu.law.trouble_codes import NO_TROUBLE, TroubleMemory


class DiagnosticServer:
    """Serves one tester; the node steps it after the law while it is awake, or a request or a trouble code comes.

    Parameters
    ----------
    period_ns : time between two steps of the node.

    Attributes
    ----------
    awake : something goes on that needs every tick.  troubles : the law's memory that was seen last.
    """

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._services = Services()
        self._link = Link(
            frame_bytes=FRAME_BYTES, padding=PADDING, most_bytes=MOST_REQUEST, burst=BURST,
        )  # fmt: skip
        self._pending: bytes | None = None  # the answer behind a 0x78
        self._active_ns = 0  # of the last request or answer, for S3
        self.awake = False
        self.troubles: TroubleMemory = NO_TROUBLE

    @property
    def memory(self) -> TroubleCodeMemory:
        """Trouble codes as UDS shows them."""
        return self._services.memory

    @property
    def session(self) -> Session:
        """The session that is active."""
        return self._services.session

    def step(self, now_ns: int, received: Sequence[Frame], view: View) -> tuple[list[Frame], Orders]:
        """Advance to ``now_ns``: frames to send, and what the node is to do at this tick.

        Parameters
        ----------
        received : frames with the identifiers of requests, in order of arrival.
        view : the controller after the law's step.
        """
        services, link = self._services, self._link
        self.troubles = view.troubles
        was_off = not services.memory.enabled
        services.memory.update(view.troubles)
        if services.session != Session.DEFAULT and not self._busy and now_ns - self._active_ns >= S3_NS:
            services.enter(Session.DEFAULT)
        if self._pending is not None and not link.sending:
            link.send(now_ns, self._pending)
            self._pending = None
        for frame in received:
            self._take(now_ns, frame, view)
        link.burst = BURST - len(services.periodic)
        # more would be flow controls of requests that others have cut off since
        frames = [_frame(RESPONSE, data) for data in link.frames(now_ns)[-BURST:]]
        frames += [_frame(PERIODIC, data) for data in services.due(now_ns, view, BURST - len(frames))]
        if self._busy:
            self._active_ns = now_ns
        orders = self._orders(view)
        if orders.restart:
            services.memory.new_cycle()
            services.enter(Session.DEFAULT)
        link.errors.clear()  # a tester sees for itself what was given up
        in_session = services.session != Session.DEFAULT
        # codes that came with their setting off are taken at the tick after it
        self.awake = self._busy or in_session or services.restart is not None or was_off
        return frames, orders

    @property
    def _busy(self) -> bool:
        return self._link.sending or self._link.receiving or self._pending is not None

    def _take(self, now_ns: int, frame: Frame, view: View) -> None:
        if frame.can_id == REQUEST_FUNCTIONAL:
            pdu = parse(frame.data)
            request = pdu.data if pdu is not None and pdu.kind == PduKind.SINGLE else None
        else:
            request = self._link.take(now_ns, frame.data)
        if request is None:
            return
        self._active_ns = now_ns
        if self._services.restart is not None or ((self._link.sending or self._pending) and not _silent(request)):
            return  # an answer is on its way, and a tester waits for it
        answer = self._answer(now_ns, request, frame.can_id == REQUEST_FUNCTIONAL, view)
        if answer is None:
            return
        if self._duration_ns(len(answer)) > P2_NS - LATENESS_NS - self._period_ns:
            self._pending = answer
            answer = bytes((NEGATIVE, request[0], Nrc.RESPONSE_PENDING))
        self._link.send(now_ns, answer)

    def _answer(self, now_ns: int, request: bytes, functional: bool, view: View) -> bytes | None:
        if view.outputs.mode != BrakeMode.INIT:
            self._services.memory.complete()
        try:
            body = self._services.serve(now_ns, request, view)
            answer = bytes((request[0] + POSITIVE,)) + body
            if len(answer) > MOST_ANSWER:
                raise Refused(Nrc.RESPONSE_TOO_LONG)
        except Refused as refused:
            silent = functional and refused.nrc in SILENT_WHEN_FUNCTIONAL
            return None if silent else bytes((NEGATIVE, request[0], refused.nrc))
        return None if _suppressed(request) else answer

    def _duration_ns(self, length: int) -> int:
        """Time from the tick of an answer's first frame to that of its last one, as this tester takes them."""
        left = -(-(length - FRAME_BYTES + 2) // (FRAME_BYTES - 1)) if length >= FRAME_BYTES else 0
        if not left:
            return 0
        block, st_min = self._link.flow or (1, 0x7F)  # not known yet: the slowest
        gap_ticks = -(-st_min_ns(st_min) // self._period_ns)
        block = min(block or left, left)
        full, rest = divmod(left, block)
        ticks = 0
        for size in (block,) * full + ((rest,) if rest else ()):
            # its flow control, then its frames
            ticks += 1 + (gap_ticks * (size - 1) if gap_ticks else (size - 1) // self._link.burst)
        return ticks * self._period_ns

    def _orders(self, view: View) -> Orders:
        services = self._services
        if not view.actuators_free:
            services.actuators.release()
        if services.silent and not view.standstill:
            services.silent = False
        pressure = services.routines.step(view)
        set_pressure, motor = services.actuators.demands()
        restart = services.restart is not None and not self._busy
        orders = Orders(
            set_pressure if pressure is None else pressure,
            motor,
            services.silent,
            services.parameters,
            services.routines.zero_pa,
            services.forget,
            restart,
            restart and services.restart == HARD_RESET,
        )
        services.parameters, services.forget, services.routines.zero_pa = None, (), None
        if restart:
            services.restart = None
        return orders if orders != NO_ORDERS else NO_ORDERS


def _suppressed(request: bytes) -> bool:
    service = SERVICES.get(request[0])
    return service is not None and service.sub is not None and len(request) > 1 and bool(request[1] & SUPPRESS)


def _silent(request: bytes) -> bool:
    """Tester present without an answer: it comes beside everything else."""
    return request == b"\x3e\x80"


def _frame(can_id: int, data: bytes) -> Frame:
    return Frame(BusName.VEHICLE, can_id, data.ljust(FRAME_BYTES, bytes((PADDING,))))
