"""The car as diagnosed: written as an extension file, and taken from one to start the next diagnosis from."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.simulation.parameter_set import ParameterSet, nominal
from hil.diagnosis.vehicle.extension_file import load_extension, write_extension
from hil.diagnosis.vehicle.priors import NuisanceKind
from hil.diagnosis.vehicle.spec import Vehicle
from plant.injection.theta import THETA


def extended_car(vehicle: Vehicle, path: Path, dataset: Dataset) -> tuple[ParameterSet, list[str]]:
    """The vehicle with an extension file, and remarks on effects whose onset is in no log of the dataset.

    Raises
    ------
    hil.diagnosis.data.log.UnusableError
        An extension file that cannot be used.
    """
    extension, logs = load_extension(path), [recording.log.name for recording in dataset.recordings]
    remarks = [
        f"{path}: {THETA.effect(effect).title}: begins in {log}, which is not among these logs; it acts throughout them"
        for effect, (log, _) in extension.onsets.items()
        if log not in logs
    ]
    return nominal(vehicle).with_extension(extension, logs), remarks


def write_extended_car(diagnosis: Diagnosis, folder: Path) -> str:
    """Write the causes and the estimated nuisances as ``extension.toml``; its path.

    Sensor zeros belong to these logs alone and are left out. Since a reference, it is the car as it is now.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "extension.toml"
    fitter, final = diagnosis.fitter, diagnosis.final
    kept = [nuisance.kind is NuisanceKind.LEARNED for nuisance in fitter.nuisances]
    causes = fitter.parameter_set(np.where(kept, final.z, 0.0), final.terms).changed()
    extended = replace(fitter.parameter_set(final.z, final.terms).changed(), theta=causes.theta)
    onsets, notes = _onsets(causes, diagnosis.dataset)
    theta, beyond = _within_bounds(causes.theta)
    extended = replace(extended, theta=theta)
    names = ", ".join(term.candidate.name for term in final.terms) or "no effect"
    head = f"Estimated from {len(diagnosis.dataset.recordings)} logs: {names}"
    extension = replace(extended.extension_of(nominal(diagnosis.vehicle)), onsets=onsets)
    write_extension(path, extension, (head, *notes, *beyond))
    return str(path)


def _within_bounds(theta: Floats) -> tuple[Floats, list[str]]:
    """Theta with every number inside its bounds, and comments on those that were beyond.

    A common part and a change are each inside; both together may not be, and no file is read with such a number.
    """
    inside, notes = theta.copy(), []
    for effect in THETA.effects:
        for parameter in effect.parameters:
            own = THETA.slice(effect.name, parameter.name)
            inside[own] = np.clip(theta[own], parameter.low, parameter.high)
            beyond = theta[own][inside[own] != theta[own]]
            if beyond.size:
                most = f"{beyond[np.abs(beyond).argmax()]:.4g} {parameter.unit}".strip()
                limits = f"{parameter.low:g} to {parameter.high:g}"
                notes.append(
                    f"{effect.name}.{parameter.name}: estimated as {most}, beyond {limits}; here at the limit."
                )
    return inside, notes


def _onsets(causes: ParameterSet, dataset: Dataset) -> tuple[dict[str, tuple[str, float]], list[str]]:
    """Log and s into it by effect, and comments that say what they mean."""
    onsets, notes = {}, []
    for effect in dict.fromkeys(one.effect for one in causes.onsets):
        own = [one for one in causes.onsets if one.effect == effect]
        first = own[0]
        log = dataset.recordings[first.recording].log.name
        if len(own) > 1 or any(first.before):
            notes.append(
                f"{effect} grows from {first.since_s:.2f} s of {log} on; here it acts throughout as it is then."
            )
            continue
        onsets[effect] = log, first.since_s
        notes += [
            f"{effect} begins {first.since_s:.2f} s into {log}: a scenario has it from that time of its clock on;",
            "  without onset_s and onset_log it acts throughout.",
        ]
    return onsets, notes
