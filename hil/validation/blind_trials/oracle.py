"""The oracle: held-out error of a model that knows what was hidden, against which the gain is measured."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hil.diagnosis.detection.result import Diagnosis, Settings
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.explain import explain
from hil.diagnosis.result.answer import Answer
from hil.diagnosis.result.cross_validation import held_out_error
from hil.diagnosis.result.residual_patterns import WORDS
from hil.validation.blind_trials.names import numbers
from hil.validation.reference_car.case import Case
from hil.validation.reference_car.files import write

Errors = dict[str, float]
"""Root mean square by channel, in the units of the answer's ``gain``."""


def true_model_error(found: Diagnosis, hidden: Mapping[str, Any]) -> Errors | None:
    """Error of the plant given the true effect at its true size, the vehicle's numbers fitted.

    Parameters
    ----------
    found : a diagnosis of the logs: its drives, folds and noise are used.
    hidden : the cause of the sealed answer.

    Returns
    -------
    None where the plant has no such number (an amplitude at a phase, an effect that only the reference car has).
    """
    places = {(c.effect.name, c.parameter.name, c.location): c for c in candidates(columns())}
    base = found.fitter.base
    for name, value in numbers(hidden).items():
        candidate = places.get((hidden["effect"], name, hidden["location"]))
        if candidate is None:
            return None
        base = candidate.applied(base, value)
    own = found.fitter
    fitter = Fitter(own.simulator, own.masks, base, own.nuisances, own.nuisance_jacobian)
    model = fitter.fit(fitter.at(found.base.z, (), found.noise), found.noise, 3)
    model, noise = fitter.alternate_noise_and_fit(model, found.noise, 1)
    known = replace(found, fitter=fitter, noise=noise, base=model, final=model, hypotheses=[])
    return {WORDS[gain.channel]: gain.after for gain in held_out_error(known)}


def untouched(case: Case) -> Errors:
    """Error of the plant on the same drives with nothing hidden: what a law that it cannot be given would leave."""
    with TemporaryDirectory() as folder:
        logs = Path(folder) / "logs"
        write(replace(case, hidden=()), logs)
        answered = explain(logs, logs / "vehicle.toml", settings=Settings(most_causes=0))
    assert isinstance(answered, Answer)  # the reference car's logs tell forces
    return {WORDS[gain.channel]: gain.after for gain in answered.held_out}
