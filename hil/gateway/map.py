"""A gateway's map: which of our signals are which signals of somebody else's database, both ways.

ours (SI) = theirs (physical) * unit * scale * sign + offset
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dbc.codec import Field
from dbc.contract import MessageSpec, contract
from dbc.database import Message, Signal
from dbc.frame import BusName
from hil.diagnosis.data.channel_map import to_si
from hil.diagnosis.data.log import UnusableError
from hil.gateway.database import UserDatabase, load
from hil.gateway.error import GatewayError
from hil.gateway.protection import Protection
from hil.gateway.sent import Sending
from hil.gateway.settings import (
    Table,
    counter_of,
    cycle_ns,
    finite,
    only,
    protection_of,
    raw_value,
    read_toml,
    sending_of,
    signal_of,
    whole,
)
from hil.gateway.signals import Raw, raw_range

_CYCLES_OLD = 2.5
"""Cycles of its source for which a value is passed on by default: one lost frame and its jitter; a choice."""
_CONVERSION = ("unit", "scale", "sign", "offset")


@dataclass(frozen=True, slots=True)
class Conversion:
    """ours = theirs * factor + offset; as a switch: theirs is 1 where ours is above ``above``."""

    factor: float
    offset: float
    above: float | None = None


@dataclass(frozen=True, slots=True)
class FromOurs:
    """Source of one of their signals.

    Attributes
    ----------
    spec, index : message and field of ours.
    none : raw value while ours is not available; None: the message is held back then.
    """

    signal: Signal
    spec: MessageSpec
    index: int
    conversion: Conversion
    none: Raw | None


@dataclass(frozen=True, slots=True)
class ToTheirs:
    """One message of theirs that the gateway sends; ``oldest_ns`` is how old a source may be."""

    sending: Sending
    sources: tuple[FromOurs, ...]
    oldest_ns: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class Heard:
    """One message of theirs that the gateway reads.

    Attributes
    ----------
    oldest_ns : how old a frame may be.  counter : plain counter signal and its modulus.
    """

    message: Message
    oldest_ns: int
    protection: Protection | None
    counter: tuple[Signal, int] | None


@dataclass(frozen=True, slots=True)
class FromTheirs:
    """Source of one field of ours; ``none`` is the raw value that means not available."""

    heard: Heard
    signal: Signal
    conversion: Conversion
    none: Raw | None


@dataclass(frozen=True, slots=True)
class ToOurs:
    """One message of ours that the gateway sends: a source, a constant or None (not available) per field."""

    spec: MessageSpec
    fields: tuple[FromTheirs | float | None, ...]


@dataclass(frozen=True, slots=True)
class GatewayMap:
    """Both ways.

    Attributes
    ----------
    path : the file.  database : theirs.
    theirs, ours : what is sent on each bus.  heard : what is read of theirs.
    """

    path: Path
    database: UserDatabase
    theirs: tuple[ToTheirs, ...]
    ours: tuple[ToOurs, ...]
    heard: tuple[Heard, ...]


def load_map(path: Path) -> GatewayMap:
    """Read a map; the path of its database counts from the map's folder.

    Raises
    ------
    GatewayError : what is wrong, where, and what was expected.
    """
    content = read_toml(path, ("dbc", "send", "receive", "ours"))
    if not isinstance(content.get("dbc"), str):
        raise GatewayError(f"{path}: dbc: expected the path of a DBC, got {content.get('dbc')!r}")
    database = load(path.parent / content["dbc"])
    sent = only(content.get("send", {}), tuple(database.messages), f"{path}: send")
    theirs = tuple(_to_theirs(database, name, table, f"{path}: send.{name}") for name, table in sent.items())
    stated = only(content.get("receive", {}), tuple(database.messages), f"{path}: receive")
    for name in stated:
        if name in sent:
            raise GatewayError(f"{path}: receive.{name}: the gateway sends it; expected one way")
    receive = _Receive(stated, f"{path}: receive")
    specs = {spec.name: spec for spec in contract(BusName.VEHICLE).by_id.values()}
    ours = []
    for name, table in only(content.get("ours", {}), tuple(specs), f"{path}: ours").items():
        ours.append(_to_ours(database, specs[name], table, receive, f"{path}: ours.{name}"))
    for name in stated:
        if name not in receive.found:
            raise GatewayError(f"{path}: receive.{name}: nothing under `ours` reads it")
    for one in receive.found.values():
        if one.message.name in sent:
            raise GatewayError(f"{path}: {one.message.name}: the gateway sends and reads it; expected one way")
    if not theirs and not ours:
        raise GatewayError(f"{path}: nothing to translate; expected a [send.MESSAGE] or an [ours.MESSAGE]")
    return GatewayMap(path, database, theirs, tuple(ours), tuple(receive.found.values()))


def _oldest_ns(table: Table, cycle: int, where: str) -> int:
    """How old a source may be: ``max_age_ms``, else by its cycle (ns)."""
    age_ms = finite(table, "max_age_ms", _CYCLES_OLD * cycle / 1e6, where)
    if age_ms <= 0.0:
        raise GatewayError(f"{where}: max_age_ms: expected more than 0, got {age_ms:g}")
    return round(age_ms * 1e6)


def _conversion(table: Table, where: str) -> Conversion:
    if "above" in table:
        if set(_CONVERSION) & set(table):
            raise GatewayError(f"{where}: above: a switch has no {', '.join(_CONVERSION)}")
        return Conversion(1.0, 0.0, finite(table, "above", None, where))
    try:
        factor, offset = to_si(str(table.get("unit", "")), where)
    except UnusableError as error:
        raise GatewayError(str(error)) from error
    sign = table.get("sign", 1)
    if sign not in (-1, 1):
        raise GatewayError(f"{where}: sign: expected 1 or -1, got {sign!r}")
    factor *= finite(table, "scale", 1.0, where) * sign
    return Conversion(factor, offset + finite(table, "offset", 0.0, where))


def _raw_none(table: Table, signal: Signal, where: str) -> Raw | None:
    if "none" not in table:
        return None
    return whole(table, "none", *raw_range(signal), where)


def _to_theirs(database: UserDatabase, name: str, table: Any, where: str) -> ToTheirs:
    table = only(table, ("cycle_ms", "max_age_ms", "counter", "protection", "signals"), where)
    message = database.message(name, where)
    fields = {
        field.name: (spec, index)
        for spec in contract(BusName.VEHICLE).by_id.values()
        for index, field in enumerate(spec.fields)
    }
    sources, start = [], {}
    signals = only(table.get("signals", {}), tuple(s.name for s in message.signals), f"{where}.signals")
    for key, entry in signals.items():
        here = f"{where}.signals.{key}"
        signal = signal_of(message, key, here)
        if not isinstance(entry, dict):
            start[key] = raw_value(signal, entry, here)
            continue
        entry = only(entry, ("from", *_CONVERSION, "above", "none"), here)
        if entry.get("from") not in fields:
            raise GatewayError(
                f"{here}: from: expected a value, or a field of our messages such as "
                f"{', '.join(list(fields)[:3])}, got {entry.get('from')!r}"
            )
        spec, index = fields[entry["from"]]
        conversion = _conversion(entry, here)
        if conversion.factor == 0.0 or signal.factor == 0:
            raise GatewayError(f"{here}: a scale, sign or factor of 0 cannot be turned round")
        sources.append(FromOurs(signal, spec, index, conversion, _raw_none(entry, signal, here)))
    sending = sending_of(database, name, table, start, where)
    if not sending.cycle_ns:
        raise GatewayError(f"{where}: the database states no cycle time; expected cycle_ms")
    oldest = {source.spec.name: _oldest_ns(table, source.spec.cycle_ns, where) for source in sources}
    return ToTheirs(sending, tuple(sources), oldest)


def _to_ours(database: UserDatabase, spec: MessageSpec, table: Any, receive: "_Receive", where: str) -> ToOurs:
    entries = only(table, tuple(field.name for field in spec.fields), where)
    found = tuple(_field(database, field, entries, receive, f"{where}.{field.name}") for field in spec.fields)
    if not any(isinstance(one, FromTheirs) for one in found):
        raise GatewayError(f'{where}: no field comes from them; expected {{from = "MESSAGE.SIGNAL"}} for a field')
    return ToOurs(spec, found)


def _field(
    database: UserDatabase, field: Field, entries: Table, receive: "_Receive", where: str
) -> FromTheirs | float | None:
    if field.name not in entries:
        if field.sna is None:
            raise GatewayError(f"{where}: has no value for not available; expected a number or {{from = ...}}")
        return None
    entry = entries[field.name]
    if not isinstance(entry, dict):
        return finite(entries, field.name, None, where)
    entry = only(entry, ("from", *_CONVERSION, "none"), where)
    name, _, signal_name = str(entry.get("from")).partition(".")
    message = database.message(name, f"{where}: from")
    signal = signal_of(message, signal_name, f"{where}: from")
    return FromTheirs(receive.heard(message), signal, _conversion(entry, where), _raw_none(entry, signal, where))


class _Receive:
    """The messages of theirs that are read, and what ``[receive.MESSAGE]`` says of them."""

    def __init__(self, stated: Table, where: str) -> None:
        self._stated = stated
        self._where = where
        self.found: dict[str, Heard] = {}

    def heard(self, message: Message) -> Heard:
        """How a message is read."""
        name = message.name
        if name not in self.found:
            self.found[name] = _heard(message, self._stated.get(name, {}), f"{self._where}.{name}")
        return self.found[name]


def _heard(message: Message, table: Any, where: str) -> Heard:
    table = only(table, ("cycle_ms", "max_age_ms", "counter", "protection"), where)
    cycle = cycle_ns(table, message, where)
    if not cycle and "max_age_ms" not in table:
        raise GatewayError(f"{where}: the database states no cycle time; expected cycle_ms or max_age_ms")
    counter = counter_of(table, message, where)
    return Heard(
        message,
        _oldest_ns(table, cycle, where),
        protection_of(table, message, where),
        None if counter is None else (signal_of(message, counter[0], where), counter[1]),
    )
