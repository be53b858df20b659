"""Tables of text: CSV with commas, semicolons or tabs between the cells, and points or commas in the numbers."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hil.diagnosis.data.log import Floats, UnusableError
from hil.errors import in_words

_SAMPLE = 200
"""Rows that show the kind of numbers."""
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def read_text_table(path: Path) -> list[tuple[str, str, Floats]]:
    """Heads, units of a second row of heads (empty without one) and values (rows,) of a table of text.

    Raises
    ------
    UnusableError
        Not text, no rows, rows of different length, or numbers that can be read in two ways.
    """
    lines = _lines(path)
    at = 0
    while lines[at].startswith("#") and at + 1 < len(lines) and lines[at + 1].startswith("#"):
        at += 1
    head = lines[at].lstrip("# ").rstrip("\r\n")
    rows = [line.rstrip("\r\n") for line in lines[at + 1 :] if line.strip() and not line.startswith("#")]
    between = next((mark for mark in (";", "\t") if mark in head), ",")
    names = _cells(head, between)
    units = [""] * len(names)
    if rows and (under := _units(_cells(rows[0], between), names)) is not None:
        units, rows = under, rows[1:]
    if any('"' in row for row in rows[:_SAMPLE]):
        rows = [_unquoted(row, between) for row in rows]
    if between == ",":
        _refuse_decimal_commas(path, names, rows)
    elif _decimal_comma(path, rows, between):
        rows = [row.replace(",", ".") for row in rows]
    table = _numbers(path, rows, between, len(names))
    return [(name, unit, table[:, k]) for k, (name, unit) in enumerate(zip(names, units, strict=True))]


def _lines(path: Path) -> list[str]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UnusableError(f"{path}: cannot be read: {in_words(error)}") from error
    if b"\0" in data:
        raise UnusableError(f"{path}: not a table of text: it has zero bytes (UTF-16? save it as UTF-8)")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")  # tables of older programs: a degree sign in a head
    lines = text.splitlines()
    if not any(line.strip() for line in lines):
        raise UnusableError(f"{path}: empty file; expected a header and rows")
    return lines


def _cells(line: str, between: str) -> list[str]:
    """Cells of a row; the separator within quotes belongs to the cell."""
    outside = re.split(rf'{re.escape(between)}(?=(?:[^"]*"[^"]*")*[^"]*$)', line)
    return [cell.strip().strip('"').strip() for cell in outside]


def _units(cells: Sequence[str], names: Sequence[str]) -> list[str] | None:
    """Units that stand in a row below the heads; None where it is a row of numbers."""
    if len(cells) != len(names) or any(_NUMBER.fullmatch(cell.replace(",", ".")) for cell in cells if cell != "1"):
        return None
    bare = [cell.strip("[]()") for cell in cells]
    return bare if all(len(cell) <= 8 for cell in bare) and any(bare) and "nan" not in map(str.lower, bare) else None


def _unquoted(row: str, between: str) -> str:
    """A row without quotes; a comma within them is a decimal one where commas part the cells."""
    cells = _cells(row, between)
    return between.join(cell.replace(",", ".") for cell in cells) if between == "," else between.join(cells)


def _refuse_decimal_commas(path: Path, names: Sequence[str], rows: Sequence[str]) -> None:
    """Refuse numbers with decimal commas between commas: nothing shows which is which."""
    counts = {row.count(",") + 1 for row in rows[:_SAMPLE]}
    if len(names) > 1 and counts and min(counts) > len(names) and max(counts) <= 2 * len(names):
        raise UnusableError(
            f"{path}: {len(names)} names in the header, {min(counts)} cells in a row: are commas both decimal and "
            f"between cells (row 1: {rows[0][:60]})? Nothing shows which is which; save it with semicolons between the "
            "cells, or with decimal points"
        )


def _decimal_comma(path: Path, rows: Sequence[str], between: str) -> bool:
    """Whether the numbers of rows that no comma parts have decimal commas.

    Raises
    ------
    UnusableError
        The commas may part thousands as well, or the rows mix commas and points.
    """
    cells = [cell for row in rows[:_SAMPLE] for cell in _cells(row, between) if cell]
    commas = [cell for cell in cells if "," in cell]
    if not commas:
        return False
    odd = next((cell for cell in commas if not _COMMA.fullmatch(cell)), None)
    points = next((cell for cell in cells if "." in cell and _NUMBER.fullmatch(cell)), None)
    if odd is not None:
        raise UnusableError(f"{path}: {odd!r} is no number; expected 1234.5 or 1234,5, without marks for thousands")
    if points is not None or all(_THOUSANDS.fullmatch(cell) for cell in commas):
        beside = f" beside {points!r}" if points is not None else ""
        raise UnusableError(
            f"{path}: a comma in {commas[0]!r}{beside} may be decimal or part thousands; write the numbers with "
            "decimal points and without marks for thousands"
        )
    return True


def _numbers(path: Path, rows: Sequence[str], between: str, width: int) -> Floats:
    """(rows, columns) of numbers, NaN where a cell is none."""
    try:
        table: Floats = np.genfromtxt(rows, delimiter=between, dtype=np.float64, ndmin=2)
    except ValueError as error:
        raise UnusableError(f"{path}: rows of different length: {str(error).splitlines()[0]}") from error
    if table.size == 0 or table.shape[1] != width:
        got = table.shape[1] if table.size else 0
        raise UnusableError(f"{path}: {width} names in the header, {got} columns; expected as many")
    return table
