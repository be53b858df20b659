"""The tables of a scenario file: typed reading that names file and key, and refuses what nobody asked for."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources.abc import Traversable
from itertools import pairwise
from pathlib import Path
from typing import Any

from hil.errors import BrakebenchError, unknown_keys
from hil.scenario.parameters import is_number
from hil.scenario.waveforms import GENERATORS, Points
from plant.manoeuvre import Trace

MOST_POINTS = 1_000_000


class ScenarioError(BrakebenchError):
    """A scenario that cannot be used as it is; the message names file and key."""


@dataclass(frozen=True, slots=True)
class Files:
    """Where files named by a scenario lie, and the contents of those that were read."""

    folder: Path | Traversable
    read: list[bytes] = field(default_factory=list)


def as_number(value: Any) -> float | None:
    """A finite float, or None where the value is no such number."""
    return float(value) if is_number(value) else None


class Table:
    """A TOML table that knows where it stands and refuses keys nobody asked for.

    Parameters
    ----------
    values : the table.
    where : file and table, for messages.
    files : where CSV traces lie.
    """

    def __init__(self, values: Any, where: str, files: Files) -> None:
        if not isinstance(values, Mapping):
            raise ScenarioError(f"{where}: expected a table, got {values!r}")
        self._values = dict(values)
        self._where = where
        self._files = files
        self._known: list[str] = []

    @property
    def where(self) -> str:
        """File and table, for messages."""
        return self._where

    def take(self, key: str, default: Any = None) -> Any:
        """Value as it stands in the file."""
        self._known.append(key)
        return self._values.pop(key, default)

    def has(self, key: str) -> bool:
        """Whether the file has the key (and it was not taken yet)."""
        return key in self._values

    def peek(self, key: str) -> Any:
        """Value as it stands in the file, still to be taken; None where there is none."""
        return self._values.get(key)

    def number(self, key: str, default: float | None, low: float = -math.inf, high: float = math.inf) -> float:
        """A finite number within limits; ``default`` None demands one."""
        if default is not None and not self.has(key):
            self._known.append(key)
            return default
        value = self.take(key)
        number = as_number(value)
        if number is None or not low <= number <= high:
            limits = f" from {low:g} to {high:g}" if math.isfinite(low) or math.isfinite(high) else ""
            raise ScenarioError(f"{self.at(key)}: expected a number{limits}, got {shown(value)}")
        return number

    def switch(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.take(key, default)
        if not isinstance(value, bool):
            raise ScenarioError(f"{self.at(key)}: expected true or false, got {shown(value)}")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """One line of text, not empty."""
        value = self.take(key, default)
        if not isinstance(value, str) or not value.strip() or not value.isprintable():
            raise ScenarioError(f"{self.at(key)}: expected a line of text, got {shown(value)}")
        return value

    def choice(self, key: str, allowed: Sequence[str]) -> str:
        """One of some names."""
        value = self.take(key)
        if value not in allowed:
            raise ScenarioError(f"{self.at(key)}: expected one of {', '.join(allowed)}, got {shown(value)}")
        return str(value)

    def names(self, key: str, allowed: Sequence[str]) -> list[str]:
        """Some of some names, none twice; empty where the file does not say."""
        value = self.take(key, [])
        if not isinstance(value, list) or any(v not in allowed for v in value) or len(set(value)) < len(value):
            raise ScenarioError(f"{self.at(key)}: expected a list out of {', '.join(allowed)}, got {shown(value)}")
        return [str(v) for v in value]

    def table(self, key: str) -> "Table":
        """A table within; empty where the file has none."""
        return Table(self.take(key, {}), self.at(key), self._files)

    def tables(self, key: str) -> list["Table"]:
        """A list of tables."""
        values = self.take(key, [])
        if not isinstance(values, list):
            raise ScenarioError(f"{self.at(key)}: expected a list of tables ([[{key}]]), got {shown(values)}")
        return [Table(value, f"{self.at(key)}[{i}]", self._files) for i, value in enumerate(values)]

    def trace(self, key: str, low: float = -math.inf, high: float = math.inf) -> Trace:
        """A course over time: ``[[time_s, value], ...]``, ``{ csv = "FILE" }`` or ``{ GENERATOR = {...} }``."""
        value = self.take(key, [])
        points = self._made(key, value) if isinstance(value, Mapping) else self._listed(key, value)
        for (t0, _), (t1, _) in pairwise(points):
            if t1 < t0:
                raise ScenarioError(f"{self.at(key)}: times must not decrease, but {t1:g} s follows {t0:g} s")
        for time, number in points:
            if not low <= number <= high:
                raise ScenarioError(
                    f"{self.at(key)}: expected values from {low:g} to {high:g}, got {number:g} at {time:g} s"
                )
        return points

    def _listed(self, key: str, value: Any) -> Trace:
        pairs = value if isinstance(value, list) else [None]
        numbers = [[as_number(v) for v in p] if isinstance(p, list) else [] for p in pairs]
        if any(len(p) != 2 or None in p for p in numbers):
            raise ScenarioError(
                f'{self.at(key)}: expected a list of [time_s, value] pairs, {{ csv = "FILE" }} or one of '
                f"{', '.join(GENERATORS)}, got {shown(value)}"
            )
        return tuple((p[0] or 0.0, p[1] or 0.0) for p in numbers)

    def _made(self, key: str, value: Mapping[str, Any]) -> Trace:
        names = ("csv", *GENERATORS)
        kinds = [name for name in names if name in value]
        table = Table(value, self.at(key), self._files)
        if len(kinds) != 1:
            raise ScenarioError(f"{self.at(key)}: expected one of {', '.join(names)}, got {shown(list(value))}")
        if kinds[0] == "csv":
            points = self._csv(table)
        else:
            generator = GENERATORS[kinds[0]]
            inner = table.table(kinds[0])
            arguments = {p.name: inner.number(p.name, p.default, p.low, p.high) for p in generator.parameters}
            inner.done()
            try:
                points = generator.make(**arguments)
            except ValueError as error:
                raise ScenarioError(f"{inner._where}: {error}") from error
        table.done()
        if len(points) > MOST_POINTS:
            raise ScenarioError(f"{self.at(key)}: {len(points)} points; at most {MOST_POINTS}, make it shorter")
        return points

    def _csv(self, table: "Table") -> Points:
        """Columns ``time_s`` and ``value`` (or those named) of a file beside the scenario."""
        name = table.text("csv")
        column = table.text("column", "value")
        where = f"{table._where}: {name}"
        try:
            raw = (self._files.folder / name).read_bytes()
            text = raw.decode("utf-8-sig")
        except OSError as error:
            raise ScenarioError(
                f"{where}: cannot be read ({error.strerror}); it is looked for beside the scenario"
            ) from error
        except UnicodeDecodeError as error:
            raise ScenarioError(f"{where}: not UTF-8 text: {error}") from error
        self._files.read.append(raw)
        points: list[tuple[float, float]] = []
        try:
            rows = csv.DictReader(io.StringIO(text), strict=True)
            heads = rows.fieldnames or []
            missing = [head for head in ("time_s", column) if head not in heads]
            if missing:
                raise ScenarioError(
                    f"{where}: no column {missing[0]!r}; it has {', '.join(map(repr, heads)) or 'none'}"
                )
            for row in rows:
                time, number = (_cell(row[head]) for head in ("time_s", column))
                if time is None or number is None:
                    cells = f"{row['time_s']!r} and {row[column]!r}"
                    raise ScenarioError(f"{where}, line {rows.line_num}: expected two numbers, got {cells}")
                points.append((time, number))
        except csv.Error as error:
            raise ScenarioError(f"{where}: not a CSV file: {error}") from error
        if not points:
            raise ScenarioError(f"{where}: has no rows")
        return tuple(points)

    def rest(self) -> dict[str, Any]:
        """Whatever has not been asked for; the caller checks it."""
        values, self._values = self._values, {}
        return values

    def at(self, key: str) -> str:
        """File and key, for messages."""
        return f"{self._where}: {key}" if self._where.endswith(".toml") else f"{self._where}.{key}"

    def done(self) -> None:
        """Refuse what is left over."""
        if odd := unknown_keys(self._values, set(self._known)):
            raise ScenarioError(f"{self._where}: {odd}")


def _cell(text: str | None) -> float | None:
    try:
        return as_number(float(text or ""))
    except ValueError:
        return None


def shown(value: object) -> str:
    """A value for a message, cut where it is long."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
