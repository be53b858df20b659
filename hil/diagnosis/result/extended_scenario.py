"""`run --extend`: a scenario with the effects and parameters of an extension file, as a file every process can read."""

import json
import tomllib
from collections.abc import Mapping
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.vehicle.extension_file import load_extension
from hil.scenario.scenario import find_scenario

_SECTIONS = (
    "friction_brake", "vehicle", "suspension", "wheel", "tyre", "ehb", "pad", "motor", "battery", "sensor",
)  # fmt: skip


def extended_scenario(name: str, extension: Path, folder: Path) -> Path:
    """Write a scenario's file again into ``folder``, with the effects and the vehicle's parameters of an extension file.

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
    effects, parameters = extended.get("effects", {}), extended.get("parameters", {})
    if not (effects or parameters or extended.get("laws")):
        raise UnusableError(
            f"{extension}: nothing to simulate: no [effects] and no [parameters]; it describes sensors that the simulated "
            "car does not have (see its comments)"
        )
    source = find_scenario(name)
    scenario = tomllib.loads(source.read_bytes().decode("utf-8"))
    own = scenario.setdefault("effects", {})
    for effect, values in effects.items():
        own[effect] = own.get(effect, {}) | values
    if extended.get("laws"):
        own["laws"] = [*own.get("laws", []), *extended["laws"]]
    plant = scenario.setdefault("plant", {})
    for flat, value in parameters.items():
        section = next(s for s in _SECTIONS if flat.startswith(s + "_"))
        values = value if isinstance(value, list) else [value]
        plant.setdefault(section, {})[flat.removeprefix(section + "_")] = values if len(values) > 1 else values[0]
    _copy_tables(scenario, source, folder)
    path = folder / f"{source.name.removesuffix('.toml')}_extended.toml"
    lines = [f"# {source.name} with {extension.name}", *(f"{_key(k)} = {_toml(v)}" for k, v in scenario.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


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


def _key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else json.dumps(key)


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)
