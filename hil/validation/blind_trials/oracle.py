"""The oracle: held-out error of a model that knows what was hidden, against which the gain is measured."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hil.study.explain import explain
from hil.study.fitting.candidates import candidates, columns
from hil.study.fitting.fit import Fitter
from hil.study.search.diagnosis import Diagnosis, Settings
from hil.study.verdict.answer import Answer
from hil.study.verdict.measure import gains
from hil.study.verdict.patterns import WORDS
from hil.validation.blind_trials.names import numbers
from hil.validation.reference_car.case import Case
from hil.validation.reference_car.files import write

Errors = dict[str, float]
"""Root mean square by channel, in the units of the answer's ``gain``."""


def told(found: Diagnosis, hidden: Mapping[str, Any]) -> Errors | None:
    """Error of the plant given the true effect at its true size, the vehicle's numbers fitted.

    Parameters
    ----------
    found : a diagnosis of the logs: its drives, folds and noise are used.
    hidden : the cause of the sealed answer.

    Returns
    -------
    None where the plant has no such number (an amplitude at a phase, an effect that only the reference car has).
    """
    places = {(c.effect.name, c.parameter.name, c.place): c for c in candidates(columns())}
    base = found.fitter.base
    for name, value in numbers(hidden).items():
        candidate = places.get((hidden["effect"], name, hidden["wheel"]))
        if candidate is None:
            return None
        base = candidate.applied(base, value)
    own = found.fitter
    fitter = Fitter(own.rig, own.frame, base, own.nuisances, own.nuisance_columns)
    model = fitter.fit(fitter.at(found.base.z, (), found.noise), found.noise, 3)
    model, noise = fitter.settle(model, found.noise, 1)
    known = replace(found, fitter=fitter, noise=noise, base=model, final=model, contenders=[])
    return {WORDS[gain.channel]: gain.after for gain in gains(known)}


def untouched(case: Case) -> Errors:
    """Error of the plant on the same drives with nothing hidden: what a law that it cannot be given would leave."""
    with TemporaryDirectory() as folder:
        logs = Path(folder) / "logs"
        write(replace(case, hidden=()), logs)
        answered = explain(logs, logs / "vehicle.toml", settings=Settings(most_causes=0))
    assert isinstance(answered, Answer)  # the reference car's logs tell forces
    return {WORDS[gain.channel]: gain.after for gain in answered.gains}
