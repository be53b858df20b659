"""Faults of frames on their way: lost, late, doubled, old, in wrong order; and senders that nobody asked for."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence

import numpy as np

from dbc.e2e import COUNTER_MODULUS
from dbc.frame import BusName, Frame, Received
from dbc.messages import BrakeMode
from dbc.raw import protected_again, raw_signals
from hil.faults.act import Act, FrameAct, message_of
from hil.faults.fault import Expected, FaultKind, Injection, Parameter, Side
from hil.faults.targets import Takes

NORMAL = frozenset({BrakeMode.NORMAL})
FOUND = frozenset({BrakeMode.DEGRADED, BrakeMode.FRICTION_ONLY})
SHARE = Parameter("share", "", 0.0, 1.0, 1.0, "share of the frames befallen")
INPUTS = (
    "BRAKE_PEDAL", "WHEEL_SPEED_FRONT", "WHEEL_SPEED_REAR", "BODY_MOTION", "EHB_PRESSURE_FRONT", "EHB_PRESSURE_REAR",
    "MOTOR_STATUS_FRONT", "MOTOR_STATUS_REAR", "STEERING",
)  # fmt: skip
DEMANDS = ("EHB_DEMAND_FRONT", "EHB_DEMAND_REAR", "MOTOR_DEMAND_FRONT", "MOTOR_DEMAND_REAR")
DETECT_MS, MOTOR_ZERO_MS = 40.0, 50.0  # budgets of the design: since the last valid frame
WORST_RATE_1_S = 4500.0  # frames of 8 bytes that 500 kbit/s carries, 111 bits each


class Lost(FrameAct):
    """Not sent."""

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """Nothing."""
        return ()


class Doubled(FrameAct):
    """Sent twice."""

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """The frame twice."""
        return frame, frame


class Stale(FrameAct):
    """Sent with the bytes of the frame before."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._last: dict[int, bytes] = {}

    def keep(self, frame: Frame) -> Sequence[Frame]:
        """Remember its bytes."""
        self._last[frame.can_id] = frame.data
        return (frame,)

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """Bytes of the one before; new ones are remembered."""
        before = self._last.get(frame.can_id, frame.data)
        self._last[frame.can_id] = frame.data
        return (frame._replace(data=before),)


class Late(FrameAct):
    """Held back for one to so many ticks; frames of one identifier never overtake each other."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._most = int(injection.number("ticks"))
        self._held: dict[int, deque[tuple[int, Frame]]] = {}
        self._tick = 0

    @property
    def holds(self) -> bool:
        """Whether frames wait."""
        return any(self._held.values())

    def send(self, now_ns: int, frames: list[Frame]) -> list[Frame]:
        """Frames that are due at this tick."""
        self._tick += 1
        out = super().send(now_ns, frames)
        for waiting in self._held.values():
            while waiting and waiting[0][0] <= self._tick:
                out.append(waiting.popleft()[1])
        return out

    def keep(self, frame: Frame) -> Sequence[Frame]:
        """At once, but behind those that wait."""
        waiting = self._held.get(frame.can_id)
        if not waiting:
            return (frame,)
        waiting.append((waiting[-1][0], frame))
        return ()

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """Later."""
        waiting = self._held.setdefault(frame.can_id, deque())
        due = self._tick + int(self.random(frame.can_id).integers(1, self._most + 1))
        waiting.append((max(due, waiting[-1][0]) if waiting else due, frame))
        return ()


class Swapped(FrameAct):
    """Pairs of frames in wrong order: the first one waits for the second."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._first: dict[int, Frame] = {}

    @property
    def holds(self) -> bool:
        """Whether a frame waits for its second."""
        return bool(self._first)

    def keep(self, frame: Frame) -> Sequence[Frame]:
        """Behind it comes one that waited."""
        first = self._first.pop(frame.can_id, None)
        return (frame,) if first is None else (frame, first)

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """Wait, or be the second."""
        if frame.can_id in self._first:
            return self.keep(frame)
        self._first[frame.can_id] = frame
        return ()


class Replayed(FrameAct):
    """The frame of a time ago in the place of the new one; it listens for that time before it acts."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._past: dict[int, deque[tuple[int, Frame]]] = {}
        self._delay_ns = round(injection.number("delay_s") * 1e9)
        self._now_ns = armed_ns

    def send(self, now_ns: int, frames: list[Frame]) -> list[Frame]:
        """Note the time of the tick first."""
        self._now_ns = now_ns
        return super().send(now_ns, frames)

    def keep(self, frame: Frame) -> Sequence[Frame]:
        """Remember it with its time."""
        self._past.setdefault(frame.can_id, deque()).append((self._now_ns, frame))
        return (frame,)

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """The last one that is so old, or nothing where none is."""
        past = self._past.setdefault(frame.can_id, deque())
        past.append((self._now_ns, frame))
        old: Sequence[Frame] = ()
        while past and past[0][0] <= self._now_ns - self._delay_ns:
            old = (past.popleft()[1],)
        return old


class SecondSender(FrameAct):
    """A second node that sends the same message right behind the first: valid, with values and counter of its own."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._counter: dict[int, int] = {}
        self._sent: list[Frame] = []

    def hear(self, now_ns: int, inbox: list[Received]) -> list[Received]:
        """The node hears the other one, too."""
        heard, self._sent = self._sent, []
        return [*inbox, *heard] if heard else inbox

    def _next(self, can_id: int, theirs: int) -> int:
        begin = theirs + int(self.injection.number("offset")) - 1
        self._counter[can_id] = (self._counter.get(can_id, begin) + 1) % COUNTER_MODULUS
        return self._counter[can_id]

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """The frame, and the other's."""
        spec, target = message_of(frame.can_id), self.injection.target
        value = self.injection.number("value")
        payload: bytes | bytearray = frame.data
        for index, signal in enumerate(raw_signals(BusName.VEHICLE)[spec.name]):
            if target.signal in (index, 15):
                payload = signal.write(payload, min(max(signal.raw_of(value), signal.first), signal.last))
        theirs = frame.data[1] & 0x0F
        self._sent.append(frame._replace(data=protected_again(spec, payload, self._next(frame.can_id, theirs))))
        return frame, self._sent[-1]


class AnsweringSender(SecondSender):
    """A second node that answers each frame with the next counter."""

    def _next(self, can_id: int, theirs: int) -> int:
        return (theirs + 1) % COUNTER_MODULUS


class _Talker(Act, ABC):
    """Sends frames of its own at a rate."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self.dice = np.random.default_rng([self.seed, injection.kind.number])
        self._sent = 0
        self._active_ns = 0
        self._last_ns = armed_ns

    def send(self, now_ns: int, frames: list[Frame]) -> list[Frame]:
        """The node's frames behind as many as the rate gives."""
        if not self.acts(now_ns):
            self._last_ns = now_ns
            return frames
        self._active_ns += now_ns - self._last_ns or 10_000_000  # the first tick: as one cycle
        self._last_ns = now_ns
        due = int(min(self._active_ns * 1e-9 * self.injection.number("rate_1_s") - self._sent, self.left))
        self._sent += due
        self.left -= due
        return [self.one() for _ in range(due)] + frames

    @abstractmethod
    def one(self) -> Frame:
        """The next frame."""


class Babble(_Talker):
    """The identifier 0x000, which wins every arbitration."""

    def one(self) -> Frame:
        """Eight bytes of 0."""
        return Frame(BusName.VEHICLE, 0x000, bytes(8))


class IdSpace(_Talker):
    """Random payloads under every 11-bit identifier, in random order, none left out before all had their turn."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._to_come: list[int] = []

    def one(self) -> Frame:
        """A random payload of 0 to 8 bytes."""
        if not self._to_come:
            self._to_come = self.dice.permutation(1 << 11).tolist()
        return Frame(BusName.VEHICLE, self._to_come.pop(), self.dice.bytes(int(self.dice.integers(0, 9))))


_LOST, _ORDER = "lost frame", "frozen counter, replay, jump, swap"
_EXTRA = "second sender, babble, unknown identifiers"
_RATE = Parameter("rate_1_s", "1/s", 1.0, WORST_RATE_1_S, 1000.0, "frames a second")
_OFFSET = Parameter("offset", "", 1.0, 14.0, 1.0, "its first counter beyond that of the other")
_VALUE = Parameter("value", "SI", -1e9, 1e9, 0.0, "of the signal, or of all signals of the message")
_TICKS = Parameter("ticks", "", 1.0, 100.0, 2.0, "longest delay, cycles of 10 ms")
_DELAY = Parameter("delay_s", "s", 0.01, 60.0, 2.0, "how old")
_FOUND = Expected(FOUND, detect_ms=DETECT_MS, motor_zero_ms=MOTOR_ZERO_MS)
_MAY_BE_FOUND = Expected(FOUND | NORMAL)

FAULTS: tuple[tuple[FaultKind, type[Act]], ...] = (
    (FaultKind(1, "lost", "bus", "A share of the frames is not sent.", _LOST, Side.SENDER, Takes.MESSAGES,
               ("ALL", *INPUTS[:3]), Expected(NORMAL), (SHARE,), usual_values=(("share", 0.05),)), Lost),
    (FaultKind(2, "silent", "bus", "A message, or all messages of a node, is not sent any more.",
               "silence of one identifier", Side.SENDER, Takes.MESSAGES, (*INPUTS, *DEMANDS, "IWM", "EHB", "SENSORS"),
               _FOUND, usual_values=(("for_s", 0.5),)), Lost),
    (FaultKind(3, "late", "bus", "A share of the frames is held back for one to `ticks` cycles; the order stays.",
               _LOST, Side.SENDER, Takes.MESSAGES, ("ALL",), Expected(NORMAL), (SHARE, _TICKS),
               usual_values=(("share", 0.2),)), Late),
    (FaultKind(4, "doubled", "bus", "A share of the frames is sent twice.", _EXTRA, Side.SENDER, Takes.MESSAGES,
               ("BRAKE_PEDAL", "WHEEL_SPEED_FRONT"), _MAY_BE_FOUND, (SHARE,), usual_values=(("for_s", 0.5),)), Doubled),
    (FaultKind(5, "stale", "bus", "A share of the frames carries the bytes of the one before, counter included.",
               _ORDER, Side.SENDER, Takes.MESSAGES, ("BRAKE_PEDAL", "WHEEL_SPEED_FRONT"), _MAY_BE_FOUND, (SHARE,),
               usual_values=(("share", 0.2),)), Stale),
    (FaultKind(6, "swapped", "bus", "Pairs of successive frames of a message change places.", _ORDER, Side.SENDER,
               Takes.MESSAGES, ("BRAKE_PEDAL", "EHB_PRESSURE_FRONT"), _MAY_BE_FOUND, (SHARE,),
               usual_values=(("for_s", 0.5),)), Swapped),
    (FaultKind(7, "replayed", "bus", "Frames of `delay_s` ago, valid in themselves, in the place of the new ones.",
               _ORDER, Side.SENDER, Takes.MESSAGES, ("BRAKE_PEDAL", "WHEEL_SPEED_FRONT", "MOTOR_DEMAND_FRONT"),
               _MAY_BE_FOUND, (_DELAY,), lead="delay_s", usual_values=(("delay_s", 0.5), ("for_s", 0.5))), Replayed),
    (FaultKind(8, "second_sender", "bus", "A second node sends the same message in the same cycle: valid, with a "
               "counter and values of its own.", _EXTRA, Side.SENDER, Takes.SIGNAL_OR_MESSAGE,
               ("BRAKE_PEDAL", "MOTOR_DEMAND_FRONT", "EHB_DEMAND_FRONT"), _FOUND, (_OFFSET, _VALUE),
               usual_values=(("for_s", 0.5),)), SecondSender),
    (FaultKind(9, "answering_sender", "bus", "A second node answers each frame of a message with the next counter and "
               "values of its own.", _EXTRA, Side.SENDER, Takes.SIGNAL_OR_MESSAGE,
               ("BRAKE_PEDAL", "MOTOR_DEMAND_FRONT"), _FOUND, (_VALUE,), usual_values=(("for_s", 0.5),)),
     AnsweringSender),
    (FaultKind(10, "babble", "bus", "The identifier 0x000 at a rate; only the timed bus delays others by it.", _EXTRA,
               Side.SENDER, Takes.PROCESS, ("PLANT", "ECU"), Expected(NORMAL), (_RATE,), of_target=False,
               usual_values=(("for_s", 0.5),)), Babble),
    (FaultKind(11, "id_space", "bus", "Random payloads of 0 to 8 bytes under all 11-bit identifiers, those in use "
               "included.", _EXTRA, Side.SENDER, Takes.PROCESS, ("PLANT", "ECU"), _MAY_BE_FOUND, (_RATE,),
               of_target=False, usual_values=(("for_s", 0.5),)), IdSpace),
)  # fmt: skip
