"""A scenario: one TOML file, validated, as one value."""

import difflib
import hashlib
import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from dbc.contract import contract
from dbc.frame import BusName
from ecu.parameters.ecu import EcuParameters
from hil.errors import BrakebenchError
from hil.faults.catalogue import fault_named
from hil.faults.fault import FROM_THE_FIRST_TICK, MOST_SEEDS, FaultKind, Injection
from hil.faults.targets import WHEELS, Takes, target_names
from hil.scenario.effects import Effects, read_effects
from hil.scenario.expectations import (
    LONGEST_S,
    Expectation,
    SignalExpectation,
    read_expectations,
    read_signal_expectation,
)
from hil.scenario.parameters import load_set, override
from hil.scenario.table import Files, ScenarioError, Table, as_number
from hil.scenario.tyre_file import load_tir
from plant.manoeuvre import DirectDemands, Manoeuvre, SpeedPhase, Trace
from plant.parameters.plant import PlantParameters
from plant.road import DRY, RoadSegment

DEFAULT_SCENARIO = "stop72"


@dataclass(frozen=True, slots=True)
class StartOrder:
    """How much later than the bench each node joins, s."""

    plant_s: float = 0.0
    ecu_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Scenario:
    """Everything that decides a run, seed apart.

    Attributes
    ----------
    name, title : short name and one line for people.
    source, sha256 : the file, and the hash of its text and of the CSV files it names.
    plant, ecu : parameter sets with the scenario's changes.
    plant_set, ecu_set : names of the sets they started from.
    manoeuvre : driver, road, start.
    start_order : which node joins when.
    blending : blending factor over time that the bench sends; empty leaves it to the controller.
    faults : what breaks when.
    effects : what this car has and the baseline has not.
    expectations, signal_expectations : what decides between exit code 0 and 1.
    """

    name: str
    title: str
    source: str
    sha256: str
    plant: PlantParameters
    ecu: EcuParameters
    plant_set: str
    ecu_set: str
    manoeuvre: Manoeuvre
    start_order: StartOrder
    blending: Trace
    faults: tuple[Injection, ...]
    effects: Effects
    expectations: tuple[Expectation, ...]
    signal_expectations: tuple[SignalExpectation, ...]


def scenario_names() -> list[str]:
    """Names of the scenarios that come with brakebench."""
    return sorted(item.name.removesuffix(".toml") for item in _library().iterdir() if item.name.endswith(".toml"))


def load_scenario(name: str) -> Scenario:
    """Read a scenario by name (of the library) or by path.

    Raises
    ------
    hil.scenario.table.ScenarioError, hil.scenario.parameters.ParameterError
        No such scenario, or a wrong field; the message names file, key and what is allowed.
    """
    source = find_scenario(name)
    text, values = read_scenario_file(source)
    return build_scenario(values, source, text)


def read_scenario_file(source: Path | Traversable) -> tuple[bytes, dict[str, Any]]:
    """Text of a scenario's file, and its tables as they stand there.

    Raises
    ------
    hil.scenario.table.ScenarioError : it cannot be read, or is no TOML.
    """
    try:
        text = source.read_bytes()
        return text, tomllib.loads(text.decode("utf-8"))
    except OSError as error:
        raise ScenarioError(f"{source}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:  # of the text's encoding or of TOML
        raise ScenarioError(f"{source}: not valid TOML: {error}") from error


def build_scenario(values: Mapping[str, Any], source: Path | Traversable, text: bytes) -> Scenario:
    """Check the tables of a scenario and make one value of them.

    Parameters
    ----------
    values : as in the file, or with other numbers in their places.
    source : the file; CSV traces lie beside it.
    text : what is hashed, beside the CSV files.

    Raises
    ------
    hil.scenario.table.ScenarioError, hil.scenario.parameters.ParameterError
        A wrong field; the message names file, key and what is allowed.
    """
    files = Files(source.parent if isinstance(source, Path) else _library())
    top = Table(values, source.name, files)
    title = top.text("title")
    plant_table, ecu_table, start = top.table("plant"), top.table("ecu"), top.table("start")
    plant_set, ecu_set = plant_table.text("set", "paper_car"), ecu_table.text("set", "paper_ecu")
    order = StartOrder(start.number("plant_after_s", 0.0, 0.0, 10.0), start.number("ecu_after_s", 0.0, 0.0, 10.0))
    scenario = Scenario(
        name=source.name.removesuffix(".toml"),
        title=title,
        source=str(source),
        sha256="",
        plant=_plant(plant_table, plant_set, files),
        ecu=override(load_set(_set("ecu", ecu_set), EcuParameters), ecu_table.rest(), f"{source.name}: ecu"),
        plant_set=plant_set,
        ecu_set=ecu_set,
        manoeuvre=_manoeuvre(top, start),
        start_order=order,
        blending=_blending(top),
        faults=(
            *[_fault(table) for table in top.tables("faults")],
            *[fault for table in top.tables("frame_faults") for fault in _frame_faults(table)],
        ),
        effects=read_effects(top.table("effects").rest(), f"{source.name}: effects"),
        expectations=tuple(read_expectations(top.table("expect"))),
        signal_expectations=tuple(read_signal_expectation(table) for table in top.tables("expect_signal")),
    )
    top.done()
    return replace(scenario, sha256=hashlib.sha256(b"".join([text, *files.read])).hexdigest())


def _library() -> Traversable:
    return resources.files("hil.scenario") / "library"


def find_scenario(name: str) -> Path | Traversable:
    """File of a scenario, by name (of the library) or by path; ScenarioError where there is none of that name."""
    path = Path(name)
    if path.suffix == ".toml" or "/" in name:
        return path
    if name in scenario_names():
        return _library() / f"{name}.toml"
    near = difflib.get_close_matches(name, scenario_names())
    hint = f"did you mean {', '.join(near)}?" if near else f"the library has {', '.join(scenario_names())};"
    raise ScenarioError(f"no scenario {name!r}; {hint} a file of your own ends in .toml")


def _set(package: str, name: str) -> Path | Traversable:
    """A parameter set by name (of the package) or by path."""
    return Path(name) if name.endswith(".toml") else resources.files(package) / "parameters" / f"{name}.toml"


def _plant(table: Table, name: str, files: Files) -> PlantParameters:
    """A set with the scenario's changes; a tyre file's coefficients come before single changes."""
    car = load_set(_set("plant", name), PlantParameters)
    if table.has("tyre_file"):
        path = Path(str(files.folder / table.text("tyre_file")))
        car = replace(car, tyre=load_tir(path, car.tyre).tyre)
        files.read.append(path.read_bytes())
    return override(car, table.rest(), table.where)


def _manoeuvre(top: Table, start: Table) -> Manoeuvre:
    driver, end, direct = top.table("driver"), top.table("end"), top.table("direct")
    manoeuvre = Manoeuvre(
        initial_speed_mps=start.number("speed_mps", None, -15.0, 60.0),
        initial_disc_temperature_k=start.number("disc_temperature_k", 423.15, 200.0, 1200.0),
        initial_state_of_charge=start.number("state_of_charge", 0.7, 0.0, 1.0),
        duration_s=end.number("duration_s", None, 0.1, LONGEST_S),
        end_after_standstill_s=_standstill(end),
        pedal=driver.trace("pedal", 0.0, 1.0),
        steering_wheel_rad=driver.trace("steering_wheel_rad", -15.0, 15.0),
        speed_phases=tuple(_speed_phase(table) for table in driver.tables("hold_speed")),
        road=tuple(_segment(table) for table in top.tables("road")) or DRY,
        direct=DirectDemands(
            pressure_pa=_four(direct.table("pressure_pa"), 0.0, 25e6),
            motor_nm=_four(direct.table("motor_nm"), -1500.0, 1500.0),
        ),
        wait_for_demands=start.switch("wait_for_ecu", True),
    )
    for table in (start, driver, end, direct):
        table.done()
    return manoeuvre


def _standstill(end: Table) -> float | None:
    """``false`` runs to the end of the duration."""
    if end.has("after_standstill_s") and end.peek("after_standstill_s") is False:
        end.take("after_standstill_s")
        return None
    return end.number("after_standstill_s", 1.0, 0.0, LONGEST_S)


def _speed_phase(table: Table) -> SpeedPhase:
    phase = SpeedPhase(
        table.number("start_s", None, 0.0), table.number("end_s", None, 0.0), table.number("speed_mps", None, 0.0, 60.0)
    )
    table.done()
    return phase


def _blending(top: Table) -> Trace:
    """One number, or a course over time."""
    number = as_number(top.peek("blending"))
    if number is None:
        return top.trace("blending", 0.0, 1.0)
    return ((0.0, top.number("blending", None, 0.0, 1.0)),)


def _fault(table: Table) -> Injection:
    """One fault of the library: what, on what, from when to when, with which numbers."""
    name = table.text("fault")
    try:
        kind = fault_named(name)
    except BrakebenchError as error:
        raise ScenarioError(f"{table.at('fault')}: {error}") from error
    physical = kind.takes is Takes.WHEELS
    at_s = table.number("at_s", None if physical else FROM_THE_FIRST_TICK, 0.0, LONGEST_S)
    values = {p.name: table.number(p.name, None, p.low, p.high) for p in kind.all_parameters if table.has(p.name)}
    begin_s = max(at_s, 0.0)
    if table.has("until_s") and "for_s" not in values:
        values["for_s"] = table.number("until_s", None, begin_s, LONGEST_S) - begin_s
    seed = round(table.number("seed", 0, 0, MOST_SEEDS - 1)) if table.has("seed") else None
    on = _wheels(table) if physical else _target(table, kind)
    table.done()
    try:
        return kind.on(on, at_s=at_s, seed=seed, values=values)
    except BrakebenchError as error:
        raise ScenarioError(f"{table.where}: {error}") from error


def _wheels(table: Table) -> str:
    """Wheels by ``wheels`` or, as in the library, by ``on``; all of them where the file does not say."""
    if table.has("on"):
        return table.text("on")
    return ",".join(table.names("wheels", WHEELS)) or "all"


def _target(table: Table, kind: FaultKind) -> str | None:
    """What it acts on; only what has one target needs no word."""
    names = target_names(kind.takes)
    return None if len(names) == 1 and not table.has("on") else table.text("on")


_FRAME_FAULTS = {"drop": "lost", "duplicate": "doubled", "stale": "stale", "late": "late"}


def _frame_faults(table: Table) -> Iterator[Injection]:
    """Shares of some messages of the vehicle bus, or of all: faults of the library in one table."""
    known = sorted(spec.name for spec in contract(BusName.VEHICLE).by_id.values())
    from_s = table.number("from_s", FROM_THE_FIRST_TICK, 0.0, LONGEST_S)
    shares = {name: table.number(name, 0.0, 0.0, 1.0) for name in _FRAME_FAULTS}
    ticks = table.number("longest_ticks", 2, 1, 100)
    messages = table.names("messages", known) or ["ALL"]
    begin_s = max(from_s, 0.0)
    for_s = table.number("until_s", math.inf, begin_s, LONGEST_S) - begin_s
    table.done()
    for name, share in shares.items():
        values = {"share": share} | ({"ticks": ticks} if name == "late" else {})
        values |= {"for_s": for_s} if math.isfinite(for_s) else {}
        for message in messages if share else ():
            yield fault_named(_FRAME_FAULTS[name]).on(message, at_s=from_s, values=values)


def _segment(table: Table) -> RoadSegment:
    friction = table.number("friction", 1.0, 0.0, 2.0)
    segment = RoadSegment(
        start_m=table.number("start_m", None),
        friction_left=table.number("friction_left", friction, 0.0, 2.0),
        friction_right=table.number("friction_right", friction, 0.0, 2.0),
        grade=table.number("grade", 0.0, -0.5, 0.5),
    )
    table.done()
    return segment


def _four(table: Table, low: float, high: float) -> tuple[Trace, Trace, Trace, Trace]:
    everywhere = table.trace("all", low, high)
    fl, fr, rl, rr = (table.trace(wheel, low, high) or everywhere for wheel in WHEELS)
    table.done()
    return fl, fr, rl, rr
