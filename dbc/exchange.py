"""What every node does between its inbox and its outbox: check and decode, and send at the contract's cycle times."""

from collections.abc import Callable, Iterable, Sequence
from operator import itemgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from dbc.compiled import PAYLOAD
from dbc.contract import Message, MessageSpec, spec_of
from dbc.e2e import COUNTER_MODULUS
from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from dbc.intake import JUDGED_ALONE, Intake, Vector
from dbc.reception import Reception

M = TypeVar("M", bound=Message)
LAST_COUNTER = COUNTER_MODULUS - 1
# on the way of every frame: without the Python-made __new__ of a NamedTuple and the slow look-up of an enum's member
_new = tuple.__new__
_VEHICLE = BusName.VEHICLE
_WHOLE = frozenset({PAYLOAD})
_Plan = tuple[Callable[[Sequence[Received]], Any], tuple[BusName, ...], bytes]
"""What to pick out of an inbox of frames with certain identifiers, the buses they then are on, and their messages."""
_MOST_PLANS = 64  # a bus in order needs a few, with messages of several cycle times


class Receiver:
    """Picks a node's messages out of its inbox, checks and decodes them.

    Parameters
    ----------
    types : the typed messages the node reads; all other frames are passed over.
    own : messages of the vehicle bus that the node sends; nobody else may.
    others : identifiers of the vehicle bus whose frames are handed on as they came.

    Attributes
    ----------
    receptions : state of each message.
    values : last usable values of all fields, SI units, message after message in the order of ``types``; NaN where not
        available or not yet received.
    link_events, others : those of the last tick.  own_heard : frames of the last tick with an identifier of ``own``.
    lost, corrupt : frames missing by their counters, and with wrong check value or length, over all messages.
    """

    def __init__(
        self, types: Iterable[type[Message]], own: Iterable[type[Message]] = (), others: Iterable[int] = ()
    ) -> None:
        kinds = tuple(types)
        self._intake = Intake([spec_of(kind) for kind in kinds])
        self.receptions = {kind: Reception(self._intake, index) for index, kind in enumerate(kinds)}
        self._all = list(self.receptions.values())
        # by bus and identifier, in two steps: hashing the name of a bus for each frame is slow
        self._vehicle, self._bench = (
            {r.spec.can_id: index for index, r in enumerate(self._all) if r.spec.bus is bus}
            for bus in (BusName.VEHICLE, BusName.BENCH)
        )
        self._own = frozenset(spec_of(kind).can_id for kind in own)
        self._others = frozenset(others)
        # the second element of what comes
        self._of_interest = {*self._vehicle, *self._bench, *self._own, *self._others, *LinkState}
        self._plans: dict[tuple[Any, ...], _Plan] = {}
        self.values: Vector = self._intake.values
        self.link_events: list[LinkEvent] = []
        self.others: list[Frame] = []
        self.own_heard = 0
        self.lost = self.corrupt = 0

    def accept(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """Take the inbox of the tick ``now_ns``; ``link_events`` then holds the tick's link events."""
        self.link_events = []
        self.others = []
        self.own_heard = 0
        ids = tuple([item[1] for item in inbox])
        plan = self._plans.get(ids)
        if plan is not None:
            pick, buses, indices = plan
            is_on, _, payloads, _, extended = zip(*pick(inbox), strict=True)
            if is_on == buses and True not in extended:
                self._take(now_ns, indices, payloads)
                return
        self._sort_out(now_ns, ids, inbox)

    def _sort_out(self, now_ns: int, ids: tuple[Any, ...], inbox: Sequence[Received]) -> None:
        """Take an inbox as none was before, and plan for the next one with the same identifiers."""
        of_interest, vehicle, bench = self._of_interest, self._vehicle, self._bench
        indices: list[int] = []
        payloads: list[bytes] = []
        for item in [item for item in inbox if item[1] in of_interest]:
            if isinstance(item, LinkEvent):
                self.link_events.append(item)
                continue
            bus, can_id, data, _, extended = item
            index = (vehicle if bus is _VEHICLE else bench).get(can_id)
            if index is not None and not extended:
                indices.append(index)
                payloads.append(data)
            elif bus is _VEHICLE and can_id in self._own and not extended:
                self.own_heard += 1
            elif bus is _VEHICLE and can_id in self._others and not extended:
                self.others.append(item)
        self._take(now_ns, indices, payloads)
        where = [k for k, can_id in enumerate(ids) if can_id in of_interest]
        if 0 < len(where) == len(indices):
            if len(self._plans) >= _MOST_PLANS:
                self._plans.clear()
            pick = itemgetter(slice(where[0], where[0] + 1)) if len(where) == 1 else itemgetter(*where)
            self._plans[ids] = pick, tuple([inbox[k][0] for k in where]), bytes(indices)

    def _take(self, now_ns: int, indices: Sequence[int], payloads: Sequence[bytes]) -> None:
        """Take the usual frames together, up to each that is to be judged alone."""
        if _WHOLE.issuperset(map(len, payloads)):
            frames = np.frombuffer(bytes(indices) + b"".join(payloads), np.uint8)
        else:
            frames = _with_odd_lengths(indices, payloads)
        unusual = self._intake.take(now_ns, 0, frames)
        if unusual == len(payloads):
            return
        judged = []
        while unusual < len(payloads):
            judged.append(self._all[indices[unusual]])
            judged[-1].accept(now_ns, payloads[unusual])
            unusual = self._intake.take(now_ns, unusual + 1, frames)
        for reception in judged:
            reception.finish(now_ns)
        checkers = [reception.checker for reception in self._all if reception.checker is not None]
        self.lost = sum([checker.lost for checker in checkers])
        self.corrupt = sum([checker.corrupt for checker in checkers])

    def of(self, message_type: type[Message]) -> Vector:
        """Where the values of a message lie in `values`; shape (fields,)."""
        return self._intake.of(self.receptions[message_type].index)

    def latest(self, message_type: type[M]) -> M | None:
        """Last usable message of a type, however old."""
        return self.receptions[message_type].message  # type: ignore[return-value]  # each is kept under its own type

    def age_ns(self, message_type: type[Message], now_ns: int) -> int | None:
        """Time since the tick of the last usable message; None before the first."""
        last = self.receptions[message_type].last_valid_ns
        return None if last is None else now_ns - last

    @property
    def well(self) -> list[int]:
        """Of each message 1 where the last tick brought a usable frame and nothing odd."""
        return self._intake.well

    @property
    def counters(self) -> list[int]:
        """Last alive counter consumed of each message; `dbc.intake.NO_COUNTER` before the first."""
        return self._intake.counters

    def counter(self, message_type: type[Message]) -> int | None:
        """Last alive counter consumed of a message."""
        return self.receptions[message_type].counter


def _with_odd_lengths(indices: Sequence[int], payloads: Sequence[bytes]) -> NDArray[np.uint8]:
    whole = [len(data) == PAYLOAD for data in payloads]
    which = [index if right else JUDGED_ALONE for index, right in zip(indices, whole, strict=True)]
    return np.frombuffer(bytes(which) + b"".join([data[:PAYLOAD].ljust(PAYLOAD, b"\0") for data in payloads]), np.uint8)


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
