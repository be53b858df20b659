"""The bench as a node: sends the stimulus on the manoeuvre's clock, and follows the truth."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from enum import StrEnum
from math import nan
from threading import Lock
from typing import NamedTuple

from dbc.batch import Batch
from dbc.bench_messages import (
    FaultCommand,
    FaultSelect,
    ManoeuvreState,
    PhysicalFault,
    StimulusDriver,
    StimulusEcu,
    StimulusRoad,
    TruthMotion,
)
from dbc.contract import Message, spec_of
from dbc.exchange import Receiver, Transmitter
from dbc.frame import BusName, Frame, Received
from hil.faults.fault import FROM_THE_FIRST_TICK, MOST_SEEDS, Injection, Side
from hil.faults.physical import FaultEvent, events_of
from hil.faults.wire import SELECT_ID, start_messages, stop_messages
from plant.manoeuvre import Trace, value_at

BENCH_PHASE_NS = 2_500_000  # after the plant, before the controller: each hears the stimulus at its next tick
_MANOEUVRE, _FINISHED = TruthMotion._fields.index("manoeuvre"), float(ManoeuvreState.FINISHED)
_LEFT_NS = 50_000_000  # five cycles of the stimulus, half of what its receivers wait for it
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


_CHANNELS: tuple[tuple[type[Message], tuple[Channel, ...]], ...] = (
    (StimulusEcu, (Channel.BLENDING,)),
    (StimulusDriver, (Channel.PEDAL, Channel.SPEED, Channel.STEERING)),
    (StimulusRoad, (Channel.FRICTION_LEFT, Channel.FRICTION_RIGHT, Channel.GRADE)),
)
"""What each message of the stimulus carries, in the order of its fields."""
_ID_OF = {channels: spec_of(kind).can_id for kind, channels in _CHANNELS}
_STIMULUS_IDS = frozenset(_ID_OF.values())


class _Planned(NamedTuple):
    """Commands of one fault, and when they go out: what is for the controller must not come a tick early."""

    at_s: float
    messages: tuple[Message, ...]
    for_controller: bool = False


class StimulusNode:
    """The bench's own node. A step and a command may come from two threads.

    Parameters
    ----------
    blending : blending factor over time; empty leaves it to the controller's parameters.
    faults : what breaks when.
    period_ns : time between two steps.
    seed : of the faults that have none of their own.

    Attributes
    ----------
    injects : whether it has sent a fault of frames or processes.
    inbox, sent : what came with the last step, and what went.
    time_s : manoeuvre time, None before its start. What is sent now acts at ``next_s``, the plant's next tick.
    """

    def __init__(
        self,
        blending: Trace = (),
        faults: Sequence[FaultEvent | Injection] = (),
        period_ns: int = 10_000_000,
        seed: int = 1,
    ) -> None:
        self.injects = False
        self.inbox: Sequence[Received] = ()
        self.sent: Sequence[Frame] = ()
        self.time_s: float | None = None
        self._traces: dict[Channel, Trace] = {Channel.BLENDING: blending} if blending else {}
        self._all = [(Batch((kind,)), channels) for kind, channels in _CHANNELS]
        self._stimulated = self._of_traces()
        self._waiting: list[_Planned] = []
        self._seed = seed
        self._seeded = 0
        self._period_ns = period_ns
        self._start_ns: int | None = None
        self._opening = _OPENING_FRAMES
        self._extra: list[Frame] = []
        self._lock = Lock()
        self._receiver = Receiver((TruthMotion,))
        self._truth = self._receiver.values
        self._transmitter = Transmitter()
        self._left_until_ns: dict[int, int] = {}
        for fault in faults:
            self.plan(fault)

    @property
    def motion(self) -> TruthMotion | None:
        """The plant's last word about its motion."""
        return self._receiver.latest(TruthMotion)

    def motion_age_ns(self, now_ns: int) -> int | None:
        """Time since the plant's last word about its motion; None before the first."""
        return self._receiver.age_ns(TruthMotion, now_ns)

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
            self._stimulated = self._of_traces()

    def leave(self, channel: Channel) -> None:
        """Stimulate a channel no longer: scenario and parameters decide again."""
        with self._lock:
            self._traces.pop(channel, None)
            self._stimulated = self._of_traces()

    def _of_traces(self) -> list[tuple[Batch, tuple[Channel, ...]]]:
        """Messages with a channel that is stimulated, and all their channels."""
        return [(batch, channels) for batch, channels in self._all if not self._traces.keys().isdisjoint(channels)]

    def value(self, channel: Channel) -> float | None:
        """Value of a channel that acts next; None where it is not stimulated."""
        trace = self._traces.get(channel)
        return value_at(trace, self.next_s) if trace else None

    def give_way(self, now_ns: int, inbox: Iterable[Received]) -> None:
        """Leave messages of the stimulus to somebody else who sends them: a person at the live page."""
        for item in inbox:
            if item[1] in _STIMULUS_IDS and isinstance(item, Frame) and item.bus is BusName.BENCH:
                self._left_until_ns[item.can_id] = now_ns + _LEFT_NS

    def plan(self, fault: FaultEvent | Injection) -> None:
        """Add a fault to come."""
        planned = self._of_injection(fault) if isinstance(fault, Injection) else [_switched(fault)]
        with self._lock:
            self._waiting = sorted([*self._waiting, *planned], key=lambda one: one.at_s)

    def plan_end(self, injection: Injection, at_s: float) -> None:
        """Add the end of a fault; what was planned of it for later is dropped."""
        if injection.kind.side is Side.PLANT:
            first = events_of(injection)[0]
            end = _switched(FaultEvent(at_s, first.fault, first.wheels, active=False))
        else:
            end = _Planned(at_s, tuple(stop_messages(injection)), "ECU" in injection.target.nodes)
        with self._lock:
            kept = [one for one in self._waiting if one.at_s < at_s or not _same_fault(one, end)]
            self._waiting = sorted([*kept, end], key=lambda one: one.at_s)

    def _of_injection(self, injection: Injection) -> list[_Planned]:
        if injection.kind.side is Side.PLANT:
            return [_switched(event) for event in events_of(injection)]
        if injection.seed is None:
            injection = replace(injection, seed=(257 * self._seed + self._seeded) % MOST_SEEDS)
            self._seeded += 1
        messages = tuple(start_messages(injection))
        return [_Planned(injection.at_s - injection.lead_s, messages, "ECU" in injection.target.nodes)]

    def also_send(self, frames: Iterable[Frame]) -> None:
        """Send frames of any sender, as they are, with the next step."""
        with self._lock:
            self._extra += frames
            self.injects = self.injects or any(f.bus is BusName.BENCH and f.can_id == SELECT_ID for f in self._extra)

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Take what the nodes sent, and send what acts next."""
        with self._lock:
            self.inbox = inbox
            self._receiver.accept(now_ns, inbox)
            if self._start_ns is None:
                motion = self.motion
                if motion is not None and motion.manoeuvre not in (None, ManoeuvreState.HOLDING):
                    self._start_ns = now_ns
            if self._start_ns is not None:
                self.time_s = (now_ns - self._start_ns) * 1e-9
            extra, self._extra = self._extra, []
            frames = self._stimulus(now_ns) + self._transmitter.frames(now_ns, self._outgoing()) + extra
            self.sent = frames
            return frames

    def _stimulus(self, now_ns: int) -> list[Frame]:
        frames: list[Frame] = []
        if self._traces:
            next_s = self.next_s
            for batch, channels in self._stimulated:
                if self._left_until_ns and self._left_until_ns.get(_ID_OF[channels], 0) > now_ns:
                    continue
                traces = [self._traces.get(channel) for channel in channels]
                batch.write(*[value_at(trace, next_s) if trace else nan for trace in traces])
                frames += batch.frames(now_ns)
        return frames

    def _outgoing(self) -> list[Message]:
        out: list[Message] = []
        opens = self._opening > 0 and self.motion is not None
        if opens:
            self._opening -= 1
            out.append(FaultCommand(PhysicalFault.NONE, 0, 0))
        if self._waiting:
            out += self._due(opens)
        return out

    def _due(self, opens: bool) -> list[Message]:
        """Commands of faults that act next; those to the car wait for its opening frames."""
        out: list[Message] = []
        later: list[_Planned] = []
        for one in self._waiting:
            if one.at_s == FROM_THE_FIRST_TICK:
                due = True
            elif self.time_s is None or (opens and type(one.messages[-1]) is FaultCommand):
                due = False
            else:
                due = one.at_s <= (self.time_s if one.for_controller else self.next_s) + 1e-9
            if due:
                out += one.messages
                self.injects = self.injects or type(one.messages[-1]) is FaultSelect
            else:
                later.append(one)
        self._waiting = later
        return out


def _switched(event: FaultEvent) -> _Planned:
    return _Planned(event.at_s, event.messages)


def _same_fault(one: _Planned, other: _Planned) -> bool:
    """Whether both are commands of one fault on one target, whatever they do to it."""
    return _named(one.messages[-1]) == _named(other.messages[-1])


def _named(message: Message) -> tuple[int | None, ...]:
    """What names a fault and its target in a command."""
    if isinstance(message, FaultCommand):
        return message.fault, message.wheels
    return (message.fault, message.target, message.signal) if isinstance(message, FaultSelect) else ()
