"""What an FMU holds beside its binary: which unit, with which numbers; written by the exporter, read by the process."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

from ecu.parameters.ecu import EcuParameters
from hil.errors import BrakebenchError
from hil.fmu import ecu_unit, plant_unit
from hil.fmu.ecu_unit import EcuUnit
from hil.fmu.plant_unit import PlantUnit, Start
from hil.fmu.variables import Table, Variable
from hil.scenario.parameters import load_set, override
from hil.scenario.scenario import Scenario
from plant.parameters.plant import PlantParameters

Kind = Literal["plant", "ecu"]
KINDS: tuple[Kind, ...] = get_args(Kind)
MODEL_FILE = "model.json"


class FmuError(BrakebenchError):
    """An FMU that cannot be made or used."""


class Unit(Protocol):
    """What the process behind an FMU steps; times are since the start, s."""

    table: Table

    @property
    def outgoing(self) -> bytes:
        """What the bus is to hear at the next event."""

    def preview(self) -> None:
        """Compute the outputs of the start."""

    def initialise(self) -> None:
        """Start with the numbers in the table."""

    def advance_to(self, time_s: float) -> None:
        """Go on to a communication point."""

    def event(self, received: bytes) -> None:
        """End an event in which the bus has said something."""

    def state(self) -> bytes:
        """All that a later step depends on."""

    def restore(self, state: bytes) -> None:
        """Go back to a state."""


def numbers_of(kind: Kind, scenario: Scenario) -> dict[str, Any]:
    """Numbers of a scenario that an FMU starts with, as JSON holds them."""
    if kind == "ecu":
        return {"set": dataclasses.asdict(scenario.ecu)}
    manoeuvre = scenario.manoeuvre
    start = Start(manoeuvre.initial_speed_mps, manoeuvre.initial_disc_temperature_k, manoeuvre.initial_state_of_charge)
    return {"set": dataclasses.asdict(scenario.plant), "start": dataclasses.asdict(start)}


def _plant(numbers: Mapping[str, Any]) -> tuple[PlantParameters, Start]:
    base = load_set(resources.files("plant") / "parameters" / "paper_car.toml", PlantParameters)
    return override(base, numbers["set"], MODEL_FILE), Start(**numbers["start"])


def _ecu(numbers: Mapping[str, Any]) -> EcuParameters:
    base = load_set(resources.files("ecu") / "parameters" / "paper_ecu.toml", EcuParameters)
    return override(base, numbers["set"], MODEL_FILE)


def variables_of(kind: Kind, numbers: Mapping[str, Any]) -> list[Variable]:
    """Variables of an FMU."""
    return plant_unit.variables(*_plant(numbers)) if kind == "plant" else ecu_unit.variables(_ecu(numbers))


def token_of(kind: Kind, numbers: Mapping[str, Any]) -> str:
    """Instantiation token: the same for the same variables with the same starts."""
    text = repr((kind, variables_of(kind, numbers), json.dumps(numbers, sort_keys=True)))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def load_unit(folder: Path, token: str, event_mode: bool) -> Unit:
    """The unit of an unpacked FMU.

    Raises
    ------
    FmuError : not one of ours, or of a version with other variables.
    """
    path = folder / MODEL_FILE
    try:
        model = json.loads(path.read_text(encoding="utf-8"))
        kind, numbers = model["kind"], model["numbers"]
    except (OSError, ValueError, KeyError) as error:
        raise FmuError(f"{path}: expected the model of an FMU of brakebench: {error}") from error
    if token_of(kind, numbers) != token:
        raise FmuError(
            f"instantiation token {token!r}: expected that of variables which this brakebench knows; the FMU was "
            f"exported by brakebench {model.get('brakebench')}: export it again with the one installed"
        )
    return PlantUnit(*_plant(numbers)) if kind == "plant" else EcuUnit(_ecu(numbers), event_mode)
