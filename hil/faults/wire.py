"""Armed faults on the bench bus: FAULT_PARAMETER and FAULT_SELECT, and what a process reads from them."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from dbc.bench_messages import FaultAction, FaultParameter, FaultSelect
from dbc.commands import CommandReader
from dbc.contract import Message, spec_of
from dbc.frame import Received
from hil.faults.catalogue import BY_NUMBER
from hil.faults.fault import FaultError, Injection
from hil.faults.parameters import parameters
from hil.faults.targets import WHOLE_MESSAGE, target_coded

SELECT_ID = spec_of(FaultSelect).can_id
STOP_ALL = FaultSelect(0, FaultAction.STOP, 0, WHOLE_MESSAGE, 0)


class Command(NamedTuple):
    """What a process is told: an armed fault to start, or the key of one to stop (None: all)."""

    start: Injection | None
    stop: tuple[int, int, int] | None


def start_messages(injection: Injection) -> list[Message]:
    """The messages that start an armed fault; it begins ``lead_s`` before it acts and lasts that much longer."""
    number, target = injection.kind.number, injection.target
    start = FaultSelect(number, FaultAction.START, target.code, target.signal, injection.seed or 0)
    return [*parameters(injection), start]


def stop_messages(injection: Injection) -> list[Message]:
    """The message that stops an armed fault."""
    number, code, signal = injection.key
    return [FaultSelect(number, FaultAction.STOP, code, signal, 0)]


class Commands:
    """Reads commands out of an inbox."""

    def __init__(self) -> None:
        self._parameters: dict[int, dict[int, float]] = {}
        self._reader = CommandReader((FaultParameter, FaultSelect))

    def read(self, inbox: Sequence[Received]) -> list[Command]:
        """Commands that came, in order; what names a fault or target that is not known is passed over."""
        found: list[Command] = []
        for message in self._reader.read(inbox):
            if isinstance(message, FaultParameter):
                self._note(message)
            elif isinstance(message, FaultSelect):
                found += self._select(message)
        return found

    def _note(self, message: FaultParameter) -> None:
        fault, index, mantissa, exponent = message
        if fault is not None and index is not None and mantissa is not None and exponent is not None:
            self._parameters.setdefault(fault, {})[index] = float(f"{mantissa}e{exponent}")

    def _select(self, message: FaultSelect) -> Iterable[Command]:
        number, code, signal = message.fault or 0, message.target or 0, message.signal or 0
        given = self._parameters.pop(number, {})
        if message.action is FaultAction.STOP:
            yield Command(None, (number, code, signal) if number else None)
            return
        entry = BY_NUMBER.get(number)
        target = None if entry is None else target_coded(code, signal, entry.kind.takes)
        if entry is None or target is None:
            return
        names = {index: p.name for index, p in enumerate(entry.kind.all_parameters)}
        try:
            values = {names[index]: value for index, value in given.items() if index in names}
            yield Command(entry.kind.on(target.name, seed=message.seed or 0, values=values), None)
        except FaultError:  # a number out of its bounds: of no sender of ours
            return
