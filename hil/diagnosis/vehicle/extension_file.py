"""The extension file: what a diagnosis adds to a car, as TOML that ``explain --extend`` and ``run --extend`` take.

``[effects]``, ``[[laws]]`` (nonparametric terms) and ``[parameters]`` are for simulations; ``[channels]``, by model, is
for the next comparison of sensors (`hil.diagnosis.sensor_consistency`). An effect with an onset has ``onset_s``, the
time into the log ``onset_log``: `explain --extend` lets it begin in that log, `run --extend` at that time of the
scenario.
"""

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hil.diagnosis.data.log import Floats, UnusableError
from hil.errors import in_words, unknown_keys
from hil.scenario.effects import EffectError, read_laws, written_laws
from plant.injection.bank import NO_TERMS
from plant.injection.theta import THETA
from plant.vectors import PARAMETER

ONSET_LOG = "onset_log"
"""Key of the log in which an effect begins."""
_RENAMED = {("wrong_scale", "factor"): "gain"}
"""Parameters of effects that earlier files call differently: effect and name, name now."""
_TABLES = ("effects", "laws", "parameters", "channels")
_CHANNEL_MODELS = ("along", "turning", "wheels", "braking")


@dataclass(frozen=True, eq=False)
class Extension:
    """Theta of the effects, changed parameters of the plant by flat name, and rows of nonparametric terms.

    Theta is (THETA.size,), the rows as in `plant.injection.bank`. ``onsets`` are log and s into it by effect, of those
    that begin in a log.
    """

    theta: Floats
    parameters: Mapping[str, list[float]]
    nonparametric_rows: Floats = field(default_factory=NO_TERMS.copy)
    onsets: Mapping[str, tuple[str, float]] = field(default_factory=dict)


def write_extension(path: Path, extension: Extension, notes: Sequence[str]) -> None:
    """Write an extension file that begins with the comments ``notes``."""
    neutral = THETA.neutral()
    effects: dict[str, dict[str, Any]] = {}
    for effect in THETA.effects:
        entries: dict[str, Any] = {}
        for parameter in effect.parameters:
            own = THETA.slice(effect.name, parameter.name)
            values = extension.theta[own].tolist()
            if np.any(extension.theta[own] != neutral[own]):
                by_member = zip(effect.scope.members, values, strict=True)
                entries[parameter.name] = values[0] if len(values) == 1 else dict(by_member)
        for time in ("onset_s", "until_s"):
            value = float(extension.theta[THETA.slice(effect.name, time)][0])
            if entries and abs(value) < 1e11:
                entries[time] = value
        if entries and effect.name in extension.onsets:
            entries[ONSET_LOG], entries["onset_s"] = extension.onsets[effect.name]
        effects[effect.name] = entries
    lines = [*(f"# {note}" for note in notes), "# Effects by name, then estimated parameters of the vehicle."]
    lines += _tables("effects", effects)
    for law in written_laws(extension.nonparametric_rows):
        lines += ["", "[[laws]]", *_entries(law)]
    if extension.parameters:
        lines += ["", "[parameters]", *_entries(extension.parameters)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_channels(
    path: Path, effects: Mapping[str, Mapping[str, Any]], channels: Mapping[str, Mapping[str, float]],
    notes: Sequence[str],
) -> None:  # fmt: skip
    """Write the result of a comparison of sensors: effects, estimated parameters by model, and comments ``notes``."""
    lines = [*(f"# {note}" for note in notes), *_tables("effects", effects), *_tables("channels", channels)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _tables(kind: str, tables: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines of the tables ``[kind.name]``, without empty ones."""
    return [line for name, table in tables.items() if table for line in ("", f"[{kind}.{name}]", *_entries(table))]


def _entries(table: Mapping[str, Any]) -> list[str]:
    return [f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items()]


def toml_key(key: str) -> str:
    """A TOML key, quoted where it has to be."""
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else json.dumps(key)


def toml_value(value: Any) -> str:
    """A TOML value; mappings become inline tables."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_key(k)} = {toml_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    if isinstance(value, str | bool):
        return json.dumps(value)
    return repr(float(value) if isinstance(value, float) else value)


def load_extension(path: Path) -> Extension:
    """Effects, parameters and nonparametric terms of an extension file.

    Raises
    ------
    UnusableError
        Not TOML; an unknown effect or parameter; a value out of bounds.
    """
    table = _read(path)
    theta, onsets = THETA.neutral(), {}
    for name, values in effect_tables(path).items():
        if ONSET_LOG in values:
            onsets[name] = str(values.pop(ONSET_LOG)), float(values.pop("onset_s", 0.0))
        try:
            THETA.set(theta, name, values)
        except (KeyError, ValueError) as error:
            raise UnusableError(f"{path}: effects.{name}: {error.args[0]}") from error
    parameters = {}
    for name, values in table.get("parameters", {}).items():
        if odd := unknown_keys([name], PARAMETER.sizes):
            raise UnusableError(f"{path}: parameters: {odd}")
        parameters[name] = [float(v) for v in (values if isinstance(values, list) else [values])]
        expected, got = PARAMETER.sizes[name], len(parameters[name])
        if got != expected:
            raise UnusableError(f"{path}: parameters.{name}: expected {expected} values, got {got}")
    try:
        rows = read_laws(table.get("laws", []), f"{path}: laws")
    except EffectError as error:
        raise UnusableError(str(error)) from error
    return Extension(theta, parameters, rows, onsets)


def effect_tables(path: Path) -> dict[str, dict[str, Any]]:
    """The table ``[effects]`` as written, with today's names of all parameters.

    Raises
    ------
    UnusableError
        Not TOML, or an effect that is no table.
    """
    tables = _read(path).get("effects", {})
    for name, values in tables.items():
        if not isinstance(values, dict):
            raise UnusableError(f"{path}: effects.{name}: expected a table, got {values!r}; write [effects.{name}]")
    return {
        name: {_RENAMED.get((name, key), key): value for key, value in values.items()}
        for name, values in tables.items()
    }


def load_channels(path: Path) -> dict[str, dict[str, float]]:
    """Estimated parameters of ``[channels]``, by model.

    Raises
    ------
    UnusableError
        Not TOML, or an unknown model.
    """
    table = _read(path).get("channels", {})
    unknown = [name for name in table if name not in _CHANNEL_MODELS or not isinstance(table[name], dict)]
    if unknown:
        raise UnusableError(f"{path}: channels.{unknown[0]}: expected one of {', '.join(_CHANNEL_MODELS)}")
    return {name: {key: float(v) for key, v in values.items()} for name, values in table.items()}


def _read(path: Path) -> dict[str, Any]:
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UnusableError(f"{path}: not an extension file: {in_words(error)}") from error
    if odd := unknown_keys(table, _TABLES):
        raise UnusableError(f"{path}: {odd}")
    return table
