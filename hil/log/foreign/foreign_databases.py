"""ARXML, KCD and SYM behind the fence: read there, and sent as JSON."""

import importlib
from collections.abc import Iterator
from pathlib import Path

from dbc.database import sniff_database
from dbc.database_json import database_to_json
from dbc.database_values import DatabaseError
from dbc.foreign_database import parse_foreign
from hil.log.frames import LogError

_PIECE = 1 << 20


def warm() -> None:
    """Load the readers, which counts for no limit."""
    for name in ("canmatrix.formats", "cantools"):
        try:
            importlib.import_module(name)
        except ImportError:
            continue


def database_json(path: Path) -> Iterator[bytes]:
    """Yield a database as JSON text.

    Raises
    ------
    LogError
        When no reader takes it.
    """
    content = path.read_bytes()
    try:
        text = database_to_json(parse_foreign(content, path.name, sniff_database(content))).encode()
    except DatabaseError as error:
        raise LogError(path, str(error)) from error
    for begin in range(0, len(text), _PIECE):
        yield text[begin : begin + _PIECE]
