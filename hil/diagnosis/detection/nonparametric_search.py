"""Nonparametric terms against the listed effects.

Takes what one step of the selection knows of the listed candidates (`SelectionStep`); gives a nonparametric term that
is preferred to all of them and significant, or none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.detection.group_score_test import GroupScoreTest, best_of_each_term, fitted_hypothesis
from hil.diagnosis.detection.nonparametric import BASIS_SIZE, NONPARAMETRIC_TERMS, BasisFunction
from hil.diagnosis.detection.profile_fit import CandidateFits, FittedHypothesis, at_bound, criterion, refitted
from hil.diagnosis.detection.restart import RefitHypothesis, Refits
from hil.diagnosis.detection.result import Progress, Settings
from hil.diagnosis.detection.shape import fit_shape_parameters, refit_shape_parameter
from hil.diagnosis.detection.significance import FormErrorAllowance, LocalDiscrepancy
from hil.diagnosis.detection.threshold import (
    FORM_ERROR,
    NONPARAMETRIC_MARGIN,
    NONPARAMETRIC_REFITTED,
    NONPARAMETRIC_WITH_OWN_NOISE,
    DetectionThreshold,
    chi2_quantile,
)
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model import Model
from hil.diagnosis.estimation.model_discrepancy import variance_inflation_nonparametric
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.parallel import thread_map

RefitFromNominal = Callable[
    [Fitter, Model, Sequence[FittedHypothesis], RefitHypothesis, float, int, float], tuple[Refits, Fitter]
]
"""See `hil.diagnosis.detection.restart`; the fitter comes back with inputs denoised by the model."""
LinearisedAt = Callable[[Fitter, Model], Fitter]
"""The fitter with the Jacobian of the nuisance parameters at a model."""


@dataclass(frozen=True, eq=False)
class SelectionStep:
    """One step of the selection, listed candidates fitted.

    Attributes
    ----------
    model : so far, with cost ``reference`` given ``noise``, the noise given the best candidate.
    threshold : as lowered by the step.
    fits : of the candidates.  fitted : those fitted, with their gains.  significant : of those, best first.
    allowance : chi-squared that the accepted causes may leave.  discrepancy : divisors of the gains.
    biased : whether the nuisance parameters may be.
    """

    model: Model
    noise: Noise
    reference: float
    threshold: DetectionThreshold
    fits: CandidateFits
    fitted: list[FittedHypothesis]
    significant: list[FittedHypothesis]
    allowance: FormErrorAllowance
    discrepancy: LocalDiscrepancy
    biased: bool

    @property
    def best(self) -> FittedHypothesis | None:
        """The best listed candidate, significant or not; None where none was worth a fit."""
        return min(self.fitted, key=criterion, default=None)


def is_preferred(
    one: FittedHypothesis, listed: FittedHypothesis | None, significant: bool, reference: float, least: float
) -> bool:
    """Whether a nonparametric term is preferred to the best listed cause, if there is one, and gains the ``least``.

    A listed cause at its bound is no rival to one that explains more. Where no listed one is ``significant``, the term
    must be more probable than the best, but need not gain the least beyond it.

    Parameters
    ----------
    reference : cost without a further cause.  least : in chi-squared.
    """
    known, rival = reference, 0.0
    if listed is not None and one.cost >= listed.cost:
        return False
    if listed is not None and not at_bound(listed.term):
        known = min(listed.cost, reference) if significant else reference
        rival = (1.0 + FORM_ERROR**2) * max(0.5 * (reference - criterion(listed)), 0.0)
    clearly = 0.5 * (reference - criterion(one)) >= rival + NONPARAMETRIC_MARGIN
    return clearly and known - one.cost >= least


class NonparametricSearch:
    """Nonparametric terms at one linearisation; they are simulated when first needed."""

    def __init__(self, candidates: Sequence[Candidate], settings: Settings, progress: Progress) -> None:
        self._candidates, self._settings, self._progress = candidates, settings, progress
        self._test: GroupScoreTest | None = None

    def best(
        self, fitter: Fitter, step: SelectionStep, refit_from_nominal: RefitFromNominal, linearised_at: LinearisedAt
    ) -> tuple[FittedHypothesis | None, Fitter]:
        """The best term, if it is preferred to the best listed cause and significant; the fitter of the last fits.

        A listed cause with another value of its shape parameter (`hil.diagnosis.detection.shape`) takes its place where
        the term is not preferred to that.
        """
        model = step.model
        if not self._settings.dictionary or any(isinstance(term.candidate, BasisFunction) for term in model.terms):
            return None, fitter
        if self._test is None:
            self._progress("simulating nonparametric terms")
            fitter = fitter.at_baseline(model)
            self._test = GroupScoreTest(fitter, fitter.parameter_set(model.z, model.terms))
        attempt = _Attempt(fitter, step, self._test, refit_from_nominal, linearised_at)
        one = attempt.best()
        self._progress(f"best nonparametric term: {attempt.text(one)}, gain {attempt.reference - one.cost:.0f}")
        least = attempt.least(one, self._settings.alpha)
        if attempt.is_preferred(one, least) and self._settings.relinearise and not step.biased:
            (one,) = attempt.refit([attempt.simulated(one)])
        if not attempt.is_preferred(one, least):
            return None, attempt.fitter
        fitter = attempt.fitter
        fitted = fitter.fit(fitter.at(one.model.z, one.model.terms, one.noise), one.noise, 3)
        one = attempt.hypothesis(one, fitted, one.noise)
        if not attempt.is_preferred(one, least):
            return None, attempt.fitter
        shaped, fitter = fit_shape_parameters(step.fits, fitter, self._candidates, one)
        attempt.fitter = fitter
        if shaped is not None and attempt.is_preferred_to(one, shaped, True, least):
            shaped = attempt.refit_shaped(shaped, one)
        if shaped is None or attempt.is_preferred_to(one, shaped, True, least):
            return one, attempt.fitter
        return shaped, attempt.fitter


class _Attempt:
    """Fits of nonparametric terms at one step.

    ``reference`` is the lowest cost seen without them, ``fitter`` has the baseline of the last fits.
    """

    def __init__(
        self, fitter: Fitter, step: SelectionStep, test: GroupScoreTest, refit_from_nominal: RefitFromNominal,
        linearised_at: LinearisedAt,
    ) -> None:  # fmt: skip
        self._step, self._test = step, test
        self._refit_from_nominal, self._linearised_at = refit_from_nominal, linearised_at
        self.reference = step.reference
        scores, self.fitter = test.scores(fitter, step.model, step.noise)
        tops = best_of_each_term(scores, NONPARAMETRIC_WITH_OWN_NOISE)
        fits = step.fits
        models = thread_map(lambda entry: fits.linear_prediction(entry.terms, test.jacobian(entry)), tops)
        self._predicted = [
            fitted_hypothesis(entry, *one, fits.reference) for entry, one in zip(tops, models, strict=True)
        ]
        names = (one.term.candidate.name for one in self._predicted)
        self._entries = dict(zip(names, tops, strict=True))

    def best(self) -> FittedHypothesis:
        """By one linear step with its own noise; simulated and fitted, where nuisance parameters may be biased."""
        if not self._step.biased:
            return min(self._predicted, key=criterion)
        tried = sorted(self._predicted, key=criterion)[:NONPARAMETRIC_REFITTED]
        listed = self._step.best
        return min(
            self.refit([self.simulated(one) for one in tried], np.inf if listed is None else criterion(listed)),
            key=criterion,
        )

    def hypothesis(self, one: FittedHypothesis, model: Model, noise: Noise) -> FittedHypothesis:
        """The same term with another fit."""
        return fitted_hypothesis(self._entries[one.term.candidate.name], model, noise, self.reference)

    def simulated(self, one: FittedHypothesis) -> FittedHypothesis:
        """A linear prediction, simulated."""
        model = self.fitter.at(one.model.z, one.model.terms, one.noise)
        return self.hypothesis(one, replace(model, covariance=one.model.covariance), one.noise)

    def refit(self, some: Sequence[FittedHypothesis], rival_criterion: float = np.inf) -> list[FittedHypothesis]:
        """From the nominal vehicle, too; that may lower the reference."""
        (refits, without), self.fitter = self._refit_from_nominal(
            self.fitter, self._step.model, some, self.hypothesis, self.reference, 1, rival_criterion
        )
        self.reference = min(self.reference, without[0].cost)
        return refits

    def refit_shaped(self, shaped: FittedHypothesis, one: FittedHypothesis) -> FittedHypothesis | None:
        """A listed cause with a shape, from the nominal vehicle and with a Jacobian of its own, as the term ``one``."""
        ((shaped,), _), fitter = self._refit_from_nominal(
            self.fitter, self._step.model, [shaped], refitted, self.reference, 1, np.inf
        )
        self.fitter = self._linearised_at(fitter, shaped.model)
        return refit_shape_parameter(self.fitter, shaped, one)

    def is_preferred(self, one: FittedHypothesis, least: float) -> bool:
        """To the best listed cause."""
        return self.is_preferred_to(one, self._step.best, bool(self._step.significant), least)

    def is_preferred_to(
        self, one: FittedHypothesis, listed: FittedHypothesis | None, significant: bool, least: float
    ) -> bool:
        """See `is_preferred`; ``least`` is divided over the local discrepancy."""
        factor = self._step.discrepancy.factor(self.fitter, one, one, self._step.threshold)
        return is_preferred(one, listed, significant, self.reference, least * factor)

    def least(self, one: FittedHypothesis, alpha: float) -> float:
        """Chi-squared that a term needs beyond noise, model discrepancy and what the accepted causes leave."""
        entry, threshold = self._entries[one.term.candidate.name], self._step.threshold
        tests = threshold.number_of_tests + len(NONPARAMETRIC_TERMS)
        least = chi2_quantile(tests, alpha, BASIS_SIZE) * threshold.inflation
        signature = {name: values @ entry.values[:, None] for name, values in self._test.jacobian(entry).items()}
        left = self._step.allowance.of_signature(entry.expansion.functions[0].effect, signature)
        return least * variance_inflation_nonparametric(entry.expansion.term.name, entry.expansion.location) + left

    def text(self, one: FittedHypothesis) -> str:
        """Term and location."""
        expansion = self._entries[one.term.candidate.name].expansion
        return f"{expansion.term.name} at {expansion.location}"
