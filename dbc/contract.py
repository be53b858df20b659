"""Our two databases, loaded once and strictly, with a compiled codec for every typed message."""

import re
import typing
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from importlib import resources
from typing import Any

from dbc import bench_messages, e2e, messages
from dbc.codec import CRC_SIGNAL, CodecError, Field, compile_decoder, compile_encoder, field_of, payload_signals
from dbc.frame import BusName
from dbc.lean_cantools import Database, DbcMessage, cantools

Message = tuple[Any, ...]  # a typed message: one of the NamedTuples of messages.py and bench_messages.py


@dataclass(frozen=True, slots=True, eq=False)
class MessageSpec:
    """One message of the contract.

    Attributes
    ----------
    name, can_id, length, sender : as in the DBC (length in bytes).
    cycle_ns : cycle time, ns; 0 for a message that is sent on change.
    data_id : data id of its end-to-end protection, None where it has none.
    type : the typed message.  fields : its fields in order.
    encode, decode : compiled codec; ``encode(message, counter)`` protects where the message is protected.
    """

    bus: BusName
    name: str
    can_id: int
    length: int
    sender: str
    receivers: frozenset[str]
    cycle_ns: int
    data_id: int | None
    type: type[Message]
    fields: tuple[Field, ...]
    encode: Callable[..., bytes]
    decode: Callable[[bytes], Any]


@dataclass(frozen=True, slots=True, eq=False)
class Contract:
    """One of our two databases. Attributes: ``by_id`` and ``by_type`` map to `MessageSpec`; ``bit_rate`` in bit/s."""

    bus: BusName
    bit_rate: int
    by_id: dict[int, MessageSpec]
    by_type: dict[type[Message], MessageSpec]

    def sent_by(self, *nodes: str) -> list[MessageSpec]:
        """Messages that the named nodes send."""
        return [spec for spec in self.by_id.values() if spec.sender in nodes]


def dbc_name(message_type: type[Message]) -> str:
    """Name in the DBC of a typed message: ``WheelSpeedFront`` -> ``WHEEL_SPEED_FRONT``."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", message_type.__name__).upper()


def _enum_of(hint: Any) -> type[IntEnum] | None:
    kinds = [k for k in typing.get_args(hint) if isinstance(k, type) and issubclass(k, IntEnum)]
    return kinds[0] if kinds else None


def _attribute(owner: DbcMessage | Database, name: str) -> Any:
    attribute = owner.dbc.attributes.get(name) if owner.dbc else None
    return None if attribute is None else attribute.value


def _spec(bus: BusName, message: DbcMessage, message_type: type[Message]) -> MessageSpec:
    hints = typing.get_type_hints(message_type)
    names = list(hints)
    signals = payload_signals(message)
    fields = [field_of(s, _enum_of(hints.get(name))) for s, name in zip(signals, names, strict=False)]
    if [f.name for f in fields] != names or len(signals) != len(names):
        raise CodecError(
            f"{message.name}: fields of {message_type.__name__} are {names}, the DBC gives "
            f"{[field_of(s).name for s in signals]}; bring the typed message and the DBC together"
        )
    data_id = _attribute(message, "E2EDataID")
    if (data_id is not None) != any(s.name == CRC_SIGNAL for s in message.signals):
        raise CodecError(f"{message.name}: a message has both a {CRC_SIGNAL} signal and an E2EDataID, or neither")
    profile = _attribute(message, "E2EProfile")
    if profile != (None if data_id is None else e2e.PROFILE):
        raise CodecError(
            f"{message.name}: E2EProfile is {profile!r}; expected {e2e.PROFILE!r} beside an E2EDataID, else nothing"
        )
    return MessageSpec(
        bus=bus,
        name=message.name,
        can_id=message.frame_id,
        length=message.length,
        sender=message.senders[0],
        receivers=frozenset(message.receivers),
        cycle_ns=(message.cycle_time or 0) * 1_000_000,
        data_id=data_id,
        type=message_type,
        fields=tuple(fields),
        encode=compile_encoder(message, fields, data_id),
        decode=compile_decoder(message, fields, message_type),
    )


def database_text(bus: BusName) -> str:
    """Text of our database for a bus (brake.dbc for the vehicle bus, bench.dbc for the bench bus)."""
    name = "brake.dbc" if bus is BusName.VEHICLE else "bench.dbc"
    return resources.files("dbc").joinpath(name).read_text(encoding="utf-8")


@cache
def contract(bus: BusName) -> Contract:
    """Our database for a bus; every typed message is held against it.

    Raises
    ------
    CodecError
        When the typed messages and the DBC do not agree.
    """
    database = cantools.database.load_string(database_text(bus), database_format="dbc", strict=True)
    assert isinstance(database, Database)
    types = messages.BRAKE_MESSAGES if bus is BusName.VEHICLE else bench_messages.BENCH_MESSAGES
    by_name = {dbc_name(t): t for t in types}
    if set(by_name) != {m.name for m in database.messages}:
        odd = set(by_name) ^ {m.name for m in database.messages}
        raise CodecError(f"{bus} database and typed messages differ in {sorted(odd)}; add what is missing on one side")
    specs = [_spec(bus, m, by_name[m.name]) for m in database.messages]
    return Contract(
        bus, _attribute(database, "Baudrate") or 0, {s.can_id: s for s in specs}, {s.type: s for s in specs}
    )


@cache
def spec_of(message_type: type[Message]) -> MessageSpec:
    """Contract entry of a typed message, whichever bus it belongs to."""
    bus = BusName.VEHICLE if message_type in messages.BRAKE_MESSAGES else BusName.BENCH
    return contract(bus).by_type[message_type]


def encode(message: Message, counter: int = 0) -> bytes:
    """Payload of a typed message, protected with ``counter`` where its message is protected."""
    return spec_of(type(message)).encode(message, counter)
