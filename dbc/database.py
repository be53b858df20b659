"""Anybody's database as plain values for a decoder, with everything odd about it as warnings."""

import re

from dbc.database_values import Database, DatabaseError, Message, Signal, Warnings, shown
from dbc.dbc_messages import DbcMessages
from dbc.dbc_text import DbcText
from dbc.text_encoding import cleaned, decoded

__all__ = ["MAX_TEXT_BYTES", "Database", "DatabaseError", "Message", "Signal", "parse_database", "sniff_database"]

MAX_TEXT_BYTES = 16 * 1024 * 1024
MAX_SNIFFED = 64 * 1024  # bytes from the begin of a file that show what it is

_ROOT = re.compile(r"<(?:[A-Za-z_][\w.-]{0,40}:)?([A-Za-z_][\w.-]{0,60})")
_DBC = re.compile(r"^[ \t]*+(?:VERSION\b|NS_|BS_|BU_|BO_|CM_|BA_)", re.MULTILINE)
_SYM = re.compile(r"^[ \t]*+FormatVersion[ \t]*+=", re.MULTILINE | re.IGNORECASE)


def sniff_database(content: bytes | str) -> str:
    """Tell which kind of database a file is, by its content: "dbc", "arxml", "kcd" or "sym".

    Raises
    ------
    DatabaseError
        Where it is none of them; the message shows how it begins.
    """
    head = content[:MAX_SNIFFED]
    text = (decoded(head, []) if isinstance(head, bytes) else cleaned(head, [])).lstrip("\ufeff \t\r\n")
    if text.startswith("<"):
        root = _ROOT.search(_without_comments(text))
        kind = {"AUTOSAR": "arxml", "NetworkDefinition": "kcd"}.get(root[1] if root else "")
        if kind:
            return kind
        seen = f"XML with the root element {shown(root[1])!r}" if root else "XML without a root element"
        raise DatabaseError(f"{seen}; expected AUTOSAR (ARXML) or NetworkDefinition (KCD), or a DBC or SYM file")
    if _SYM.search(text):
        return "sym"
    if _DBC.search(text):
        return "dbc"
    begin = shown((text[:200].splitlines() or ["nothing"])[0])
    raise DatabaseError(f"it begins with {begin!r}; expected a Vector DBC, an ARXML, KCD or PEAK SYM file")


def _without_comments(text: str) -> str:
    return re.sub(r"<!--.*?(?:-->|\Z)|<\?.*?(?:\?>|\Z)", "", text, flags=re.DOTALL)


def parse_database(content: bytes | str, source: str = "database") -> Database:
    """Read a DBC; what is sound is loaded, what is not becomes a warning that names its line.

    Parameters
    ----------
    content : the file's bytes (UTF-8, else Windows-1252 or what else they look like) or its text.
    source : what messages call it, usually the file's name.

    Raises
    ------
    DatabaseError
        When it is too large or holds no message that can be used.
    """
    if len(content) > MAX_TEXT_BYTES:
        raise DatabaseError(f"{source}: {len(content)} bytes; a DBC of at most {MAX_TEXT_BYTES} bytes is read")
    notes: list[str] = []
    text = cleaned(content, notes) if isinstance(content, str) else decoded(content, notes)
    warnings = Warnings(text)
    read = DbcText(text, warnings)
    if not read.drafts:
        begin = shown((text.lstrip()[:200].splitlines() or ["nothing"])[0])
        raise DatabaseError(f"{source}: no message in it; expected a Vector DBC with BO_ lines, got {begin!r}")
    build = DbcMessages(read, warnings)
    messages = build.messages()
    bit_rate = build.bit_rate()
    said = (*notes, *warnings.lines())
    if not messages:
        why = said[0] if said else "they hold only signals of no message"
        raise DatabaseError(f"{source}: none of its {len(read.drafts)} messages can be used: {why}")
    return Database(source, messages, said, bit_rate)
