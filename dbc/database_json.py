"""A database as JSON text and back, exactly: how it comes out of the process that reads foreign formats."""

import json
from typing import Any

from dbc.database_values import Database, DatabaseError, Message, Signal

_SIGNAL_FIELDS = tuple(Signal.__dataclass_fields__)
_MESSAGE_FIELDS = tuple(Message.__dataclass_fields__)


def database_to_json(database: Database) -> str:
    """Return a database as one JSON object on one line."""
    return json.dumps(
        {
            "source": database.source,
            "bit_rate": database.bit_rate,
            "warnings": database.warnings,
            "messages": [_message_values(message) for message in database.messages.values()],
        },
        allow_nan=False,
    )


def _message_values(message: Message) -> dict[str, Any]:
    values = {name: getattr(message, name) for name in _MESSAGE_FIELDS}
    values["signals"] = [_signal_values(signal) for signal in message.signals]
    return values


def _signal_values(signal: Signal) -> dict[str, Any]:
    values = {name: getattr(signal, name) for name in _SIGNAL_FIELDS}
    values["choices"] = list(signal.choices.items())  # the keys of a JSON object would become text
    return values


def database_from_json(text: str) -> Database:
    """Return the database that `database_to_json` wrote.

    Raises
    ------
    DatabaseError
        Where the text is not such an object.
    """
    try:
        values = json.loads(text)
        messages = [_message(v) for v in values["messages"]]
        return Database(
            values["source"],
            {(message.can_id, message.extended): message for message in messages},
            tuple(values["warnings"]),
            values["bit_rate"],
        )
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise DatabaseError(f"no database written as JSON: {type(error).__name__}: {error}") from error


def _message(values: dict[str, Any]) -> Message:
    return Message(**{**values, "signals": tuple(_signal(v) for v in values["signals"])})


def _signal(values: dict[str, Any]) -> Signal:
    choices = {raw: name for raw, name in values["choices"]}  # noqa: C416 (checks that they are pairs)
    ranges = tuple((first, last) for first, last in values["mux_ranges"])
    return Signal(**{**values, "choices": choices, "mux_ranges": ranges})
