"""MAP.toml: which signal is which variable of somebody else's FMU."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from dbc.contract import Message, spec_of
from dbc.messages import EhbDemandFront, EhbDemandRear, MotorDemandFront, MotorDemandRear
from hil.scenario.table import Files, ScenarioError, Table
from plant.reports import OF_NODES, TRUTH

DEMANDS: tuple[type[Message], ...] = (EhbDemandFront, EhbDemandRear, MotorDemandFront, MotorDemandRear)
DRIVER = ("DRIVER.PEDAL", "DRIVER.STEERING_WHEEL_ANGLE", "DRIVER.TARGET_SPEED")
SENT: tuple[type[Message], ...] = (*(kind for of in OF_NODES.values() for kind in of), *TRUTH)
SPEED = "TRUTH_MOTION.SPEED"
Values = TypeVar("Values", float, NDArray[np.float64])
_OWN = frozenset({"TRUTH_MOTION.MANOEUVRE"})


def _names(kinds: Sequence[type[Message]]) -> list[str]:
    return [f"{spec_of(kind).name}.{field.signal}" for kind in kinds for field in spec_of(kind).fields]


REQUESTED = (*_names(DEMANDS), *DRIVER)
"""What an input of the FMU may follow, SI units."""
TOLD = tuple(name for name in _names(SENT) if name not in _OWN and not name.startswith("PLANT_RECEPTION."))
"""What an output of the FMU may be, SI units."""


@dataclass(frozen=True, slots=True)
class Term:
    """A number times a factor: a variable of the FMU, one of `REQUESTED`, or 1."""

    kind: Literal["fmu", "signal", "value"]
    name: str
    factor: float = 1.0


@dataclass(frozen=True, slots=True)
class Source:
    """Sum of terms, with normal noise of a standard deviation."""

    terms: tuple[Term, ...]
    noise: float = 0.0

    @property
    def is_of_fmu(self) -> bool:
        """Whether the FMU has a say in it."""
        return any(term.kind == "fmu" for term in self.terms)

    def value(self, fmu: Mapping[str, Values], asked: Mapping[str, Values], one: Values) -> Values:
        """The sum without noise.

        Parameters
        ----------
        fmu, asked : variables of the FMU, and `REQUESTED`, by name: numbers, or arrays of one shape.
        one : 1, of the same shape.
        """
        total = 0.0 * one
        for term in self.terms:
            of = one if term.kind == "value" else fmu[term.name] if term.kind == "fmu" else asked[term.name]
            total = total + of * term.factor
        return total


@dataclass(frozen=True, slots=True)
class PlantMap:
    """What a map says.

    Attributes
    ----------
    step_s : 0 for the step that the FMU states.
    parameters : set before its initialisation.
    start_speed : the parameter that takes the speed at the start, and its unit in m/s by a factor; None for none.
    inputs : by variable of the FMU.  outputs : by signal.
    """

    step_s: float
    parameters: dict[str, float]
    inputs: dict[str, Source]
    outputs: dict[str, Source]
    start_speed: Term | None = None

    def parameters_at(self, speed_mps: float) -> dict[str, float]:
        """Parameters for a start at a speed, m/s."""
        start = self.start_speed
        return self.parameters if start is None else self.parameters | {start.name: speed_mps * start.factor}

    @property
    def wanted(self) -> list[str]:
        """Variables of the FMU that are read."""
        of = [term.name for source in self.outputs.values() for term in source.terms if term.kind == "fmu"]
        return list(dict.fromkeys(of))


def load_plant_map(path: Path) -> PlantMap:
    """Read a map.

    Raises
    ------
    ScenarioError : unreadable, an unknown signal or key, no speed.
    """
    values = _read(path)
    top = Table(values, path.name, Files(path.parent))
    parameters, inputs, outputs = top.table("parameters"), top.table("inputs"), top.table("outputs")
    step_s = top.number("step_s", 0.0, 0.0, 1.0)
    start_speed = _start_speed(top)
    top.done()
    found = PlantMap(
        step_s,
        {name: parameters.number(name, None) for name in _keys(values, "parameters")},
        {name: _source(inputs, name, "signal") for name in _keys(values, "inputs")},
        {name: _source(outputs, name, "fmu") for name in _keys(values, "outputs")},
        start_speed,
    )
    for name in found.outputs:
        if name not in TOLD:
            raise ScenarioError(f"{outputs.at(name)}: no signal of the car; known: {', '.join(TOLD)}")
    if SPEED not in found.outputs:
        raise ScenarioError(f"{outputs.at(SPEED)}: expected the car's speed, m/s: the bench measures by it")
    return found


def is_plant_map(path: Path) -> bool:
    """Whether a file says what an FMU gives, as no other map does.

    Raises
    ------
    ScenarioError : unreadable.
    """
    return "outputs" in _read(path)


def _read(path: Path) -> dict[str, object]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: not valid TOML: {error}") from error


def _keys(values: dict[str, object], table: str) -> Iterator[str]:
    found = values.get(table, {})
    return iter(list(found)) if isinstance(found, dict) else iter(())


def _start_speed(top: Table) -> Term | None:
    if not top.has("start_speed"):
        return None
    if isinstance(top.peek("start_speed"), str):
        return Term("fmu", top.text("start_speed"))
    inner = top.table("start_speed")
    found = Term("fmu", inner.text("fmu"), inner.number("factor", 1.0))
    inner.done()
    return found


def _source(table: Table, name: str, plain: Literal["fmu", "signal"]) -> Source:
    value = table.peek(name)
    if isinstance(value, str):
        return Source((_term(table.at(name), plain, table.text(name)),))
    if isinstance(value, list):
        return Source(tuple(_terms(one, plain)[0] for one in table.tables(name)))
    inner = table.table(name)
    noise = inner.number("noise", 0.0, 0.0)
    term, offset = _terms(inner, plain)
    return Source((term, Term("value", "", offset)) if offset else (term,), noise)


def _terms(inner: Table, plain: Literal["fmu", "signal"]) -> tuple[Term, float]:
    if inner.has("value"):
        term = Term("value", "", inner.number("value", None))
    else:
        kind: Literal["fmu", "signal"] = "signal" if inner.has("signal") or plain == "signal" else "fmu"
        term = _term(inner.where, kind, inner.text(kind))
        term = Term(term.kind, term.name, inner.number("factor", 1.0))
    offset = inner.number("offset", 0.0)
    inner.done()
    return term, offset


def _term(where: str, kind: Literal["fmu", "signal"], name: str) -> Term:
    if kind == "signal" and name not in REQUESTED:
        raise ScenarioError(f"{where}: {name!r} is nothing that the car is asked; known: {', '.join(REQUESTED)}")
    return Term(kind, name)
