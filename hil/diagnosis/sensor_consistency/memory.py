"""The extension file of a comparison of sensors: effects for simulations, numbers of the channels for the next look."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.sensor_consistency.labels import Cause
from hil.diagnosis.sensor_consistency.selection import SelectionResult
from plant.effects.effect import Scope
from plant.injection.theta import THETA

MODELS = ("along", "turning", "wheels", "braking")


def write_channels(path: Path, models: Mapping[str, SelectionResult], causes: Sequence[Cause]) -> None:
    """Write ``[effects]`` as far as the simulation can have them, and ``[channels]`` as learnt."""
    lines = [
        f"# Taught by a comparison of sensors: {', '.join(c.labels[0].effect for c in causes) or 'no effect'}",
        "# [effects] for `run --extend`; [channels] for `explain --extend`, which begins with these numbers.",
        "",
    ]
    tables: dict[str, dict[str, object]] = {}
    for cause in causes:
        name = cause.labels[0]
        effect = THETA.effect(name.effect)
        parameter = effect.parameter(name.parameter)
        value = name.factor * cause.value
        label = f"{name.effect}.{name.parameter} = {value:.6g} ({name.location}, {', '.join(cause.channels)})"
        if name.effect == "wrong_scale":
            lines.append(f"# not simulated: {label}: mend the channel map, not the car")
        elif cause.model == "braking" and name.effect != "timestamp_offset":
            lines.append(f"# not simulated: {label}: a number of that car")
        elif not parameter.low <= value <= parameter.high:
            lines.append(f"# not simulated: {label}: outside {parameter.low:g} to {parameter.high:g}")
        else:
            entry = tables.setdefault(name.effect, {})
            if effect.scope in (Scope.WHEEL, Scope.NODE, Scope.AXLE) and name.location in effect.scope.members:
                members = entry.setdefault(name.parameter, {})
                assert isinstance(members, dict)
                members[name.location] = value
            else:
                entry[name.parameter] = value
    for effect_name, entry in tables.items():
        lines += ["", f"[effects.{effect_name}]", *(f"{key} = {_toml(value)}" for key, value in entry.items())]
    for model, found in models.items():
        if found.parameters:
            lines += ["", f"[channels.{model}]", *(f"{n} = {v!r}" for n, v in found.parameters.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _toml(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {v!r}" for k, v in value.items()) + " }"
    return repr(value)


def load_channels(path: Path) -> dict[str, dict[str, float]]:
    """Numbers of ``[channels]``, by model.

    Raises
    ------
    UnusableError
        Not TOML, or a table nobody knows.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8")).get("channels", {})
    except (OSError, ValueError) as error:
        raise UnusableError(f"{path}: not an extension file: {error}") from error
    odd = [name for name in table if name not in MODELS or not isinstance(table[name], dict)]
    if odd:
        raise UnusableError(f"{path}: channels.{odd[0]}: expected one of {', '.join(MODELS)}")
    return {name: {n: float(v) for n, v in numbers.items()} for name, numbers in table.items()}
