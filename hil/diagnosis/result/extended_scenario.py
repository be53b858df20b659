"""`run --extend`: a scenario with the effects and parameters of an extension file, as a file every process can read."""

import tomllib
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.vehicle.extension_file import ONSET_LOG, effect_tables, load_extension, toml_key, toml_value
from hil.diagnosis.vehicle.keys import split_name
from hil.scenario.scenario import find_scenario, load_scenario
from plant.injection.theta import THETA


def extended_scenario(name: str, extension: Path, folder: Path) -> Path:
    """Write a scenario's file again into ``folder``, with the effects and parameters of an extension file.

    An effect that begins so many seconds into a log begins at that time of the scenario.

    Parameters
    ----------
    name : scenario by name or path.  folder : must exist; CSV files that the scenario names are copied beside it.

    Raises
    ------
    UnusableError, hil.scenario.table.ScenarioError
        An extension file or a scenario that cannot be used, or nothing in the extension that a simulation can have.
    """
    load_extension(extension)  # refuses values that no car has
    extended = tomllib.loads(extension.read_text(encoding="utf-8"))
    effects, parameters = effect_tables(extension), extended.get("parameters", {})
    if not (effects or parameters or extended.get("laws")):
        raise UnusableError(
            f"{extension}: nothing to simulate: no [effects] and no [parameters]; it describes sensors that the "
            "simulated car does not have (see its comments)"
        )
    source = find_scenario(name)
    scenario = tomllib.loads(source.read_bytes().decode("utf-8"))
    own = scenario.setdefault("effects", {})
    for effect, entries in effects.items():
        own[effect] = own.get(effect, {}) | {key: value for key, value in entries.items() if key != ONSET_LOG}
    if extended.get("laws"):
        own["laws"] = [*own.get("laws", []), *extended["laws"]]
    plant = scenario.setdefault("plant", {})
    for flat, value in parameters.items():
        section, key = split_name(flat)
        values = value if isinstance(value, list) else [value]
        plant.setdefault(section, {})[key] = values if len(values) > 1 else values[0]
    _copy_tables(scenario, source, folder)
    path = folder / f"{source.name.removesuffix('.toml')}_extended.toml"
    lines = [
        f"# {source.name} with {extension.name}",
        *(f"{toml_key(k)} = {toml_value(v)}" for k, v in scenario.items()),
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def effects_after_end(scenario: Path) -> list[str]:
    """Remarks on effects that begin after a scenario's end."""
    loaded = load_scenario(str(scenario))
    end_s = loaded.manoeuvre.duration_s
    begins = {name: float(loaded.effects.number(name, "onset_s")[0]) for name in loaded.effects.on}
    return [
        f"{THETA.effect(name).title}: begins at {begin_s:g} s, the scenario ends at {end_s:g} s: this run is "
        f"without it; take out or change onset_s of [effects.{name}] in the extension"
        for name, begin_s in begins.items()
        if begin_s >= end_s
    ]


def _copy_tables(value: Any, source: Path | Traversable, folder: Path) -> None:
    """The CSV files that a scenario names, beside the new one."""
    if isinstance(value, dict):
        name = value.get("csv")
        if isinstance(name, str):
            folder_of_source = source.parent if isinstance(source, Path) else Path(str(source)).parent
            (folder / Path(name).name).write_bytes((folder_of_source / name).read_bytes())
            value["csv"] = Path(name).name
        for item in value.values():
            _copy_tables(item, source, folder)
    elif isinstance(value, list):
        for item in value:
            _copy_tables(item, source, folder)
