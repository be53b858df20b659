"""The extension file: what a diagnosis taught, as TOML that ``explain --extend`` and ``run --extend`` take."""

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hil.diagnosis.data.log import Floats, UnusableError
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.scenario.effects import EffectError, read_laws, written_laws
from plant.injection.bank import NO_TERMS
from plant.injection.theta import THETA
from plant.vectors import PARAMETER


@dataclass(frozen=True, eq=False)
class Extension:
    """Theta of the effects, numbers of the vehicle by flat name and place that the fit moved, rows of unlisted laws."""

    theta: Floats
    parameters: Mapping[str, list[float]]
    nonparametric_rows: Floats = field(default_factory=NO_TERMS.copy)

    def applied(self, world: ParameterSet) -> ParameterSet:
        """A world with the extension."""
        p = world.p.copy()
        for name, values in self.parameters.items():
            p[PARAMETER.slice(name)] = values
        neutral = THETA.neutral()
        moved = self.theta != neutral
        theta = world.theta.copy()
        theta[moved] = self.theta[moved]
        return replace(
            world, p=p, theta=theta, nonparametric_rows=np.vstack([world.nonparametric_rows, self.nonparametric_rows])
        )


def write_extension(path: Path, handed_in: ParameterSet, extended: ParameterSet, note: str) -> None:
    """Write what the extended world has and the one handed in has not."""
    lines = [
        f"# {note}",
        "# Effects by name, then the vehicle's numbers within their tolerance as the data have them.",
        "",
    ]
    neutral = THETA.neutral()
    for effect in THETA.effects:
        entries = []
        for parameter in effect.parameters:
            where = THETA.slice(effect.name, parameter.name)
            values = extended.theta[where]
            if np.any(values != neutral[where]):
                members = effect.scope.members
                shown = (
                    repr(float(values[0])) if len(values) == 1
                    else "{ " + ", ".join(f"{m} = {float(v)!r}" for m, v in zip(members, values, strict=True)) + " }"
                )  # fmt: skip
                entries.append(f"{parameter.name} = {shown}")
        for time in ("onset_s", "until_s"):
            value = float(extended.theta[THETA.slice(effect.name, time)][0])
            if entries and abs(value) < 1e11:
                entries.append(f"{time} = {value!r}")
        if entries:
            lines += [f"[effects.{effect.name}]", *entries, ""]
    for law in written_laws(extended.nonparametric_rows):
        lines += ["[[laws]]", *(f"{name} = {json.dumps(value)}" for name, value in law.items()), ""]
    moved = extended.p != handed_in.p
    if moved.any():
        lines.append("[parameters]")
        for name in PARAMETER.sizes:
            where = PARAMETER.slice(name)
            if moved[where].any():
                lines.append(f"{name} = {json.dumps([float(v) for v in extended.p[where]])}")
        lines.append("")
    path.write_text("\n".join(lines), encoding="utf-8")


def load_extension(path: Path) -> Extension:
    """Read an extension file.

    Raises
    ------
    UnusableError
        Not TOML, an unknown effect or number, a value out of bounds.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UnusableError(f"{path}: not an extension file: {error}") from error
    theta = THETA.neutral()
    for name, values in table.get("effects", {}).items():
        try:
            THETA.set(theta, name, values)
        except (KeyError, ValueError) as error:
            raise UnusableError(f"{path}: effects.{name}: {error.args[0]}") from error
    parameters = {}
    for name, values in table.get("parameters", {}).items():
        if name not in PARAMETER.sizes:
            raise UnusableError(f"{path}: parameters: no number {name!r} in the plant")
        numbers = [float(v) for v in (values if isinstance(values, list) else [values])]
        if len(numbers) != PARAMETER.sizes[name]:
            raise UnusableError(
                f"{path}: parameters.{name}: expected {PARAMETER.sizes[name]} numbers, got {len(numbers)}"
            )
        parameters[name] = numbers
    try:
        terms = read_laws(table.get("laws", []), f"{path}: laws")
    except EffectError as error:
        raise UnusableError(str(error)) from error
    return Extension(theta, parameters, terms)
