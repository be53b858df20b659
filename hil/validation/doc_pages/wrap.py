"""Prose of the generated pages in lines of at most 120 characters."""

from collections.abc import Iterable
from textwrap import wrap

_WIDTH = 120


def markdown(lines: Iterable[str]) -> str:
    """Lines of Markdown as one text; long ones of prose and of lists are wrapped, tables, headings and code stay."""
    out: list[str] = []
    code = False
    for line in "\n".join(lines).split("\n"):
        code ^= line.startswith("```")
        if code or len(line) <= _WIDTH or line.startswith(("|", "#", "```")):
            out.append(line)
        else:
            indent = "  " if line.startswith(("- ", "  ")) else ""
            out += wrap(line, _WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return "\n".join(out) + "\n"
