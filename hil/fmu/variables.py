"""Variables of an FMU: names of the DBC and the parameter sets, SI units, and where their values lie."""

import dataclasses
import re
import typing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, TypeVar

import numpy as np

from dbc.codec import Field
from dbc.contract import Message, MessageSpec, database_text, spec_of
from dbc.frame import BusName
from hil.scenario.parameters import override
from plant.layout import Vector

INTEGERS, BOOLEANS = 0x10000, 0x20000  # first value references, as in wrapper.c; reals begin at 0
RX_DATA, TX_DATA, RX_CLOCK, TX_CLOCK, TIME = range(0x30000, 0x30005)
Causality = Literal["parameter", "structuralParameter", "input", "output"]
P = TypeVar("P")
_UNITS = {  # suffix of a field's name -> unit
    "": "", "rad": "rad", "rad_s": "rad/s", "m": "m", "mps": "m/s", "mps2": "m/s2", "pa": "Pa", "n": "N", "nm": "N m",
    "a": "A", "w": "W", "j": "J", "k": "K", "s": "s",
}  # fmt: skip
_PLACES = {2: ("_front", "_rear"), 4: ("_fl", "_fr", "_rl", "_rr")}


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable. ``low`` and ``high``: bounds, where it has any; booleans are kept as integers."""

    name: str
    kind: Literal["Float64", "Int32", "Boolean"]
    causality: Causality
    start: float = 0.0
    unit: str = ""
    description: str = ""
    low: float | None = None
    high: float | None = None


class Table:
    """Values of all variables.

    Parameters
    ----------
    variables : in the order of the model description.

    Attributes
    ----------
    reals, integers : values, SI units; shapes (reals,) and (integers and booleans,).
    references : value reference of each variable by name.
    """

    def __init__(self, variables: Sequence[Variable]) -> None:
        self.variables = tuple(variables)
        reals = [v for v in variables if v.kind == "Float64"]
        integers = [v for v in variables if v.kind != "Float64"]
        self.reals: Vector = np.array([v.start for v in reals], np.float64)
        self.integers = np.array([int(v.start) for v in integers], np.int64)
        self._real = {v.name: k for k, v in enumerate(reals)}
        self._integer = {v.name: k for k, v in enumerate(integers)}
        first = {"Int32": INTEGERS, "Boolean": BOOLEANS}
        self.references = self._real | {v.name: first[v.kind] + self._integer[v.name] for v in integers}

    def __getitem__(self, name: str) -> float | int:
        """Value of a variable."""
        at = self._real.get(name)
        return float(self.reals[at]) if at is not None else int(self.integers[self._integer[name]])

    def real_indices(self, names: Sequence[str]) -> Any:
        """Where reals lie, for reading or writing many at once; shape (names,)."""
        return np.array([self._real[name] for name in names], np.int64)

    def integer_indices(self, names: Sequence[str]) -> Any:
        """Where integers lie."""
        return np.array([self._integer[name] for name in names], np.int64)


def is_integer(field: Field) -> bool:
    """Whether a signal is a choice or a count."""
    return field.enum is not None or (
        field.factor == 1.0 and field.offset == 0.0 and field.name == field.signal.lower() and field.si_per_unit == 1.0
    )


def signal_variables(kind: type[Message], causality: Causality, leave: Sequence[str] = ()) -> list[Variable]:
    """Variables for the signals of a typed message, ``MESSAGE.SIGNAL``."""
    spec = spec_of(kind)
    return [_signal(spec, field, causality) for field in spec.fields if field.name not in leave]


def _signal(spec: MessageSpec, field: Field, causality: Causality) -> Variable:
    name, kind = f"{spec.name}.{field.signal}", "Int32" if is_integer(field) else "Float64"
    text = _comments(spec.bus).get((spec.can_id, field.signal), "")
    unit = _UNITS[field.name.removeprefix(field.signal.lower()).removeprefix("_")]
    start = max(0.0, field.minimum * field.si_per_unit) if causality == "input" else 0.0
    # mypy takes the two literal kinds for any str
    return Variable(name, kind, causality, start, unit, text)  # type: ignore[arg-type]


@cache
def _comments(bus: BusName) -> dict[tuple[int, str], str]:
    found = re.findall(r'^CM_ SG_ (\d+) (\w+) "([^"]*)";', database_text(bus), re.MULTILINE)
    return {(int(can_id), signal): text for can_id, signal, text in found}


def _numbers(value: Any, prefix: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Name, value and annotation of each number of a parameter set; named choices are none."""
    hints = typing.get_type_hints(type(value), include_extras=True)
    for field in dataclasses.fields(value):
        part, hint = getattr(value, field.name), hints[field.name]
        if dataclasses.is_dataclass(part):
            yield from _numbers(part, f"{prefix}{field.name}.")
        elif typing.get_origin(hint) is Annotated:
            yield prefix + field.name, part, hint


def _columns(name: str, value: Any) -> list[str]:
    if not isinstance(value, tuple):
        return [name]
    return [name + place for place in _PLACES.get(len(value)) or [f"_{k}" for k in range(len(value))]]


def parameter_variables(value: object) -> Iterator[Variable]:
    """Variables for the numbers of a parameter set: ``table.name``; pairs end in ``_front``, fours in ``_fl``, ..."""
    for name, part, hint in _numbers(value):
        unit, low, high = hint.__metadata__
        parts = part if isinstance(part, tuple) else (part,)
        kind: Literal["Int32", "Float64"] = "Int32" if typing.get_args(hint)[0] is int else "Float64"
        for column, number in zip(_columns(name, part), parts, strict=True):
            yield Variable(column, kind, "parameter", number, "" if unit == "1" else unit, low=low, high=high)


def with_parameters(value: P, table: Table) -> P:
    """A parameter set with the numbers of a table.

    Raises
    ------
    hil.scenario.parameters.ParameterError : a number out of its bounds.
    """
    changes: dict[str, Any] = {}
    for name, part, _ in _numbers(value):
        *path, last = name.split(".")
        at = changes
        for step in path:
            at = at.setdefault(step, {})
        numbers = tuple(table[column] for column in _columns(name, part))
        at[last] = numbers if isinstance(part, tuple) else numbers[0]
    return override(value, changes, "FMU")
