"""A user's database with what a sender needs beyond a decoder: start values, and how its messages are protected."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dbc.database import Database, Message, parse_database
from dbc.database_checks import printable_name
from dbc.database_values import DatabaseError, Warnings
from dbc.dbc_text import DbcText
from dbc.text_encoding import decoded
from hil.gateway.error import GatewayError
from hil.gateway.signals import Raw, raw_range

MOST_BYTES = 8  # of a frame of classical CAN


@dataclass(frozen=True, slots=True)
class UserDatabase:
    """A database by names.

    Attributes
    ----------
    path : the file.  messages : by name, those of classical CAN.  nodes : senders of messages.
    start : raw start values (GenSigStartValue, else 0) by message and signal.
    left_out : messages of CAN FD or a transport protocol, which nobody here sends.
    """

    path: Path
    messages: Mapping[str, Message]
    nodes: frozenset[str]
    start: Mapping[str, Mapping[str, Raw]]
    left_out: tuple[str, ...]

    def message(self, name: str, where: str) -> Message:
        """Message of a name; ``where`` opens the error message.

        Raises
        ------
        GatewayError : there is none such.
        """
        found = self.messages.get(name)
        if found is None:
            why = f"{name} is no frame of classical CAN" if name in self.left_out else f"no message {name}"
            raise GatewayError(f"{where}: {why} in {self.path}; it has {_some(sorted(self.messages))}")
        return found


def _some(names: list[str]) -> str:
    return ", ".join(names[:20]) + (f" and {len(names) - 20} more" if len(names) > 20 else "")


def load(path: Path) -> UserDatabase:
    """Read a DBC.

    Raises
    ------
    GatewayError : the file cannot be read or holds no usable message.
    """
    try:
        content = path.read_bytes()
        database = parse_database(content, str(path))
    except (OSError, DatabaseError) as error:
        raise GatewayError(f"{path}: {error.strerror}" if isinstance(error, OSError) else str(error)) from error
    classical = {m.name: m for m in database.messages.values() if m.length <= MOST_BYTES and not m.is_fd}
    return UserDatabase(
        path=path,
        messages=classical,
        nodes=frozenset(m.sender for m in classical.values() if m.sender),
        start=_start_values(decoded(content, []), database),
        left_out=tuple(m.name for m in database.messages.values() if m.name not in classical),
    )


def _start_values(text: str, database: Database) -> dict[str, dict[str, Raw]]:
    """GenSigStartValue of each signal: a raw value, as Vector defines it."""
    details = DbcText(text, Warnings()).details
    own: dict[tuple[int, str], float] = {}
    for (key, short), attributes in details.attributes.items():
        value = _number(attributes.get("GenSigStartValue"))
        if value is not None:
            own[key, short] = own[key, printable_name(details.long_names.get((key, short), short))] = value
    default = _number(details.defaults.get("GenSigStartValue")) or 0.0
    found: dict[str, dict[str, Raw]] = {}
    for (can_id, extended), message in database.messages.items():
        key = can_id | (0x8000_0000 if extended else 0)
        found[message.name] = starts = {}
        for signal in message.signals:
            raw = own.get((key, signal.name), default)
            if not signal.is_float:
                lowest, highest = raw_range(signal)
                raw = min(max(round(raw), lowest), highest)
            starts[signal.name] = raw
    return found


def _number(text: str | None) -> float | None:
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if abs(value) < 1e300 else None
