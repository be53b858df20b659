"""A scenario: one TOML file, validated, as one value."""

import hashlib
import itertools
import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from ecu.parameters.ecu import EcuParameters
from hil.errors import BrakebenchError
from hil.parameters import load_set, override
from plant.manoeuvre import DirectDemands, Manoeuvre, SpeedPhase, Trace
from plant.parameters.plant import PlantParameters
from plant.road import DRY, RoadSegment

DEFAULT_SCENARIO = "stop72"
WHEELS = ("fl", "fr", "rl", "rr")
EXPECTABLE = (
    "stop_distance_m",
    "stop_time_s",
    "mean_decel_mps2",
    "energy_recuperated_j",
    "frames_lost",
    "frames_corrupt",
)


class ScenarioError(BrakebenchError):
    """A scenario that cannot be used as it is; the message names file and key."""


@dataclass(frozen=True, slots=True)
class Expectation:
    """What a result must lie between; ``name`` is a key of ``run --json``."""

    name: str
    minimum: float
    maximum: float


@dataclass(frozen=True, slots=True)
class Scenario:
    """Everything that decides a run, seed apart.

    Attributes
    ----------
    name, title : short name and one line for people.
    source, sha256 : the file and the hash of its text.
    plant, ecu : parameter sets with the scenario's changes.
    plant_set, ecu_set : names of the sets they started from.
    manoeuvre : driver, road, start.
    expectations : what decides between exit code 0 and 1.
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
    expectations: tuple[Expectation, ...]


class _Table:
    """A TOML table that knows where it stands and refuses keys nobody asked for."""

    def __init__(self, values: Any, where: str) -> None:
        if not isinstance(values, Mapping):
            raise ScenarioError(f"{where}: expected a table, got {values!r}")
        self._values = dict(values)
        self._where = where
        self._known: list[str] = []

    def take(self, key: str, default: Any = None) -> Any:
        self._known.append(key)
        return self._values.pop(key, default)

    def number(self, key: str, default: float | None, low: float = -math.inf, high: float = math.inf) -> float:
        value = self.take(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise ScenarioError(f"{self.at(key)}: expected a number from {low:g} to {high:g}, got {value!r}")
        return float(value)

    def text(self, key: str, default: str | None = None) -> str:
        value = self.take(key, default)
        if not isinstance(value, str) or not value:
            raise ScenarioError(f"{self.at(key)}: expected a text, got {value!r}")
        return value

    def table(self, key: str) -> "_Table":
        return _Table(self.take(key, {}), self.at(key))

    def tables(self, key: str) -> list["_Table"]:
        values = self.take(key, [])
        if not isinstance(values, list):
            raise ScenarioError(f"{self.at(key)}: expected a list of tables ([[{key}]]), got {values!r}")
        return [_Table(value, f"{self.at(key)}[{i}]") for i, value in enumerate(values)]

    def trace(self, key: str, low: float = -math.inf, high: float = math.inf) -> Trace:
        """``[[time_s, value], ...]`` in order of time."""
        points = self.take(key, [])
        good = isinstance(points, list) and all(
            isinstance(p, list) and len(p) == 2 and all(type(v) in (int, float) and math.isfinite(v) for v in p)
            for p in points
        )
        if not good:
            raise ScenarioError(f"{self.at(key)}: expected a list of [time_s, value] pairs, got {points!r}")
        trace = tuple((float(t), float(v)) for t, v in points)
        for (t0, _), (t1, _) in itertools.pairwise(trace):
            if t1 < t0:
                raise ScenarioError(f"{self.at(key)}: times must not decrease, but {t1:g} s follows {t0:g} s")
        for _, value in trace:
            if not low <= value <= high:
                raise ScenarioError(f"{self.at(key)}: expected values from {low:g} to {high:g}, got {value:g}")
        return trace

    def rest(self) -> dict[str, Any]:
        """Whatever has not been asked for; the caller checks it."""
        values, self._values = self._values, {}
        return values

    def at(self, key: str) -> str:
        return f"{self._where}: {key}" if self._where.endswith(".toml") else f"{self._where}.{key}"

    def done(self) -> None:
        if self._values:
            odd = ", ".join(map(repr, self._values))
            raise ScenarioError(f"{self._where}: unknown key {odd}; known here: {', '.join(sorted(set(self._known)))}")


def scenario_names() -> list[str]:
    """Names of the scenarios that come with brakebench."""
    return sorted(item.name.removesuffix(".toml") for item in _library().iterdir() if item.name.endswith(".toml"))


def load_scenario(name: str) -> Scenario:
    """Read a scenario by name (of the library) or by path.

    Raises
    ------
    ScenarioError, hil.parameters.ParameterError
        No such scenario, or a wrong field; the message names file, key and what is allowed.
    """
    source = _find(name)
    try:
        text = source.read_bytes()
        values = tomllib.loads(text.decode("utf-8"))
    except OSError as error:
        raise ScenarioError(f"{source}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{source}: not valid TOML: {error}") from error
    top = _Table(values, source.name)
    title = top.text("title")
    plant_table, ecu_table = top.table("plant"), top.table("ecu")
    plant_set, ecu_set = plant_table.text("set", "paper_car"), ecu_table.text("set", "paper_ecu")
    scenario = Scenario(
        name=source.name.removesuffix(".toml"),
        title=title,
        source=str(source),
        sha256=hashlib.sha256(text).hexdigest(),
        plant=override(
            load_set(_set("plant", plant_set), PlantParameters), plant_table.rest(), f"{source.name}: plant"
        ),
        ecu=override(load_set(_set("ecu", ecu_set), EcuParameters), ecu_table.rest(), f"{source.name}: ecu"),
        plant_set=plant_set,
        ecu_set=ecu_set,
        manoeuvre=_manoeuvre(top),
        expectations=tuple(_expectations(top.table("expect"))),
    )
    top.done()
    return scenario


def _library() -> Traversable:
    return resources.files("hil") / "scenarios"


def _find(name: str) -> Path | Traversable:
    path = Path(name)
    if path.suffix == ".toml" or "/" in name:
        return path
    if name in scenario_names():
        return _library() / f"{name}.toml"
    raise ScenarioError(
        f"no scenario {name!r}; the library has {', '.join(scenario_names())}; a file of your own ends in .toml"
    )


def _set(package: str, name: str) -> Path | Traversable:
    """A parameter set by name (of the package) or by path."""
    return Path(name) if name.endswith(".toml") else resources.files(package) / "parameters" / f"{name}.toml"


def _manoeuvre(top: _Table) -> Manoeuvre:
    start, driver, end, direct = top.table("start"), top.table("driver"), top.table("end"), top.table("direct")
    standstill = end.take("after_standstill_s", 1.0)
    manoeuvre = Manoeuvre(
        initial_speed_mps=start.number("speed_mps", None, 0.0, 60.0),
        initial_disc_temperature_k=start.number("disc_temperature_k", 423.15, 200.0, 1200.0),
        initial_state_of_charge=start.number("state_of_charge", 0.7, 0.0, 1.0),
        duration_s=end.number("duration_s", None, 0.0, 3600.0),
        end_after_standstill_s=None if standstill is False else float(standstill),
        pedal=driver.trace("pedal", 0.0, 1.0),
        steering_wheel_rad=driver.trace("steering_wheel_rad", -15.0, 15.0),
        speed_phases=tuple(_speed_phase(table) for table in driver.tables("hold_speed")),
        road=tuple(_segment(table) for table in top.tables("road")) or DRY,
        direct=DirectDemands(
            pressure_pa=_four(direct.table("pressure_pa"), 0.0, 25e6),
            motor_nm=_four(direct.table("motor_nm"), -1500.0, 1500.0),
        ),
        wait_for_demands=bool(start.take("wait_for_ecu", True)),
    )
    for table in (start, driver, end, direct):
        table.done()
    return manoeuvre


def _speed_phase(table: _Table) -> SpeedPhase:
    phase = SpeedPhase(
        table.number("start_s", None, 0.0), table.number("end_s", None, 0.0), table.number("speed_mps", None, 0.0, 60.0)
    )
    table.done()
    return phase


def _segment(table: _Table) -> RoadSegment:
    friction = table.number("friction", 1.0, 0.0, 2.0)
    segment = RoadSegment(
        start_m=table.number("start_m", None),
        friction_left=table.number("friction_left", friction, 0.0, 2.0),
        friction_right=table.number("friction_right", friction, 0.0, 2.0),
        grade=table.number("grade", 0.0, -0.5, 0.5),
    )
    table.done()
    return segment


def _four(table: _Table, low: float, high: float) -> tuple[Trace, Trace, Trace, Trace]:
    everywhere = table.trace("all", low, high)
    fl, fr, rl, rr = (table.trace(wheel, low, high) or everywhere for wheel in WHEELS)
    table.done()
    return fl, fr, rl, rr


def _expectations(table: _Table) -> Iterator[Expectation]:
    for name in EXPECTABLE:
        limits = table.table(name)
        low, high = limits.number("min", -math.inf), limits.number("max", math.inf)
        limits.done()
        if math.isfinite(low) or math.isfinite(high):
            yield Expectation(name, low, high)
    table.done()
