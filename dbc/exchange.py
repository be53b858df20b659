"""What every node does between its inbox and its outbox: check and decode, and send at the contract's cycle times."""

from collections.abc import Iterable, Sequence
from typing import TypeVar

from dbc import e2e
from dbc.contract import Message, MessageSpec, spec_of
from dbc.e2e import Checker, Status
from dbc.frame import Frame, LinkEvent, Received

M = TypeVar("M", bound=Message)


class Reception:
    """State of one received message.

    Attributes
    ----------
    message : the last usable message, None before the first.
    fresh : whether the last call of `Receiver.accept` brought a usable one.
    valid_in_row : usable frames since the last unusable one.
    bad_in_row : unusable frames since the last usable one.
    last_valid_ns : tick of the last usable frame, None before the first.
    """

    def __init__(self, spec: MessageSpec) -> None:
        self.spec = spec
        self.checker = Checker(spec.data_id or 0, spec.length) if spec.data_id is not None else None
        self.message: Message | None = None
        self.status = Status.NO_NEW_DATA
        self.fresh = False
        self.valid_in_row = 0
        self.bad_in_row = 0
        self.last_valid_ns: int | None = None

    def accept(self, now_ns: int, data: bytes) -> None:
        """Check one payload and keep its message when it is usable."""
        if self.checker is not None:
            self.status = self.checker.check(data)
        else:
            self.status = Status.OK if len(data) == self.spec.length else Status.WRONG_CRC
        if self.status in e2e.USABLE:
            self.message = self.spec.decode(data)
            self.fresh = True
            self.valid_in_row += 1
            self.bad_in_row = 0
            self.last_valid_ns = now_ns
        else:
            self.valid_in_row = 0
            self.bad_in_row += 1


class Receiver:
    """Picks a node's messages out of its inbox, checks and decodes them.

    Parameters
    ----------
    types : the typed messages the node reads; all other frames are passed over.
    """

    def __init__(self, types: Iterable[type[Message]]) -> None:
        self.receptions = {t: Reception(spec_of(t)) for t in types}
        self._by_key = {(r.spec.bus, r.spec.can_id): r for r in self.receptions.values()}
        self.link_events: list[LinkEvent] = []

    def accept(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """Take the inbox of the tick ``now_ns``; ``link_events`` then holds the tick's link events."""
        self.link_events = []
        for reception in self.receptions.values():
            reception.fresh = False
            reception.status = Status.NO_NEW_DATA
        for item in inbox:
            if isinstance(item, LinkEvent):
                self.link_events.append(item)
                continue
            if item.extended:
                continue
            known = self._by_key.get((item.bus, item.can_id))
            if known is not None:
                known.accept(now_ns, item.data)

    def latest(self, message_type: type[M]) -> M | None:
        """Last usable message of a type, however old."""
        return self.receptions[message_type].message  # type: ignore[return-value]

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
        return sum(r.checker.lost for r in self.receptions.values() if r.checker)

    @property
    def corrupt(self) -> int:
        """Frames with wrong check value or length, over all messages."""
        return sum(r.checker.corrupt for r in self.receptions.values() if r.checker)


class Transmitter:
    """Sends typed messages at the cycle times of the contract, whatever the rate of the task.

    A message is due in the first tick of each slot of its cycle; a late task sends once and never catches up.
    Messages without a cycle are sent whenever they are handed over.
    """

    def __init__(self) -> None:
        self._slot: dict[type[Message], int] = {}
        self._counter: dict[type[Message], int] = {}

    def due(self, message_type: type[Message], now_ns: int) -> bool:
        """Whether `frames` would send a message of this type at ``now_ns``."""
        cycle_ns = spec_of(message_type).cycle_ns
        return cycle_ns == 0 or self._slot.get(message_type) != now_ns // cycle_ns

    def frames(self, now_ns: int, outgoing: Iterable[Message]) -> list[Frame]:
        """Frames of the messages that are due, protected with their next counters."""
        frames = []
        for message in outgoing:
            kind = type(message)
            spec = spec_of(kind)
            if not self.due(kind, now_ns):
                continue
            if spec.cycle_ns:
                self._slot[kind] = now_ns // spec.cycle_ns
            payload = spec.encode(message)
            if spec.data_id is None:
                frames.append(Frame(spec.bus, spec.can_id, bytes(payload)))
                continue
            counter = self._counter.get(kind, 0)
            self._counter[kind] = (counter + 1) % e2e.COUNTER_MODULUS
            frames.append(Frame(spec.bus, spec.can_id, e2e.protect(spec.data_id, payload, counter)))
        return frames
