"""Changes since reference logs, each fitted first with the car held as the reference shows it.

Beside a change dozens of common parts are free. With all of them free from the start a fit may end in a valley where
these have taken the change up (docs/decisions/reference-logs.md, A change first). So the change and the numbers of the
day are fitted alone, and the rest from there (block coordinate descent; Nocedal and Wright 2006, sec. 9.3).
"""

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion, refitted, unscored
from hil.diagnosis.detection.score_test import ScoreTest
from hil.diagnosis.detection.threshold import CHANGES_WITH_ALL_FREE
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model import Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.parallel import thread_map
from hil.diagnosis.progress import Progress
from hil.diagnosis.vehicle.priors import NuisanceKind

_OF_THE_DAY = (NuisanceKind.OF_THE_DAY, NuisanceKind.DISC_TEMPERATURE_OF_THE_DAY)
_ROUNDS, _STEPS, _PASSES = 3, 4, 2
"""Rounds of noise and steps with the car held, and passes with all free: a second one gains 36 in the example above."""


def fit_changes(
    nuisance_fit: NuisanceFit, origin: Fitter, tests: Sequence[ScoreTest], guess: Noise, progress: Progress
) -> tuple[list[ScoreTest], list[FittedHypothesis]]:
    """The best of these changes with all free; none where no nuisance parameter is of the day.

    Parameters
    ----------
    origin : a fitter with the Jacobian at its origin, the car that the reference shows.
    guess : of the noise, first: what is not explained yet counts as noise.
    """
    held = np.array([one.kind not in _OF_THE_DAY for one in origin.nuisances], bool)
    if held.all() or not tests:
        return [], []
    progress(f"fitting {len(tests)} changes with the car held as the reference shows it")

    def fit_held(item: ScoreTest) -> FittedHypothesis:
        fitter, noise = origin.holding(held), guess
        model = fitter.at(origin.origin, (Term(item.candidate, 0.0, item.onset),), noise)
        for _ in range(_ROUNDS):
            model = fitter.fit(model, noise, _STEPS, follow=True)
            noise = fitter.estimate_noise(model, noise)
        return refitted(unscored(model, noise, item.information, item.onset_penalty), fitter.fit(model, noise), noise)

    fitted = thread_map(fit_held, tests, "changes", progress)
    best = sorted(zip(tests, fitted, strict=True), key=lambda both: criterion(both[1]))[:CHANGES_WITH_ALL_FREE]
    found = []
    for item, one in best:
        own, model, noise = nuisance_fit.beginning_with(origin), one.model, one.noise
        for _ in range(_PASSES):
            own.relinearise(model.z, model.terms, noise)
            model, noise = own.fit(own.fitter.at(model.z, model.terms, noise), noise)
        found.append((item, refitted(one, model, noise)))
    return [item for item, _ in found], [one for _, one in found]
