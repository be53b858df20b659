"""Reads the file of a database: DBC here, what foreign readers take behind the fence."""

from dataclasses import replace
from pathlib import Path

from dbc.database import Database, DatabaseError, parse_database, sniff_database
from dbc.database_json import database_from_json
from hil.errors import BrakebenchError
from hil.log.frames import LogError

MAX_BYTES = 256 * 1024 * 1024  # ARXML files of whole cars are large


def read_database(path: Path) -> Database:
    """Read a DBC, ARXML, KCD or SYM file, told by its content.

    Raises
    ------
    BrakebenchError
        When it cannot be opened, or is no database that can be used.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise BrakebenchError(f"{path}: cannot be opened: {error.strerror or error}; give a database file") from error
    if len(content) > MAX_BYTES:
        raise BrakebenchError(f"{path}: more than {MAX_BYTES // 1024**2} MiB; no database is that large")
    try:
        kind = sniff_database(content)
        if kind == "dbc":
            return parse_database(content, str(path))
        from hil.log.foreign.fence import fenced_bytes

        pieces = fenced_bytes("hil.log.foreign.foreign_databases:database_json", path, f"{kind.upper()} reader")
        return replace(database_from_json(b"".join(pieces).decode()), source=str(path))
    except LogError as error:
        raise BrakebenchError(str(error)) from error
    except DatabaseError as error:
        text = str(error)
        raise BrakebenchError(text if text.startswith(str(path)) else f"{path}: {text}") from error
