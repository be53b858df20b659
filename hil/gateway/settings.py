"""What stands in a TOML about messages that are sent and received: cycle, counter, protection, constant values."""

import math
import tomllib
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from dbc.database import Message, Signal
from hil.errors import unknown_keys
from hil.gateway.database import UserDatabase
from hil.gateway.error import GatewayError
from hil.gateway.protection import (
    DATA_ID_MODES,
    PROFILE_11_MODES,
    Profile1,
    Profile2,
    Profile5,
    Protection,
    ToyotaSum,
)
from hil.gateway.sent import Sending
from hil.gateway.signals import Raw, raw_of, raw_range
from hil.log.signals.integrity import has_profile_layout

Table = Mapping[str, Any]


def read_toml(path: Path, tables: Collection[str]) -> dict[str, Any]:
    """Content of a file whose keys at the top are among ``tables``.

    Raises
    ------
    GatewayError : not readable, not TOML, or another key.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise GatewayError(f"{path}: cannot be read as TOML: {getattr(error, 'strerror', None) or error}") from error
    only(content, tables, str(path))
    return content


def only(table: Any, keys: Collection[str], where: str) -> Table:
    """Return a table that has no other keys than these."""
    if not isinstance(table, dict):
        raise GatewayError(f"{where}: expected a table with {', '.join(keys)}, got {table!r}")
    if odd := unknown_keys(table, keys):
        raise GatewayError(f"{where}: {odd}")
    return table


def finite(table: Table, key: str, default: float | None, where: str) -> float:
    """A finite number of a table."""
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise GatewayError(f"{where}: {key}: expected a number, got {value!r}")
    return float(value)


def whole(table: Table, key: str, first: int, last: int, where: str, default: int | None = None) -> int:
    """A whole number of a table, from ``first`` to ``last``."""
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not first <= value <= last:
        raise GatewayError(f"{where}: {key}: expected a whole number from {first} to {last}, got {value!r}")
    return value


def signal_of(message: Message, name: str, where: str) -> Signal:
    """Signal of a message by name."""
    for signal in message.signals:
        if signal.name == name:
            return signal
    known = ", ".join(signal.name for signal in message.signals)
    raise GatewayError(f"{where}: {message.name} has no signal {name}; it has {known}")


def raw_value(signal: Signal, value: Any, where: str) -> Raw:
    """Raw value of a constant: a physical number, or a name of the value table."""
    if isinstance(value, str):
        for choice, name in signal.choices.items():
            if name == value:
                return choice
        known = ", ".join(signal.choices.values()) or "no names"
        raise GatewayError(f"{where}: {value!r} is no value of {signal.name}; the database has {known}")
    number = finite({"value": int(value) if isinstance(value, bool) else value}, "value", None, where)
    try:
        raw = raw_of(signal, number)
    except ValueError as error:
        raise GatewayError(f"{where}: {error}") from error
    if not signal.is_float:
        ends = [end * signal.factor + signal.offset for end in raw_range(signal)]
        slack = abs(signal.factor) / 2
        if not min(ends) - slack <= number <= max(ends) + slack:
            raise GatewayError(
                f"{where}: {signal.name} holds {min(ends):g} to {max(ends):g} {signal.unit}, got {number:g}"
            )
    return raw


def cycle_ns(table: Table, message: Message, where: str) -> int:
    """Cycle time: as stated, else as in the database, else 0."""
    cycle_ms = finite(table, "cycle_ms", message.cycle_time_ms or 0.0, where)
    if cycle_ms < 0.0 or 0.0 < cycle_ms < 1.0:
        raise GatewayError(f"{where}: cycle_ms: expected 0 (only on change) or at least 1, got {cycle_ms:g}")
    return round(cycle_ms * 1e6)


def counter_of(table: Table, message: Message, where: str) -> tuple[str, int] | None:
    """``counter = {signal, modulus}``: a plain counter signal; the modulus is what its bits hold by default."""
    if "counter" not in table:
        return None
    where = f"{where}: counter"
    stated = only(table["counter"], ("signal", "modulus"), where)
    signal = signal_of(message, str(stated.get("signal")), where)
    highest = 1 << signal.length
    return signal.name, whole(stated, "modulus", 2, highest, where, highest)


def _profile_1(table: Table, modes: Collection[str], where: str) -> Protection:
    only(table, ("profile", "data_id", "data_id_mode", "offset"), where)
    mode = table.get("data_id_mode", "both")
    if mode not in modes:
        raise GatewayError(f"{where}: data_id_mode: expected one of {', '.join(modes)}, got {mode!r}")
    last = 0x0FFF if mode == "nibble" else 0xFFFF
    return Profile1(whole(table, "data_id", 0, last, where), mode, whole(table, "offset", 0, 6, where, 0))


def _profile_2(table: Table, where: str) -> Protection:
    ids = only(table, ("profile", "data_ids"), where).get("data_ids")
    if not isinstance(ids, list) or len(ids) != 16 or not all(isinstance(i, int) and 0 <= i <= 255 for i in ids):
        raise GatewayError(f"{where}: data_ids: expected 16 numbers from 0 to 255, got {ids!r}")
    return Profile2(bytes(ids))


def _profile_5(table: Table, where: str) -> Protection:
    only(table, ("profile", "data_id", "offset"), where)
    return Profile5(whole(table, "data_id", 0, 0xFFFF, where), whole(table, "offset", 0, 5, where, 0))


_PROFILES: dict[int, Callable[[Table, str], Protection]] = {
    1: lambda table, where: _profile_1(table, tuple(DATA_ID_MODES), where),
    2: _profile_2,
    5: _profile_5,
    11: lambda table, where: _profile_1(table, PROFILE_11_MODES, where),
}


def protection_of(table: Table, message: Message, where: str) -> Protection | None:
    """``protection = {profile, ...}`` or ``{sum = "toyota"}``; else profile 1A where the database has an E2EDataID."""
    stated = table.get("protection")
    if stated is None:
        data_id = message.e2e_data_id
        profile_1a = data_id is not None and 0 <= data_id <= 0xFFFF and has_profile_layout(message)
        return Profile1(data_id or 0) if profile_1a else None
    where = f"{where}: protection"
    if not isinstance(stated, dict) or ("profile" in stated) == ("sum" in stated):
        raise GatewayError(f'{where}: expected {{profile = 1, 2, 5 or 11, ...}} or {{sum = "toyota"}}, got {stated!r}')
    if "sum" in stated:
        if only(stated, ("sum",), where)["sum"] != "toyota":
            raise GatewayError(f'{where}: sum: expected "toyota", got {stated["sum"]!r}')
        found: Protection = ToyotaSum(message.can_id)
    elif stated["profile"] in tuple(_PROFILES):
        found = _PROFILES[stated["profile"]](stated, where)
    else:
        raise GatewayError(f"{where}: profile: expected one of 1, 2, 5, 11, got {stated['profile']!r}")
    if message.length < found.shortest:
        raise GatewayError(f"{where}: needs {found.shortest} bytes, {message.name} has {message.length}")
    return found


def sending_of(database: UserDatabase, name: str, table: Table, start: Mapping[str, Raw], where: str) -> Sending:
    """How a message is sent; ``start`` overrides start values of the database."""
    message = database.message(name, where)
    return Sending(
        message,
        cycle_ns(table, message, where),
        {**database.start[name], **start},
        protection_of(table, message, where),
        counter_of(table, message, where),
    )
