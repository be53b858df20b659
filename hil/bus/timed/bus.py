"""A CAN bus in virtual time: arbitration, acknowledge, errors, bus-off; integer nanoseconds, the same each time."""

from collections.abc import Callable
from typing import NamedTuple

from dbc.frame import BusName, LinkState
from dbc.frame_length import FD_TAIL, FrameBits
from hil.bus.timed import disturbance
from hil.bus.timed.attempt import Attempt, collision, fail
from hil.bus.timed.controller import SEQUENCES_TO_RECOVER, Controller, Reception
from hil.bus.timed.disturbance import WRONG_RATE_BITS, Disturbance, Seen
from hil.bus.timed.frame_length import PAUSE, Length, exact_bits
from hil.bus.timed.noise import BitErrors
from hil.bus.timed.transmit_queue import Request, TransmitQueue
from hil.bus.timed.wire import WireFrame

FLAG, DELIMITER = 6, 8  # bits of an error frame
SUSPEND = 8  # bits that an error-passive sender waits behind the pause
RECESSIVE_END = 8  # delimiter of the acknowledge and end of frame
SEQUENCE = 11  # recessive bits that count once towards the recovery from bus-off
_NEVER = 1 << 62


class Sent(NamedTuple):
    """A frame that was sent and acknowledged.

    Attributes
    ----------
    controller : name of its sender.
    queued_ns, start_ns, end_ns, free_ns : asked for; start of frame; end of frame; end of the pause behind it, from
        which on the bus is free (where the analysis of response times ends a frame).
    """

    controller: str
    frame: WireFrame
    queued_ns: int
    start_ns: int
    end_ns: int
    free_ns: int


class TimedBus:
    """The wire; controllers `join` it.

    Parameters
    ----------
    bit_rate : nominal, bit/s.
    data_bit_rate : of CAN FD frames with a bit rate switch, bit/s; None: they are sent at the nominal one.
    name : which bus its link events name.
    bit_error_rate : probability that everybody reads a bit on the wire wrong.
    seed : of all bit errors.
    length : bits of a frame; `hil.bus.timed.frame_length.most_bits` fixes lengths at their bound.
    on_sent : is told of each frame that was sent.

    Attributes
    ----------
    now_ns : the time it has been advanced to.
    sent, errors : frames sent and acknowledged, error frames.
    busy_ns : time the wire was taken, pauses included.
    """

    def __init__(
        self,
        bit_rate: int,
        data_bit_rate: int | None = None,
        *,
        name: BusName = BusName.VEHICLE,
        bit_error_rate: float = 0.0,
        seed: int = 1,
        length: Length = exact_bits,
        on_sent: Callable[[Sent], None] | None = None,
    ) -> None:
        for rate in (bit_rate, bit_rate if data_bit_rate is None else data_bit_rate):
            if not 0 < rate <= 1_000_000_000:
                raise ValueError(f"bit rate {rate}; expected bit/s above 0")
        self.bit_rate = bit_rate
        self.data_bit_rate = data_bit_rate
        self.name = name
        self.controllers: list[Controller] = []
        self.now_ns = 0
        self.sent = self.errors = self.busy_ns = 0
        self._seed = seed
        self._length = length
        self._on_sent = on_sent
        self._noise = BitErrors(bit_error_rate, f"{seed} wire")
        self._pause_ns, self._recessive_end_ns = self.bits_ns(PAUSE), self.bits_ns(RECESSIVE_END)
        self._free_ns = 0
        self._recessive_from_ns = 0
        self._attempt: Attempt | None = None

    def join(
        self,
        name: str,
        *,
        fifo: bool = False,
        queue_length: int = 64,
        bit_rate: int | None = None,
        listen_only: bool = False,
        restart_after_ns: int | None = 0,
        bit_error_rate: float = 0.0,
    ) -> Controller:
        """Add a controller.

        Parameters
        ----------
        name : for people.
        fifo, queue_length : its transmit queue; by priority unless ``fifo``.
        bit_rate : where it is set to another one than the bus.
        listen_only : neither acknowledges nor flags errors nor sends.
        restart_after_ns : time from bus-off to the begin of the recovery, ns; None: only `Controller.restart` does.
        bit_error_rate : probability that it alone reads a bit wrong.
        """
        queue, noise = TransmitQueue(fifo, queue_length), BitErrors(bit_error_rate, f"{self._seed} {name}")
        rate = self.bit_rate if bit_rate is None else bit_rate
        controller = Controller(self, name, queue, rate, listen_only, restart_after_ns, noise)
        self.controllers.append(controller)
        return controller

    def set_bit_error_rate(self, rate: float) -> None:
        """Change the probability of bit errors from the next frame on."""
        self._noise = BitErrors(rate, f"{self._seed} wire {self.now_ns}")

    def advance(self, now_ns: int) -> None:
        """Let time pass: frames that end by then are received; those that start by then were asked for before.

        Raises
        ------
        ValueError
            Where the time has been passed already.
        """
        if now_ns < self.now_ns:
            raise ValueError(f"time {now_ns} ns; the bus has been advanced to {self.now_ns} ns, give times in order")
        while True:
            if self._attempt is not None:
                if self._attempt.end_ns > now_ns:
                    break
                self._end(self._attempt)
            start_ns, offering, recovering = self._next_start()
            if recovering:
                back_ns, controller = self._next_recovered()
                if back_ns <= min(start_ns, now_ns):
                    controller.recovered(back_ns)
                    continue
            if start_ns >= now_ns:
                break
            if recovering:
                self._count_sequences(start_ns)
            self._attempt = self._begin(start_ns, offering)
        self.now_ns = now_ns

    def bits_ns(self, bits: int) -> int:
        """Time of nominal bits, ns."""
        return bits * 1_000_000_000 // self.bit_rate

    def _next_start(self) -> tuple[int, list[Controller], bool]:
        """When the next frame can start, who then offers one to arbitration, and whether anyone recovers from off."""
        start_ns, offering, recovering = _NEVER, [], False
        for controller in self.controllers:
            if controller.queue.waiting:
                if controller.unplugged:
                    continue
                at_ns = max(self._free_ns, controller.ready_ns, controller.queue.since_ns)
                if at_ns < start_ns:
                    start_ns, offering = at_ns, [controller]
                elif at_ns == start_ns:
                    offering.append(controller)
            elif controller.recover_from_ns is not None:
                recovering = True
        return start_ns, offering, recovering

    def _next_recovered(self) -> tuple[int, Controller]:
        """Which controller is back from bus-off first, if nobody sends before, and when."""
        back = []
        for k, c in enumerate(self.controllers):
            if c.recover_from_ns is not None:
                left = (SEQUENCES_TO_RECOVER - c.sequences) * SEQUENCE
                back.append((max(c.recover_from_ns, self._recessive_from_ns) + self.bits_ns(left), k))
        back_ns, k = min(back)
        return back_ns, self.controllers[k]

    def _begin(self, start_ns: int, offering: list[Controller]) -> Attempt:
        """Arbitrate, and find out how the frame that wins will end."""
        requests = [(c, c.queue.head) for c in offering]
        if len(requests) > 1:
            least = min(request.key for _, request in requests)
            requests = [(c, request) for c, request in requests if request.key == least]
        losing: list[Controller] = []
        error = None
        if len(requests) > 1:
            requests, losing, error = collision(requests)
        frame, senders = requests[0][1].frame, [c for c, _ in requests]
        receivers: list[Controller] = []
        acknowledged, undisturbed = False, error is None and not self._noise.rate
        for c in self.controllers:
            if c.present and c not in senders and c not in losing:
                receivers.append(c)
                acknowledged = acknowledged or not c.listen_only
                undisturbed = undisturbed and c.bit_rate == senders[0].bit_rate and not c.noise.rate
            elif c.noise.rate:
                undisturbed = False
        bits = self._length(frame)
        missing: list[Controller] = []
        if not undisturbed or not acknowledged:
            error, missing = self._disturbed(frame, senders, receivers, bits, error)
        return self._planned(frame, requests, receivers, start_ns, bits, error, missing, losing)

    def _disturbed(
        self,
        frame: WireFrame,
        senders: list[Controller],
        receivers: list[Controller],
        bits: FrameBits,
        error: Disturbance | None,
    ) -> tuple[Disturbance | None, list[Controller]]:
        """Find what breaks the frame off first, and the receivers that misread it without a flag that all could see."""
        length = bits.nominal + bits.data - PAUSE
        foreign = [c for c in receivers if c.bit_rate != senders[0].bit_rate]
        flagging = [c for c in foreign if c.flags]
        own, silent = disturbance.missed_by([c for c in receivers if c not in foreign], length)
        missing = [c for c in foreign if not c.flags] + silent
        errors = [error, own, disturbance.sender_noise(self._noise, senders, frame, length)]
        if flagging:
            errors.append(Disturbance(WRONG_RATE_BITS, Seen.BY_RECEIVERS, flagging))
        if all(c.listen_only or c in missing for c in receivers):
            errors.append(Disturbance(length - 1 - RECESSIVE_END, Seen.ACKNOWLEDGE))
        return disturbance.earliest(errors), missing

    def _planned(
        self,
        frame: WireFrame,
        requests: list[tuple[Controller, Request]],
        receivers: list[Controller],
        start_ns: int,
        bits: FrameBits,
        error: Disturbance | None,
        missing: list[Controller],
        losing: list[Controller],
    ) -> Attempt:
        who = frame, requests, receivers, start_ns
        if error is None:
            free_ns = start_ns + bits.duration_ns(self.bit_rate, self.data_bit_rate)
            end_ns = free_ns - self._pause_ns
            recessive_ns = end_ns - self._recessive_end_ns
            return Attempt(*who, end_ns, free_ns, recessive_ns, None, tuple(missing), tuple(losing))
        seen_ns = start_ns + self._time_ns(bits, error.bit + 1)
        senders = [c for c, _ in requests]
        answering = [c for c in (*senders, *receivers, *losing) if c.flags]
        first = [c for c in (error.first or senders) if c.flags]
        # Flags of those who see it by the first flags only follow these: the longest superposition there is.
        flags = FLAG + FLAG * (len(answering) > len(first) and error.seen is not Seen.LAST_BIT)
        end_ns = seen_ns + self.bits_ns(flags)
        recessive_ns = end_ns if answering else seen_ns
        return Attempt(
            *who, end_ns, end_ns + self.bits_ns(DELIMITER + PAUSE), recessive_ns, error, tuple(missing), tuple(losing)
        )

    def _time_ns(self, bits: FrameBits, count: int) -> int:
        """Time of the first ``count`` bits of a frame."""
        if not bits.data:
            return self.bits_ns(count)
        head = bits.nominal - FD_TAIL
        fast = min(max(0, count - head), bits.data)
        return FrameBits(count - fast, fast).duration_ns(self.bit_rate, self.data_bit_rate)

    def _count_sequences(self, start_ns: int) -> None:
        """Count the sequences of recessive bits that end now, for controllers that recover from bus-off."""
        for c in self.controllers:
            if c.recover_from_ns is not None:
                quiet_ns = start_ns - max(c.recover_from_ns, self._recessive_from_ns)
                c.sequences += max(0, quiet_ns) * self.bit_rate // (SEQUENCE * 1_000_000_000)

    def _end(self, attempt: Attempt) -> None:
        self._attempt = None
        self._free_ns = attempt.free_ns
        self._recessive_from_ns = attempt.recessive_from_ns
        self.busy_ns += attempt.free_ns - attempt.start_ns
        if attempt.error is None:
            self._deliver(attempt)
        else:
            self.errors += 1
            fail(attempt, attempt.error)
        for controller in (*[c for c, _ in attempt.requests], *attempt.losing):
            if controller.state is LinkState.ERROR_PASSIVE:
                controller.ready_ns = attempt.free_ns + self.bits_ns(SUSPEND)

    def _deliver(self, attempt: Attempt) -> None:
        reception = Reception(attempt.frame, attempt.end_ns)
        for controller in attempt.receivers:
            if controller in attempt.missing:
                controller.counters.receive_error()
                controller.follow(attempt.end_ns)
            else:
                controller.take(reception)
        for controller in attempt.losing:
            controller.counters.transmit_error()
            controller.follow(attempt.end_ns)
        for controller, request in attempt.requests:
            controller.finish(request, attempt.end_ns)
            self.sent += 1
            if self._on_sent is not None:
                times = request.queued_ns, attempt.start_ns, attempt.end_ns, attempt.free_ns
                self._on_sent(Sent(controller.name, attempt.frame, *times))
