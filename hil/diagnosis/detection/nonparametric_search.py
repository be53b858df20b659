"""Laws in no list, in the race for a cause: one that is ahead of all that is listed, beyond doubt."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.detection.form_error import FORM_ERROR, FormErrorAllowance
from hil.diagnosis.detection.group_score_test import (
    GroupScore,
    GroupScoreTest,
    best_of_each_term,
    fitted_hypothesis,
    group_detection_threshold,
)
from hil.diagnosis.detection.nonparametric import NONPARAMETRIC_TERMS, BasisFunction
from hil.diagnosis.detection.profile_fit import CandidateFits, FittedHypothesis, at_bound, criterion
from hil.diagnosis.detection.restart import RefitHypothesis
from hil.diagnosis.detection.result import Diagnosis, Progress, Settings
from hil.diagnosis.detection.shape import fit_shape_parameters
from hil.diagnosis.estimation.gauss_newton import Fitter, Model
from hil.diagnosis.estimation.model_discrepancy import variance_inflation_nonparametric
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.parallel import thread_map

NONPARAMETRIC_MARGIN = 5.0
"""By how much more than the best listed cause a law in no list must explain, log of the odds."""
_BESIDE, _TRIED = 4, 2
"""Laws that are looked at with noise of their own; and fitted, where the vehicle's numbers go far."""
Again = Callable[
    [Model, Sequence[FittedHypothesis], RefitHypothesis, float, int, float],
    tuple[list[FittedHypothesis], tuple[Model, Noise]],
]
"""Fits contenders from the car as handed in, too (`hil.diagnosis.detection.restart`)."""


@dataclass(frozen=True, eq=False)
class SelectionStep:
    """One round of the search: the model so far, the best ``listed`` cause beside it and what that ``left``.

    There is none ``listed`` where none is worth a fit; ``clear`` says whether any listed cause is beyond doubt.

    ``reference`` is the cost without a cause more, with the ``noise`` beside one; ``error`` says what a contender's
    gain is divided by; ``bent``, whether something may have bent the vehicle's numbers.
    """

    contest: CandidateFits
    model: Model
    noise: Noise
    reference: float
    listed: FittedHypothesis | None
    clear: bool
    left: FormErrorAllowance
    error: Callable[[Fitter, FittedHypothesis, FittedHypothesis], float]
    bent: bool


def is_preferred(
    law: FittedHypothesis, listed: FittedHypothesis | None, clear: bool, reference: float, asked: float
) -> bool:
    """Whether a law is ahead of the best listed cause, if there is one, and explains what is asked of it.

    A listed cause that is as far off as it may be is no rival to one that explains more. Where no listed one is beyond
    doubt (``clear``), the law is to be likelier than the best, but need not explain so much beside it.

    Parameters
    ----------
    reference : the cost without a cause more.  asked : of chi-squared, by which the law's cost is to be less.
    """
    known, rival = reference, 0.0
    if listed is not None and law.cost >= listed.cost:
        return False
    if listed is not None and not at_bound(listed.term):
        known = min(listed.cost, reference) if clear else reference
        rival = (1.0 + FORM_ERROR**2) * max(0.5 * (reference - criterion(listed)), 0.0)
    clearly = 0.5 * (reference - criterion(law)) >= rival + NONPARAMETRIC_MARGIN
    return clearly and known - law.cost >= asked


class NonparametricSearch:
    """The laws at a model, simulated once."""

    def __init__(self, numbers: NuisanceFit, settings: Settings, say: Progress) -> None:
        self._numbers, self._settings, self._say = numbers, settings, say
        self._race: GroupScoreTest | None = None

    def invalidate(self) -> None:
        """What laws show is asked for at another model from now on."""
        self._race = None

    def best(self, found: Diagnosis, now: SelectionStep, again: Again) -> FittedHypothesis | None:
        """The best law where it is ahead of the best listed cause, beyond noise and the model's own error.

        ``again`` fits laws from the car as handed in, too. A listed cause of another shape than the usual
        (`hil.diagnosis.detection.shape`) takes the place of a law that is not ahead of it.
        """
        model, reference = now.model, now.reference
        if not self._settings.dictionary or any(isinstance(term.candidate, BasisFunction) for term in model.terms):
            return None
        fitter = self._numbers.fitter
        if self._race is None:
            self._say("curves in no list")
            fitter = fitter.at_baseline(model)
            self._race = GroupScoreTest(fitter, fitter.parameter_set(model.z, model.terms))
        race = self._race
        entries, seen, fitter = self._seen(race, fitter, now)
        self._numbers.fitter = fitter

        def refitted_law(one: FittedHypothesis, model: Model, noise: Noise) -> FittedHypothesis:
            return fitted_hypothesis(entries[one.term.candidate.name], model, noise, reference)

        def replayed(one: FittedHypothesis) -> FittedHypothesis:
            met = fitter.at(one.model.z, one.model.terms, one.noise)
            return refitted_law(one, replace(met, covariance=one.model.covariance), one.noise)

        if now.bent:
            tried = [replayed(one) for one in sorted(seen, key=criterion)[:_TRIED]]
            best_listed = np.inf if now.listed is None else criterion(now.listed)
            seen, without = again(model, tried, refitted_law, reference, 1, best_listed)
            fitter = self._numbers.fitter
            reference = min(reference, without[0].cost)
        law = min(seen, key=criterion)
        best = entries[law.term.candidate.name]
        self._say(
            f"best curve: {best.expansion.term.name} at {best.expansion.location}, gain {reference - law.cost:.0f}"
        )
        least = self._asked(found, race, best, now.left)

        def stands(law: FittedHypothesis, listed: FittedHypothesis | None, clear: bool) -> bool:
            return is_preferred(law, listed, clear, reference, least * now.error(fitter, law, law))

        if stands(law, now.listed, now.clear) and self._settings.relinearise and not now.bent:
            (law,), without = again(model, [replayed(law)], refitted_law, reference, 1, np.inf)
            fitter = self._numbers.fitter
            reference = min(reference, without[0].cost)
        if not stands(law, now.listed, now.clear):
            return None
        fitted = fitter.fit(fitter.at(law.model.z, law.model.terms, law.noise), law.noise, 3)
        law = refitted_law(law, fitted, law.noise)
        if not stands(law, now.listed, now.clear):
            return None
        listed = [item.candidate for item in found.scores]
        shaped, fitter = fit_shape_parameters(now.contest, fitter, listed, law)
        self._numbers.fitter = fitter
        return law if shaped is None or stands(law, shaped, True) else shaped

    def _seen(
        self, race: GroupScoreTest, fitter: Fitter, now: SelectionStep
    ) -> tuple[dict[str, GroupScore], list[FittedHypothesis], Fitter]:
        """The best laws, by name, and by one linear step with the noise beside each; the fitter of `GroupScoreTest`."""
        entries, fitter = race.scores(fitter, now.model, now.noise)
        leading = best_of_each_term(entries, _BESIDE)
        contest = now.contest
        beside = thread_map(lambda entry: contest.linear_prediction(entry.terms, race.columns(entry)), leading)
        seen = [fitted_hypothesis(entry, *one, contest.reference) for entry, one in zip(leading, beside, strict=True)]
        return {law.term.candidate.name: entry for law, entry in zip(seen, leading, strict=True)}, seen, fitter

    def _asked(self, found: Diagnosis, race: GroupScoreTest, best: GroupScore, left: FormErrorAllowance) -> float:
        """Gain that is asked of a law: beyond noise, the model's own error, and what the causes so far leave."""
        least = (
            group_detection_threshold(found.number_of_tests + len(NONPARAMETRIC_TERMS), self._settings.alpha)
            * found.inflation
        )
        signature = {name: columns @ best.values[:, None] for name, columns in race.columns(best).items()}
        left_there = left.of_signature(best.expansion.functions[0].effect, signature)
        return least * variance_inflation_nonparametric(best.expansion.term.name, best.expansion.location) + left_there
