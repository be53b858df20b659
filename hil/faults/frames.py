"""Valid frames for scripts of one's own: any message of our two databases, with counter and check value."""

from collections.abc import Mapping
from typing import Any

from dbc.contract import MessageSpec
from dbc.e2e import COUNTER_MODULUS
from dbc.frame import BusName, Frame, Received
from dbc.raw import named_messages
from hil.faults.fault import FaultError, nearest

Values = Mapping[str, float | int | None]


def protected(message: str, counter: int, values: Values) -> Frame:
    """One frame of a message, as its sender would send it.

    Parameters
    ----------
    message : name in brake.dbc or bench.dbc, such as ``BRAKE_PEDAL``.
    counter : alive counter, 0 to 14; of no meaning where the message has none.
    values : SI, by signal (``PEDAL_TRAVEL_1``) or by field (``pressure_fl_pa``); None and what is left out are not
        available (SNA), or 0 where the signal has no word for that. Beyond the range: the range's end.

    Raises
    ------
    FaultError
        No such message or signal; the error names the nearest.
    """
    spec = _spec(message)
    if not 0 <= counter < COUNTER_MODULUS:
        raise FaultError(f"{message}: counter: expected 0 to {COUNTER_MODULUS - 1}, got {counter!r}")
    return Frame(spec.bus, spec.can_id, spec.encode(_typed(spec, values), counter))


class Sender:
    """Somebody who sends one message in its cycle, with a counter of its own: a node (`dbc.frame.Node`).

    Parameters
    ----------
    message, values : as of `protected`; ``values`` may be changed at any time.
    counter : of the first frame.
    """

    def __init__(self, message: str, values: Values, counter: int = 0) -> None:
        self._spec = _spec(message)
        self.values: dict[str, float | int | None] = dict(values)
        self.counter = counter
        self._slot: int | None = None
        _typed(self._spec, self.values)

    def next(self, **changes: float | int | None) -> Frame:
        """The next frame; ``changes`` of the values hold from now on."""
        self.values.update(changes)
        frame = protected(self._spec.name, self.counter, self.values)
        self.counter = (self.counter + 1) % COUNTER_MODULUS
        return frame

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """The next frame where it is due."""
        slot = now_ns // self._spec.cycle_ns if self._spec.cycle_ns else now_ns
        if slot == self._slot:
            return []
        self._slot = slot
        return [self.next()]


def _spec(message: str) -> MessageSpec:
    known = named_messages(BusName.VEHICLE) | named_messages(BusName.BENCH)
    if message not in known:
        raise FaultError(f"no message {message!r}{nearest(message, known)}")
    return known[message]


def _typed(spec: MessageSpec, values: Values) -> tuple[Any, ...]:
    fields = {field.signal: field for field in spec.fields}
    by_field = {field.name: field.signal for field in spec.fields}
    found: dict[str, float | int | None] = {f.signal: None if f.sna is not None else 0 for f in spec.fields}
    for name, value in values.items():
        signal = by_field.get(name, name)
        if signal not in fields:
            raise FaultError(f"{spec.name}: no signal {name!r}{nearest(name, [*fields, *by_field])}")
        found[signal] = value
    return tuple(found[field.signal] for field in spec.fields)
