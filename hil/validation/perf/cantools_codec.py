"""The contract's codec by cantools, as the other side of comparisons: same messages, same values, same bytes."""

import contextlib
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache
from types import ModuleType
from typing import Any

import cantools
import numpy as np
from cantools.database import Database
from cantools.database.can import Message as DbcMessage
from cantools.database.namedsignalvalue import NamedSignalValue
from numpy.typing import NDArray

from dbc import e2e, exchange
from dbc.batch import Batch
from dbc.codec import SNA
from dbc.compiled import PAYLOAD
from dbc.contract import Message, MessageSpec, database_text, spec_of
from dbc.exchange import Transmitter
from dbc.frame import BusName, Frame
from dbc.intake import BAD_IN_ROW, FRESH, LAST_VALID_NS, RECEIVED, VALID_IN_ROW, WELL, WORD, Intake
from ecu import node
from hil.bench import stimulus
from plant import reports


@cache
def database(bus: BusName) -> Database:
    """Our database as cantools loads it."""
    loaded = cantools.database.load_string(database_text(bus), database_format="dbc")
    assert isinstance(loaded, Database)
    return loaded


def dbc_values(spec: MessageSpec, message: Message) -> dict[str, float | str]:
    """A typed message as cantools wants it: by signal name, in the DBC's units, clamped, SNA by name."""
    values: dict[str, float | str] = {"CRC": 0, "ALIVE_COUNTER": 0} if spec.data_id is not None else {}
    for field, value in zip(spec.fields, message, strict=True):
        if value is None or not math.isfinite(value):
            values[field.signal] = SNA
        else:
            values[field.signal] = min(max(value / field.si_per_unit, field.minimum), field.maximum)
    return values


def encoder(spec: MessageSpec, message: DbcMessage) -> Callable[..., bytes]:
    """`MessageSpec.encode` by cantools."""

    def encode(values: Message, counter: int = 0) -> bytes:
        return protected(spec, message.encode(dbc_values(spec, values)), counter)

    return encode


def protected(spec: MessageSpec, payload: bytes, counter: int) -> bytes:
    """A payload of cantools with the contract's protection."""
    return payload if spec.data_id is None else e2e.protect(spec.data_id, bytearray(payload), counter)


def decoder(spec: MessageSpec, message: DbcMessage) -> Callable[[bytes], Any]:
    """`MessageSpec.decode` by cantools."""

    def decode(data: bytes) -> Any:
        found: Any = message.decode(data)
        values: list[Any] = []
        for field in spec.fields:
            value = found[field.signal]
            if isinstance(value, NamedSignalValue):
                raw = int(value.value)
                values.append(None if value.name == SNA else field.enum(raw) if field.enum else raw)
            else:
                values.append(value * field.si_per_unit)
        return spec.type(*values)

    return decode


@cache
def cantools_spec(message_type: type[Message]) -> MessageSpec:
    """Contract entry whose codec is cantools."""
    spec = spec_of(message_type)
    message = database(spec.bus).get_message_by_name(spec.name)
    return replace(spec, encode=encoder(spec, message), decode=decoder(spec, message))


class _CantoolsBatch(Batch):
    """A batch whose frames go through cantools, one after the other."""

    def __init__(self, types: Iterable[type[Message]]) -> None:
        super().__init__(types := tuple(types))
        self._types = types
        self._transmitter = Transmitter()

    def frames(self, now_ns: int) -> list[Frame]:
        messages = (
            tuple.__new__(kind, [None if math.isnan(value) else value for value in self.of(kind).tolist()])
            for kind in self._types
            if self._transmitter.due(kind, now_ns)
        )
        return self._transmitter.frames(now_ns, messages)


class _CantoolsIntake(Intake):
    """An intake that takes no frame as usual: each is checked and decoded alone, by cantools."""

    def take(self, now_ns: int, begin: int, frames: NDArray[np.uint8]) -> int:
        if begin == 0:
            for memory in self.memory:
                memory[FRESH] = memory[WELL] = 0
        return min(begin, len(frames) // (1 + PAYLOAD))

    def keep(self, now_ns: int, index: int, payload: bytes) -> None:
        message = self.specs[index].decode(payload)
        self.of(index)[:] = [math.nan if value is None else value for value in message]
        memory = self.memory[index]
        memory[FRESH] = memory[RECEIVED] = 1
        memory[VALID_IN_ROW] += 1
        memory[BAD_IN_ROW] = 0
        memory[LAST_VALID_NS] = now_ns
        memory[WORD] = int.from_bytes(payload, "little", signed=True)


_REPLACED: tuple[tuple[ModuleType, str, Any], ...] = (
    (exchange, "spec_of", cantools_spec),
    (exchange, "Intake", _CantoolsIntake),
    (reports, "Batch", _CantoolsBatch),
    (node, "Batch", _CantoolsBatch),
    (stimulus, "Batch", _CantoolsBatch),
)


@contextlib.contextmanager
def cantools_inside() -> Iterator[None]:
    """Receivers, transmitters and batches that are made in here use cantools."""
    with contextlib.ExitStack() as stack:
        for module, name, other in _REPLACED:
            stack.callback(vars(module).__setitem__, name, vars(module)[name])
            vars(module)[name] = other
        yield
