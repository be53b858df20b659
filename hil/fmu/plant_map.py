"""MAP.toml: which signal is which variable of somebody else's FMU."""

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dbc.contract import Message, spec_of
from dbc.messages import EhbDemandFront, EhbDemandRear, MotorDemandFront, MotorDemandRear
from hil.scenario.table import Files, ScenarioError, Table
from plant.reports import OF_NODES, TRUTH

DEMANDS: tuple[type[Message], ...] = (EhbDemandFront, EhbDemandRear, MotorDemandFront, MotorDemandRear)
DRIVER = ("DRIVER.PEDAL", "DRIVER.STEERING_WHEEL_ANGLE", "DRIVER.TARGET_SPEED")
SENT: tuple[type[Message], ...] = (*(kind for of in OF_NODES.values() for kind in of), *TRUTH)
SPEED = "TRUTH_MOTION.SPEED"
_OWN = frozenset({"TRUTH_MOTION.MANOEUVRE"})


def _names(kinds: Sequence[type[Message]]) -> list[str]:
    return [f"{spec_of(kind).name}.{field.signal}" for kind in kinds for field in spec_of(kind).fields]


ASKED = (*_names(DEMANDS), *DRIVER)
"""What an input of the FMU may follow, SI units."""
TOLD = tuple(name for name in _names(SENT) if name not in _OWN and not name.startswith("PLANT_RECEPTION."))
"""What an output of the FMU may be, SI units."""


@dataclass(frozen=True, slots=True)
class Term:
    """A number times a factor: a variable of the FMU, one of `ASKED`, or 1."""

    kind: Literal["fmu", "signal", "value"]
    name: str
    factor: float = 1.0


@dataclass(frozen=True, slots=True)
class Source:
    """Sum of terms, with normal noise of a standard deviation."""

    terms: tuple[Term, ...]
    noise: float = 0.0


@dataclass(frozen=True, slots=True)
class PlantMap:
    """What a map says.

    Attributes
    ----------
    step_s : 0 for the step that the FMU states.
    parameters : set before its initialisation.
    inputs : by variable of the FMU.  outputs : by signal.
    """

    step_s: float
    parameters: dict[str, float]
    inputs: dict[str, Source]
    outputs: dict[str, Source]

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
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: not valid TOML: {error}") from error
    top = Table(values, path.name, Files(path.parent))
    parameters, inputs, outputs = top.table("parameters"), top.table("inputs"), top.table("outputs")
    step_s = top.number("step_s", 0.0, 0.0, 1.0)
    top.done()
    found = PlantMap(
        step_s,
        {name: parameters.number(name, None) for name in _keys(values, "parameters")},
        {name: _source(inputs, name, "signal") for name in _keys(values, "inputs")},
        {name: _source(outputs, name, "fmu") for name in _keys(values, "outputs")},
    )
    for name in found.outputs:
        if name not in TOLD:
            raise ScenarioError(f"{outputs.at(name)}: no signal of the car; known: {', '.join(TOLD)}")
    if SPEED not in found.outputs:
        raise ScenarioError(f"{outputs.at(SPEED)}: expected the car's speed, m/s: the bench measures by it")
    return found


def _keys(values: dict[str, object], table: str) -> Iterator[str]:
    found = values.get(table, {})
    return iter(list(found)) if isinstance(found, dict) else iter(())


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
    if kind == "signal" and name not in ASKED:
        raise ScenarioError(f"{where}: {name!r} is nothing that the car is asked; known: {', '.join(ASKED)}")
    return Term(kind, name)
