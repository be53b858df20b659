"""What every node does between its inbox and its outbox: check and decode, and send at the contract's cycle times."""

from collections.abc import Iterable, Sequence
from typing import TypeVar

from dbc.contract import Message, MessageSpec, spec_of
from dbc.e2e import COUNTER_MODULUS, Status
from dbc.frame import BusName, Frame, LinkEvent, Received
from dbc.reception import Reception

M = TypeVar("M", bound=Message)
LAST_COUNTER = COUNTER_MODULUS - 1
# on the way of every frame: without the Python-made __new__ of a NamedTuple and the slow look-up of an enum's member
_new = tuple.__new__
_VEHICLE, _NO_NEW_DATA = BusName.VEHICLE, Status.NO_NEW_DATA


class Receiver:
    """Picks a node's messages out of its inbox, checks and decodes them.

    Parameters
    ----------
    types : the typed messages the node reads; all other frames are passed over.
    """

    def __init__(self, types: Iterable[type[Message]]) -> None:
        self.receptions = {t: Reception(spec_of(t)) for t in types}
        self._all = list(self.receptions.values())
        self._checkers = [reception.checker for reception in self._all if reception.checker is not None]
        # by bus and identifier, in two steps: hashing the name of a bus for each frame is slow
        self._vehicle, self._bench = (
            {r.spec.can_id: r for r in self._all if r.spec.bus is bus} for bus in (BusName.VEHICLE, BusName.BENCH)
        )
        self.link_events: list[LinkEvent] = []

    def accept(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """Take the inbox of the tick ``now_ns``; ``link_events`` then holds the tick's link events."""
        for reception in self._all:
            reception.fresh = False
            reception.status = _NO_NEW_DATA
        self.link_events = []
        vehicle, bench = self._vehicle, self._bench
        for item in inbox:
            if isinstance(item, LinkEvent):
                self.link_events.append(item)
                continue
            bus, can_id, data, _, extended = item
            known = (vehicle if bus is _VEHICLE else bench).get(can_id)
            if known is not None and not extended:
                known.accept(now_ns, data)

    def latest(self, message_type: type[M]) -> M | None:
        """Last usable message of a type, however old."""
        return self.receptions[message_type].message  # type: ignore[return-value]  # each is kept under its own type

    def age_ns(self, message_type: type[Message], now_ns: int) -> int | None:
        """Time since the tick of the last usable message; None before the first."""
        last = self.receptions[message_type].last_valid_ns
        return None if last is None else now_ns - last

    def counter(self, message_type: type[Message]) -> int | None:
        """Last alive counter consumed of a message."""
        checker = self.receptions[message_type].checker
        return None if checker is None else checker.counter

    @property
    def lost(self) -> int:
        """Frames missing by their counters, over all messages."""
        return sum([checker.lost for checker in self._checkers])

    @property
    def corrupt(self) -> int:
        """Frames with wrong check value or length, over all messages."""
        return sum([checker.corrupt for checker in self._checkers])


class Transmitter:
    """Sends typed messages at the cycle times of the contract, whatever the rate of the task.

    A message is due in the first tick of each slot of its cycle; a late task sends once and never catches up.
    Messages without a cycle are sent whenever they are handed over.
    """

    def __init__(self) -> None:
        self._state: dict[type[Message], _Sending] = {}

    def _of(self, message_type: type[Message]) -> "_Sending":
        state = self._state.get(message_type)
        if state is None:
            state = self._state[message_type] = _Sending(spec_of(message_type))
        return state

    def due(self, message_type: type[Message], now_ns: int) -> bool:
        """Whether `frames` would send a message of this type at ``now_ns``."""
        state = self._of(message_type)
        return state.cycle_ns == 0 or state.slot != now_ns // state.cycle_ns

    def frames(self, now_ns: int, outgoing: Iterable[Message]) -> list[Frame]:
        """Frames of the messages that are due, protected with their next counters."""
        frames = []
        known = self._state
        for message in outgoing:
            kind = type(message)
            state = known.get(kind) or self._of(kind)
            if state.cycle_ns:
                slot = now_ns // state.cycle_ns
                if slot == state.slot:
                    continue
                state.slot = slot
            counter = state.counter
            state.counter = counter + 1 if counter < LAST_COUNTER else 0
            frames.append(_new(Frame, (state.bus, state.can_id, state.encode(message, counter), 0, False)))
        return frames


class _Sending:
    """State of one sent message."""

    __slots__ = ("bus", "can_id", "counter", "cycle_ns", "encode", "slot")

    def __init__(self, spec: MessageSpec) -> None:
        self.bus, self.can_id, self.encode = spec.bus, spec.can_id, spec.encode
        self.cycle_ns = spec.cycle_ns
        self.slot: int | None = None
        self.counter = 0
