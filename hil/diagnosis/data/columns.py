"""Columns of a table as its file has them, by name; a name that stands twice is refused where it is used."""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from hil.diagnosis.data.log import Floats, UnusableError

_WITH_UNIT = re.compile(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*")


@dataclass(frozen=True, eq=False)
class Column:
    """Values (rows,) of a column and its unit, empty where the file gives none.

    ``own_t_s`` and ``own_values`` (n,) are its samples as they came, s, where it has stamps of its own.
    """

    values: Floats
    unit: str = ""
    own_t_s: Floats | None = None
    own_values: Floats | None = None


def with_unit(head: str, unit: str = "") -> tuple[str, str]:
    """Name and unit of a head: the unit stands in brackets after the name, or is ``unit``."""
    match = _WITH_UNIT.fullmatch(head)
    return (match[1], unit or match[2]) if match else (head, unit)


def by_name(where: str, columns: Iterable[tuple[str, Column]], used: Collection[str]) -> dict[str, Column]:
    """Columns by name.

    Raises
    ------
    UnusableError
        A name among those ``used`` stands at several columns.
    """
    found: dict[str, list[tuple[int, Column]]] = {}
    for number, (name, column) in enumerate(columns, 1):
        found.setdefault(name, []).append((number, column))
    twice = {name: [number for number, _ in same] for name, same in found.items() if len(same) > 1 and name in used}
    if twice:
        places = "; ".join(f"{name} at columns {', '.join(map(str, numbers))}" for name, numbers in twice.items())
        raise UnusableError(
            f"{where}: the same head stands over several columns: {places}; rename or drop all but one of each"
        )
    return {name: same[-1][1] for name, same in found.items()}
