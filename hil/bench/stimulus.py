"""The bench as a node: sends the stimulus on the manoeuvre's clock, and follows the truth."""

from collections.abc import Iterable, Sequence
from enum import StrEnum
from threading import Lock

from dbc.bench_messages import (
    FaultCommand,
    ManoeuvreState,
    PhysicalFault,
    StimulusDriver,
    StimulusEcu,
    StimulusRoad,
    TruthMotion,
)
from dbc.contract import Message
from dbc.exchange import Receiver, Transmitter
from dbc.frame import Frame, Received
from hil.faults.physical import FaultEvent
from plant.manoeuvre import Trace, value_at

BENCH_PHASE_NS = 2_500_000  # after the plant, before the controller: each hears the stimulus at its next tick
_MANOEUVRE, _FINISHED = TruthMotion._fields.index("manoeuvre"), float(ManoeuvreState.FINISHED)
_OPENING_FRAMES = 3  # fault commands without a fault: the receiver's sequence stands before one counts


class Channel(StrEnum):
    """What can be stimulated while a run goes on; SI units."""

    BLENDING = "blending"
    PEDAL = "pedal"
    SPEED = "speed_mps"
    STEERING = "steering_wheel_rad"
    FRICTION_LEFT = "friction_left"
    FRICTION_RIGHT = "friction_right"
    GRADE = "grade"

    __hash__ = str.__hash__  # that of an enum is slow, and asked several times a tick


_DRIVER = (Channel.PEDAL, Channel.SPEED, Channel.STEERING)
_ROAD = (Channel.FRICTION_LEFT, Channel.FRICTION_RIGHT, Channel.GRADE)


class StimulusNode:
    """The bench's own node. A step and a command may come from two threads.

    Parameters
    ----------
    blending : blending factor over time; empty leaves it to the controller's parameters.
    faults : what breaks when.
    period_ns : time between two steps.

    Attributes
    ----------
    inbox : what came with the last step.
    time_s : manoeuvre time, None before its start. What is sent now acts at ``next_s``, the plant's next tick.
    """

    def __init__(self, blending: Trace = (), faults: Sequence[FaultEvent] = (), period_ns: int = 10_000_000) -> None:
        self.inbox: Sequence[Received] = ()
        self.time_s: float | None = None
        self._traces: dict[Channel, Trace] = {Channel.BLENDING: blending} if blending else {}
        self._waiting = sorted(faults, key=lambda event: event.at_s)
        self._period_ns = period_ns
        self._start_ns: int | None = None
        self._opening = _OPENING_FRAMES
        self._extra: list[Frame] = []
        self._lock = Lock()
        self._receiver = Receiver((TruthMotion,))
        self._truth = self._receiver.values
        self._transmitter = Transmitter()

    @property
    def motion(self) -> TruthMotion | None:
        """The plant's last word about its motion."""
        return self._receiver.latest(TruthMotion)

    @property
    def next_s(self) -> float:
        """Manoeuvre time at which a command given now acts."""
        return 0.0 if self.time_s is None else self.time_s + self._period_ns * 1e-9

    @property
    def finished(self) -> bool:
        """Whether the manoeuvre is over."""
        return bool(self._truth[_MANOEUVRE] == _FINISHED)

    def move(self, channel: Channel, value: float, within_s: float = 0.0) -> None:
        """Bring a channel to a value from now on, linearly within a time."""
        with self._lock:
            now, begin = self.next_s, self.value(channel)
            past = tuple(point for point in self._traces.get(channel, ()) if point[0] < now)
            ramp = ((now, value if begin is None or within_s == 0.0 else begin), (now + within_s, value))
            self._traces[channel] = (*past[-1:], *ramp)

    def leave(self, channel: Channel) -> None:
        """Stimulate a channel no longer: scenario and parameters decide again."""
        with self._lock:
            self._traces.pop(channel, None)

    def value(self, channel: Channel) -> float | None:
        """Value of a channel that acts next; None where it is not stimulated."""
        trace = self._traces.get(channel)
        return value_at(trace, self.next_s) if trace else None

    def plan(self, event: FaultEvent) -> None:
        """Add a fault to come."""
        with self._lock:
            self._waiting = sorted([*self._waiting, event], key=lambda event: event.at_s)

    def also_send(self, frames: Iterable[Frame]) -> None:
        """Send frames of any sender, as they are, with the next step."""
        with self._lock:
            self._extra += frames

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Take what the nodes sent, and send what acts next."""
        with self._lock:
            self.inbox = inbox
            self._receiver.accept(now_ns, inbox)
            if self._start_ns is None:
                motion = self.motion
                if motion is not None and motion.manoeuvre is not ManoeuvreState.HOLDING:
                    self._start_ns = now_ns
            if self._start_ns is not None:
                self.time_s = (now_ns - self._start_ns) * 1e-9
            extra, self._extra = self._extra, []
            return self._transmitter.frames(now_ns, self._outgoing()) + extra

    def _outgoing(self) -> list[Message]:
        out: list[Message] = []
        if Channel.BLENDING in self._traces:
            out.append(StimulusEcu(self.value(Channel.BLENDING)))
        if not self._traces.keys().isdisjoint(_DRIVER):
            out.append(StimulusDriver(*map(self.value, _DRIVER)))
        if not self._traces.keys().isdisjoint(_ROAD):
            out.append(StimulusRoad(*map(self.value, _ROAD)))
        if self._opening and self.motion is not None:
            self._opening -= 1
            out.append(FaultCommand(PhysicalFault.NONE, 0, 0))
        elif self.time_s is not None:
            while self._waiting and self._waiting[0].at_s <= self.next_s + 1e-9:
                event = self._waiting.pop(0)
                out.append(FaultCommand(event.fault, int(event.active), event.wheels))
        return out
