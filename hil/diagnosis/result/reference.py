"""What reference logs taught of the car beside its vehicle set: effects that the logs since share with them.

Takes a diagnosis; gives them as ``reference`` of the JSON and as a section of the report.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.estimation.model_discrepancy import UNLISTED
from hil.diagnosis.result.moved_numbers import uncertainty
from hil.diagnosis.result.phrases import place
from hil.diagnosis.vehicle.priors import Nuisance, NuisanceKind
from hil.report.report import Section, Table
from plant.injection.theta import THETA

_CLEAR = 1.0
"""Half-widths of its 95 % interval that an effect is away from zero to be shown."""


@dataclass(frozen=True)
class Learned:
    """A listed effect as the reference and the other logs share it, with its 95 % interval, in ``unit``."""

    effect: str
    title: str
    location: str
    parameter: str
    unit: str
    value: float
    low: float
    high: float

    def as_json(self) -> dict[str, Any]:
        """Entry of ``reference.learned``."""
        return {
            "effect": self.effect, "location": self.location, "parameter": self.parameter, "unit": self.unit,
            "value": self.value, "ci95": [self.low, self.high],
        }  # fmt: skip


def learned(diagnosis: Diagnosis) -> list[Learned]:
    """Every common part that is away from zero, the clearest first."""
    half, _ = uncertainty(diagnosis)
    each = zip(diagnosis.fitter.nuisances, diagnosis.final.z, half, strict=True)
    clear = [
        (float(abs(z) / width), _of(nuisance, float(z), float(width)))
        for nuisance, z, width in each
        if nuisance.kind is NuisanceKind.LEARNED and abs(z) > _CLEAR * width
    ]
    return [one for _, one in sorted(clear, key=lambda pair: -pair[0])]


def _of(nuisance: Nuisance, z: float, half: float) -> Learned:
    named, location = nuisance.name.split("@")
    effect = THETA.effect(named.split(".")[0])
    parameter = effect.parameter(named.split(".")[1]) if "." in named else effect.strengths[0]
    step = nuisance.step[0]
    low, high = np.clip(((z - half) * step, (z + half) * step), parameter.low, parameter.high)
    return Learned(
        effect.name, effect.title, location, parameter.name, parameter.unit, z * step, float(low), float(high)
    )


def learned_curves(diagnosis: Diagnosis) -> list[str]:
    """Nonparametric terms, as ``friction.mu(speed)@front``, of which a coefficient is away from zero."""
    half, _ = uncertainty(diagnosis)
    each = zip(diagnosis.fitter.nuisances, diagnosis.final.z, half, strict=True)
    clear = (
        nuisance.name.removeprefix(f"{UNLISTED}.").rsplit(".", 1)
        for nuisance, z, width in each
        if nuisance.kind is NuisanceKind.LEARNED_CURVE and abs(z) > _CLEAR * width
    )
    return list(dict.fromkeys(f"{term}@{rest.split('@')[1]}" for term, rest in clear))


def reference_as_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """The entry ``reference``: names of its logs, and what they taught."""
    recordings = diagnosis.dataset.recordings[: diagnosis.reference]
    return {
        "logs": [one.log.name.removeprefix("reference ") for one in recordings],
        "learned": [one.as_json() for one in learned(diagnosis)],
        "learned_curves": learned_curves(diagnosis),
    }


def section(diagnosis: Diagnosis) -> tuple[Section, ...]:
    """What the reference taught, for people; empty without one."""
    if not diagnosis.reference:
        return ()
    rows = tuple(
        (
            one.title, place(one.location), one.parameter.replace("_", " "), float(f"{one.value:.3g}"),
            f"{one.low:.3g} to {one.high:.3g}", one.unit,
        )
        for one in learned(diagnosis)
    )  # fmt: skip
    text = (
        "What is explained is the change since these logs. What both share is no change: the numbers of the car, and "
        "the listed effects below, as which also count what the equations of the simulation get wrong."
    )
    if curves := learned_curves(diagnosis):
        text += f" Unknown functions that both share: {', '.join(curves)}."
    names = ", ".join(reference_as_json(diagnosis)["logs"])
    table = Table(
        f"Effects in the reference as in the logs since: {names}",
        ("effect", "where", "number", "value", "95 %", "unit"), rows,
    )  # fmt: skip
    return (Section("What the reference shows", tables=(table,) if rows else (), text=text),)
