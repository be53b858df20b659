"""Aligned columns of text that fit the width they are given."""

import os
import shutil
import textwrap
from collections.abc import Iterable, Sequence

from hil.log.account import printable

LEAST_WIDTH, MOST_WIDTH = 60, 160
LEAST_NAME = 8


def terminal_width() -> int:
    """Letters of a line: those of the terminal (or of COLUMNS); the most without one: pipes want whole names."""
    return max(LEAST_WIDTH, min(MOST_WIDTH, shutil.get_terminal_size((MOST_WIDTH, 24)).columns))


def say(lines: Iterable[str]) -> None:
    """Print lines; a reader of the output that has left (``| head``) changes nothing of what the command returns."""
    try:
        print("\n".join(lines), flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def cut(text: str, width: int) -> str:
    """Text of at most ``width`` letters; ``~`` stands for what is left out before the end, which tells the most."""
    if len(text) <= width:
        return text
    behind = max(0, width - 1) * 2 // 3
    return text[: max(0, width - 1) - behind] + "~" + text[len(text) - behind :]


def columns(heads: Sequence[str], rows: Sequence[Sequence[str]], width: int, left: Sequence[int] = (0,)) -> list[str]:
    """Lines of a table, two spaces between columns; what is too wide is taken from the widest left column.

    Parameters
    ----------
    heads : a column without any entry is left out, and so is its head.
    left : columns that are aligned on the left: names; the others are numbers.
    """
    used = [k for k in range(len(heads)) if any(row[k] for row in rows)]
    shown = [[printable(row[k]) for k in used] for row in [heads, *rows]]
    widths = [max(len(row[k]) for row in shown) for k in range(len(used))]
    names = [k for k, column in enumerate(used) if column in left]
    over = sum(widths) + 2 * (len(widths) - 1) - width
    while over > 0 and names:
        k = max(names, key=lambda name: widths[name])
        others = max((widths[name] for name in names if name != k), default=LEAST_NAME)
        take = min(over, max(1, widths[k] - max(others, LEAST_NAME)))
        if widths[k] - take < LEAST_NAME:
            break
        widths[k] -= take
        over -= take
    lines = []
    for row in shown:
        cells = [
            cut(cell, widths[k]).ljust(widths[k]) if k in names else cell.rjust(widths[k]) for k, cell in enumerate(row)
        ]
        lines.append("  ".join(cells).rstrip())
    return lines


def wrapped(text: str, width: int, indent: str = "  ") -> list[str]:
    """Lines of a note, safe on a terminal, broken between words, further lines indented."""
    text = printable(text)
    line = text[: len(text) - len(text.lstrip())]
    lines: list[str] = []
    for word in text.split():
        if line.strip() and len(line) + 1 + len(word) > width:
            lines.append(line)
            line = indent + word
        else:
            line = f"{line} {word}" if line.strip() else line + word
    return [*lines, line]


def listing(rows: Sequence[Sequence[str]], width: int) -> list[str]:
    """Lines of a list: columns aligned on the left, the last one broken between words below itself.

    Where the others leave it less than a third of ``width``, it stands on lines of its own.
    """
    sizes = [max(len(row[k]) for row in rows) for k in range(len(rows[0]) - 1)]
    lead = sum(sizes) + 2 * len(sizes)
    indent = lead if 3 * (width - lead) >= width else 4
    lines = []
    for row in rows:
        head = "  ".join(cell.ljust(size) for cell, size in zip(row, sizes, strict=False))
        told = textwrap.wrap(printable(row[-1]), width - indent, break_on_hyphens=False) or [""]
        if indent == lead:
            lines.append(f"{head}  {told.pop(0)}".rstrip())
        else:
            lines.append(head.rstrip())
        lines += [" " * indent + line for line in told]
    return lines
