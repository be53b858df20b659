"""The diagnosis speaks its field's language: retired words occur in no name, docstring, comment or message of it."""

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

import hil.diagnosis

ROOM = Path(hil.diagnosis.__file__).parent
RETIRED = re.compile(
    r"\b(told|asked|begun|bent|handed in|left over|doubt|strain|strained|contests?|contenders?|odds|apart|races?"
    r"|worlds?|rigs?)\b"
)
VERDICT = "cannot_tell_apart"
"""A value in the JSON, which stays."""


def _phrases(text: str) -> Iterator[tuple[int, str]]:
    """Names, strings and comments of a module as lower-case words, with their line."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NAME:
            words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|_", " ", token.string)
        elif token.type in (tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", -1)):
            words = re.sub(r"[_#\s]+", " ", token.string)
        else:
            continue
        yield token.start[0], words.lower()


def _lines(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8").replace(VERDICT, "")
    return [f"{line}: {word}" for line, words in _phrases(text) for word in RETIRED.findall(words)]


@pytest.mark.parametrize("path", sorted(ROOM.rglob("*.py")), ids=lambda path: path.relative_to(ROOM).as_posix())
def test_no_retired_word(path: Path) -> None:
    assert not _lines(path)


def test_words_in_names_strings_and_comments_are_seen_and_parts_of_words_are_not() -> None:
    text = 'told_by = OurRig  # handed  in\nf"""a\n  contender"""\ntrace, brigade, grace = "apartment", "forebent", 1\n'
    seen = [word for _, words in _phrases(text) for word in RETIRED.findall(words)]
    assert seen == ["told", "rig", "handed in", "contender"]
