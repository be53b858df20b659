"""A DBC's text as statements, in one pass: no place of the text is looked at more than a few times.

A statement begins with a keyword outside strings and ends at its semicolon, or where the next one begins; ``BO_`` and
``SG_`` have no semicolon. What is not closed (a string, a statement) ends at its line or at the next statement, so that
it costs no other one.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from dbc.database_values import Warnings, shown

KEYWORDS = (
    "BA_DEF_DEF_REL_", "BA_DEF_DEF_", "BA_DEF_REL_", "BA_DEF_SGTYPE_", "BA_DEF_", "BA_REL_", "BA_SGTYPE_", "BA_",
    "BO_TX_BU_", "BO_", "CAT_DEF_", "CAT_", "CM_", "ENVVAR_DATA_", "EV_DATA_", "NS_", "SGTYPE_VAL_",
    "SGTYPE_", "SG_MUL_VAL_", "SG_", "SIGTYPE_VALTYPE_", "SIG_GROUP_", "SIG_TYPE_REF_", "SIG_VALTYPE_", "VAL_TABLE_",
    "VAL_",
)  # fmt: skip
_EVENT = re.compile('"|;|//|' + "|".join(rf"{word}\b" for word in KEYWORDS), re.ASCII)
_BEFORE = frozenset(" \t\r\n\v\f;")  # what may stand directly before a keyword
_NEW_SYMBOLS = re.compile(r"\s*+:?(?:[ \t\r\n]*+[A-Z_]++[ \t\r]*+(?=\n))*+", re.ASCII)
_DEFINITION = re.compile(r"BO_\s++[0-9]++\s++[^\s:\"]++\s*+:|SG_\s++[^\s:\"]++\s*+(?:[^\s:\"]++\s*+)?+:")

_CLOSED = re.compile(r'"(?:[^"\\\n]++|\\"?+)*+"')
_CLOSED_PLAIN = re.compile(r'"[^"\n]*+"(?=\s*+(?:[;,]|-?[0-9]|$))')
_CLOSED_UNIT = re.compile(r'"[^"\n]*+"')
_CLOSED_LATER = re.compile(r'"(?:[^"\\]++|\\"?+)*+"')
_GOES_ON = re.compile(r"\s*+(?:[;,]|-?[0-9]|$)")

_NUMBER = r"\s*+([-+.0-9eE]{1,400}+)\s*+"
_MESSAGE = re.compile(
    rf"BO_\s++([0-9]{{1,20}}+)\s++(\w++)\s*+:\s*+([0-9]{{1,9}}+)(?:\s++(?!(?:{'|'.join(KEYWORDS)})\b)(\w++))?", re.ASCII
)
_SIGNAL = re.compile(
    r"SG_\s++(\w++)\s*+(?:(m[0-9]{1,9}+M?|M)\s*+)?:\s*+([0-9]{1,6}+)\s*+\|\s*+([0-9]{1,6}+)\s*+@\s*+([01])\s*+([+-])"
    rf"\s*+\({_NUMBER},{_NUMBER}\)\s*+\[{_NUMBER}\|{_NUMBER}\]\s*+" + r'"([^"\\\n]*+)"',
    re.ASCII,
)


class SignalText(NamedTuple):
    """A sound ``SG_`` statement as it stands in the text; ``position`` is its place there."""

    position: int
    name: str
    marker: str | None
    start: str
    length: str
    order: str
    sign: str
    factor: str
    offset: str
    minimum: str
    maximum: str
    unit: str


class MessageText(NamedTuple):
    """A sound ``BO_`` statement as it stands in the text; ``position`` is its place there."""

    position: int
    key: str
    name: str
    length: str
    sender: str


@dataclass(slots=True)
class Statement:
    """Any other statement.

    Attributes
    ----------
    keyword, position : its first word, and where that stands in the text.
    skeleton : its text with each string replaced by a single quotation mark, without the semicolon.
    strings : the strings' contents, escaped quotation marks resolved.
    quoted : everything from the first to the last quotation mark.
    """

    keyword: str
    position: int
    skeleton: str
    strings: list[str]
    quoted: str


class Scanner:
    """Cuts a text into statements."""

    def __init__(self, text: str, warnings: Warnings) -> None:
        self._text = text
        self._warnings = warnings
        self._no_close_before = 0  # a string that begins before this place does not close on a later line
        self._keyword = ""  # of the statement being read; "" between statements
        self._position = self._segment = 0
        self._pieces: list[str] = []
        self._strings: list[str] = []
        self._quoted = (0, 0)  # behind the first, and before the last quotation mark

    def statements(self) -> Iterator[SignalText | MessageText | Statement]:
        """Yield the statements in the text's order."""
        text, find, signal = self._text, _EVENT.search, _SIGNAL.match
        position = 0
        while event := find(text, position):
            at, position = event.span()
            word = event[0]
            if word == "SG_" and self._keyword in ("", "SG_", "BO_") and (at == 0 or text[at - 1] in _BEFORE):
                if self._keyword:
                    yield self._ended(at)
                found = signal(text, at)
                if found:
                    yield SignalText(at, *found.groups())
                    position = found.end()
                else:
                    self._begin(word, at)
            elif word == '"':
                position = self._string(at)
            elif word == "//":
                position = self._line_end(at)
                if self._keyword:
                    self._pieces.append(text[self._segment : at])
                    self._segment = position
            elif word == ";":
                if self._keyword:
                    yield self._ended(at)
            elif at == 0 or text[at - 1] in _BEFORE:
                if self._keyword:
                    if (
                        word in ("SG_", "BO_")
                        and self._keyword not in ("SG_", "BO_")
                        and not _DEFINITION.match(text, at)
                    ):
                        continue  # an argument: BA_ "..." BO_ 12 ...
                    if self._keyword not in ("SG_", "BO_"):
                        self._warnings.add(self._position, f"{self._keyword} statement without ';'")
                    yield self._ended(at)
                if word == "NS_":
                    symbols = _NEW_SYMBOLS.match(text, position)
                    position = symbols.end() if symbols else position
                elif word == "BO_" and (message := _MESSAGE.match(text, at)):
                    yield MessageText(at, message[1], message[2], message[3], message[4] or "")
                    position = message.end()
                else:
                    self._begin(word, at)
        if self._keyword:
            if self._keyword not in ("SG_", "BO_"):
                self._warnings.add(self._position, f"{self._keyword} statement without ';'")
            yield self._ended(len(text))

    def _begin(self, keyword: str, at: int) -> None:
        self._keyword = keyword
        self._position = self._segment = at
        self._pieces = []
        self._strings = []
        self._quoted = (0, 0)  # behind the first, and before the last quotation mark

    def _ended(self, at: int) -> Statement:
        self._pieces.append(self._text[self._segment : at])
        keyword, self._keyword = self._keyword, ""
        quoted = self._text[self._quoted[0] : self._quoted[1]] if len(self._strings) > 1 else "".join(self._strings)
        return Statement(keyword, self._position, "".join(self._pieces), self._strings, quoted)

    def _line_end(self, at: int) -> int:
        end = self._text.find("\n", at)
        return len(self._text) if end < 0 else end

    def _string(self, at: int) -> int:
        """Take the string that opens at a place; return the place behind it."""
        text = self._text
        # A backslash may be meant as one, even before the quotation mark that closes.
        plain = _CLOSED_UNIT if self._keyword in ("SG_", "BO_") else _CLOSED_PLAIN
        found = _CLOSED.match(text, at) or self._on_later_lines(at) or plain.match(text, at)
        if found:
            end = found.end()
            content = text[at + 1 : end - 1]
        else:
            end = self._line_end(at)
            content = text[at + 1 : end].rstrip().removesuffix(";").rstrip().removesuffix('"')
            self._warnings.add(at, f"string never closed: {shown(content)!r}")
        if self._keyword:
            self._pieces += (text[self._segment : at], ' " ')
            self._segment = end
            self._strings.append(content.replace('\\"', '"'))
            self._quoted = (at + 1 if len(self._strings) == 1 else self._quoted[0], end - 1)
        return end

    def _on_later_lines(self, at: int) -> re.Match[str] | None:
        """Match a string over several lines, where what follows it shows that it is one.

        The opening quotation mark of a later statement closes a string that was never closed; what follows that one is
        a name. No place is searched twice: a search that failed holds for all the text it saw.
        """
        if self._keyword in ("", "SG_", "BO_") or at < self._no_close_before:
            return None
        found = _CLOSED_LATER.match(self._text, at)
        if found is None:
            self._no_close_before = len(self._text)
        elif not _GOES_ON.match(self._text, found.end()):
            self._no_close_before = found.end() - 1
            found = None
        return found
