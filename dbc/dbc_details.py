"""What a DBC says about its messages and signals outside ``BO_`` and ``SG_``: value names, attributes, comments, ..."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field

from dbc.database_values import Warnings, shown
from dbc.dbc_scan import Statement

_TOKEN = re.compile(r'"|[^\s":,]++')
_RANGE = re.compile(r"([0-9]{1,20})\s*+-\s*+([0-9]{1,20})", re.ASCII)
_WHOLE = re.compile(r"-?[0-9]{1,20}", re.ASCII)
_DECIMAL = re.compile(r"[-+]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][-+]?[0-9]{1,9})?", re.ASCII)
_MAX_NUMBER = 400  # digits: more than the longest way to write a double without an exponent
# Vector's own order of VFrameFormat, which holds where the attribute is no ENUM of the file.
_FRAME_FORMATS = (
    "StandardCAN", "ExtendedCAN", "reserved", "J1939PG", *["reserved"] * 10, "StandardCAN_FD", "ExtendedCAN_FD",
)  # fmt: skip

Owner = tuple[int, str]  # (identifier as in the file, signal name); "" is the message itself, DATABASE the database
DATABASE: Owner = (-1, "")


def number(text: str) -> float | None:
    """Return a decimal number (int where it is written as one that 64 bits hold), None where the text is none."""
    if len(text) > _MAX_NUMBER or not _DECIMAL.fullmatch(text):
        return None
    return int(text) if len(text) <= 20 and text.lstrip("+-").isdigit() else float(text)


@dataclass(slots=True)
class Named:
    """A thing said of a message or signal, and where it stands in the text."""

    position: int
    values: dict[int, str]
    table: str = ""  # name of the value table, where one is named instead


@dataclass(slots=True)
class MuxRule:
    """One ``SG_MUL_VAL_``: which multiplexer selects a signal, with which raw values."""

    position: int
    multiplexer: str
    ranges: list[tuple[int, int]]


@dataclass(slots=True)
class Details:
    """All that stands outside the messages, by (identifier, signal name) as they are written in the file."""

    warnings: Warnings
    values: dict[Owner, Named] = field(default_factory=dict)
    tables: dict[str, dict[int, str]] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)  # signal type -> value table
    value_types: dict[Owner, tuple[int, int]] = field(default_factory=dict)  # position, SIG_VALTYPE_ number
    mux: dict[Owner, MuxRule] = field(default_factory=dict)
    comments: dict[Owner, str] = field(default_factory=dict)
    attributes: dict[Owner, dict[str, str]] = field(default_factory=dict)
    nodes: dict[str, str] = field(default_factory=dict)  # short name -> long name
    long_names: dict[Owner, str] = field(default_factory=dict)
    defaults: dict[str, str] = field(default_factory=dict)
    enums: dict[str, list[str]] = field(default_factory=dict)
    senders: dict[int, str] = field(default_factory=dict)  # identifier -> first additional sender

    def take(self, statement: Statement) -> None:
        """Read one statement; those that say nothing a decoder needs are passed over."""
        reader = _READERS.get(statement.keyword)
        if reader is None:
            return
        try:
            reader(self, statement, _TOKEN.findall(statement.skeleton)[1:])
        except (IndexError, ValueError):
            begin = shown(" ".join(statement.skeleton.split()))
            self.warnings.add(statement.position, f"{begin!r}: statement cannot be read; left out")

    def attribute(self, name: str, owner: Owner = DATABASE) -> str | None:
        """Return an attribute of a message, signal or the database, else the default, else None."""
        return self.attributes.get(owner, {}).get(name, self.defaults.get(name))

    def _comment(self, s: Statement, tokens: list[str]) -> None:
        if tokens[0] in ("SG_", "BO_"):
            owner = (int(tokens[1]), tokens[2] if tokens[0] == "SG_" else "")
            if not s.strings:
                raise ValueError
            self.comments[owner] = s.quoted  # quotation marks inside that nobody escaped split it into several strings

    def _values(self, s: Statement, tokens: list[str]) -> None:
        if not _WHOLE.fullmatch(tokens[0]):
            return  # of an environment variable
        owner = int(tokens[0]), tokens[1]
        rest = tokens[2:]
        if len(rest) == 1 and rest[0] != '"' and not _WHOLE.fullmatch(rest[0]):
            self.values[owner] = Named(s.position, {}, rest[0])
        elif rest:
            self.values[owner] = Named(s.position, self._names(s, rest, f"VAL_ of {owner[0]} {shown(owner[1])}"))

    def _table(self, s: Statement, tokens: list[str]) -> None:
        self.tables[tokens[0]] = self._names(s, tokens[1:], f"VAL_TABLE_ {shown(tokens[0])}")

    def _names(self, s: Statement, tokens: list[str], where: str) -> dict[int, str]:
        named: dict[int, str] = {}
        strings = iter(s.strings)
        raw: int | None = None
        odd: str | None = None
        for token in tokens:
            if token == '"':
                text = next(strings)
                if raw is None:
                    odd = odd or text
                else:
                    named[raw] = text
                raw = None
            else:
                odd = odd or (None if raw is None else str(raw))
                value = number(token)
                whole = value is not None and math.isfinite(value) and value == int(value)
                raw = int(value) if whole and value is not None else None
                odd = odd or (None if whole else token)
        if odd is not None:
            self.warnings.add(s.position, f"{where}: {shown(odd)!r} is no pair of a number and a text; left out")
        return named

    def _value_type(self, s: Statement, tokens: list[str]) -> None:
        self.value_types[int(tokens[0]), tokens[1]] = s.position, int(tokens[2])

    def _multiplexing(self, s: Statement, tokens: list[str]) -> None:
        ranges = [(int(a), int(b)) for a, b in _RANGE.findall(" ".join(tokens[3:]))]
        if not ranges or any(a > b for a, b in ranges):
            raise ValueError
        self.mux[int(tokens[0]), tokens[1]] = MuxRule(s.position, tokens[2], ranges)

    def _attribute_value(self, s: Statement, tokens: list[str]) -> None:
        name, strings = s.strings[0], s.strings[1:]
        words = tokens[1:]
        kind = words[0]
        value = words[{"BU_": 2, "BO_": 2, "EV_": 2, "SG_": 3}.get(kind, 0)]
        value = strings[0] if value == '"' else value
        if kind == "BU_":
            if name == "SystemNodeLongSymbol":
                self.nodes[words[1]] = value
        elif kind != "EV_":
            owner = (int(words[1]), words[2] if kind == "SG_" else "") if kind in ("BO_", "SG_") else DATABASE
            if kind and name == ("SystemSignalLongSymbol" if kind == "SG_" else "SystemMessageLongSymbol"):
                self.long_names[owner] = value
            self.attributes.setdefault(owner, {})[name] = value

    def _definition(self, s: Statement, tokens: list[str]) -> None:
        if "ENUM" in tokens:
            self.enums[s.strings[0]] = s.strings[1:]

    def _default(self, s: Statement, tokens: list[str]) -> None:
        self.defaults[s.strings[0]] = s.strings[1] if len(s.strings) > 1 else tokens[1]

    def _signal_type(self, s: Statement, tokens: list[str]) -> None:
        if len(tokens) == 3 and _WHOLE.fullmatch(tokens[0]):  # SGTYPE_ 12 Signal : Type;
            owner = int(tokens[0]), tokens[1]
            self.attributes.setdefault(owner, {})["SGTYPE_"] = tokens[2]
        elif len(tokens) > 3 and not _WHOLE.fullmatch(tokens[-1]):  # SGTYPE_ Type : 8@1+ (1,0) [0|0] "" 0, Table;
            self.types[tokens[0]] = tokens[-1]

    def _sender(self, s: Statement, tokens: list[str]) -> None:
        self.senders.setdefault(int(tokens[0]), tokens[1])

    def choices(self, owner: Owner) -> dict[int, str]:
        """Return the value names of a signal: its own, else those of the value table of its type."""
        named = self.values.get(owner)
        if named is not None and not named.table:
            return named.values
        table = named.table if named else self.types.get(self.attributes.get(owner, {}).get("SGTYPE_", ""), "")
        if table and table not in self.tables:
            at = named.position if named else None
            self.warnings.add(at, f"signal {shown(owner[1])}: there is no value table {shown(table)}")
        return self.tables.get(table, {})

    def numeric_attribute(self, name: str, owner: Owner = DATABASE) -> float | None:
        """Return an attribute that is a number, None where there is none."""
        text = self.attribute(name, owner)
        if text is None:
            return None
        value = number(text.strip())
        if value is None or not math.isfinite(value):
            of = "the database" if owner == DATABASE else f"message {owner[0]}"
            self.warnings.add(None, f"attribute {name} of {of}: {shown(text)!r} is no number; left out")
            return None
        return value

    def frame_format(self, owner: Owner) -> str:
        """Return the frame format that a message states or else has by default, "" where neither is."""
        text = self.attribute("VFrameFormat", owner) or ""
        if _WHOLE.fullmatch(text):
            names = self.enums.get("VFrameFormat") or _FRAME_FORMATS
            return names[int(text)] if 0 <= int(text) < len(names) else ""
        return text


_READERS: dict[str, Callable[[Details, Statement, list[str]], None]] = {
    "CM_": Details._comment,
    "VAL_": Details._values,
    "VAL_TABLE_": Details._table,
    "SIG_VALTYPE_": Details._value_type,
    "SG_MUL_VAL_": Details._multiplexing,
    "BA_": Details._attribute_value,
    "BA_DEF_": Details._definition,
    "BA_DEF_DEF_": Details._default,
    "SGTYPE_": Details._signal_type,
    "SIG_TYPE_REF_": Details._signal_type,
    "BO_TX_BU_": Details._sender,
}
