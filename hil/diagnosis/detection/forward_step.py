"""One step of the forward selection: from score tests to one cause more, a restart, or the end.

Takes the `State` of the selection; gives `Added`, `Restarted` or `Done`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.agreement import agrees
from hil.diagnosis.detection.at_bounds import candidates_at_bounds
from hil.diagnosis.detection.candidates import CandidateSet
from hil.diagnosis.detection.change_fits import fit_changes
from hil.diagnosis.detection.nonparametric_search import NonparametricSearch, SelectionStep
from hil.diagnosis.detection.onset import add_same_onset_alternatives, estimate_onsets_of_best
from hil.diagnosis.detection.profile_fit import (
    CandidateFits,
    Fitted,
    FittedHypothesis,
    corrected,
    criterion,
    fit_shortlist,
    merge_best,
    refit_from_best,
    refit_substitutes,
    refitted,
    unscored,
)
from hil.diagnosis.detection.restart import RefitHypothesis, Refits, refit_from_nominal
from hil.diagnosis.detection.result import Progress, Settings
from hil.diagnosis.detection.score_test import ScoreTest, candidate_key, inflation_factor, inflation_given_best
from hil.diagnosis.detection.significance import (
    FormErrorAllowance,
    LocalDiscrepancy,
    is_significant,
    is_significant_given,
    with_gain,
)
from hil.diagnosis.detection.threshold import (
    NEAR_SHARE,
    REFINED_INFLATION,
    RELINEARISED_RIVALS,
    RESTART_SHARE,
    DetectionThreshold,
)
from hil.diagnosis.estimation.gauss_newton import BIASED_BIRGE_RATIO, Fitter
from hil.diagnosis.estimation.information import InformationBlocks
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.progress import counted


@dataclass(frozen=True, eq=False)
class Screening:
    """No cause: the model with nuisance parameters and noise alone, and the score test of each candidate there.

    ``effective_parameters`` is the number of nuisance parameters that the data determine.
    """

    fitter: Fitter
    model: Model
    noise: Noise
    effective_parameters: float
    information: InformationBlocks
    scores: list[ScoreTest]


@dataclass(frozen=True, eq=False)
class Added:
    """A step that accepted a cause: the model with it, all hypotheses in its place (best first), and the chi-squared
    that it explains."""

    model: Model
    noise: Noise
    hypotheses: list[FittedHypothesis]
    explained: float
    threshold: DetectionThreshold


@dataclass(frozen=True, eq=False)
class Restarted:
    """A step that found better nuisance parameters for the same causes."""

    model: Model
    noise: Noise
    threshold: DetectionThreshold


@dataclass(frozen=True, eq=False)
class Done:
    """A step that found no further cause, and why."""

    reason: str
    threshold: DetectionThreshold


@dataclass(frozen=True, eq=False)
class State:
    """The selection between two steps.

    Attributes
    ----------
    model, noise : with the causes so far.  hypotheses : for each of its terms.
    candidates, nonparametric : linearised at the screening, or where the selection restarted.
    linearised_at : nuisance parameters of the last Jacobian.
    explained : chi-squared that the causes explain.  restarted : once is allowed.
    """

    screening: Screening
    candidates: CandidateSet
    nonparametric: NonparametricSearch
    threshold: DetectionThreshold
    model: Model
    noise: Noise
    linearised_at: Floats
    hypotheses: tuple[list[FittedHypothesis], ...] = ()
    explained: float = 0.0
    restarted: bool = False

    def with_cause(self, added: Added) -> "State":
        """With one cause more."""
        new_terms = len(added.model.terms) - len(self.model.terms)
        return replace(
            self,
            model=added.model,
            noise=added.noise,
            hypotheses=(*self.hypotheses, *([added.hypotheses] * new_terms)),
            explained=self.explained + added.explained,
        )


class ForwardStep:
    """A step from ``state``; ``nominal_fitter`` has the Jacobian at the nominal vehicle."""

    def __init__(
        self, state: State, nuisance_fit: NuisanceFit, nominal_fitter: Fitter, settings: Settings, progress: Progress
    ) -> None:
        self._state, self._nuisance_fit, self._nominal_fitter = state, nuisance_fit, nominal_fitter
        self._settings, self._progress = settings, progress
        self._biased = self._nuisances_may_be_biased()

    @property
    def _fitter(self) -> Fitter:
        """With the last Jacobian of the nuisance parameters, and the simulator of the fits to come."""
        return self._nuisance_fit.fitter

    @_fitter.setter
    def _fitter(self, fitter: Fitter) -> None:
        self._nuisance_fit.fitter = fitter

    def _nuisances_may_be_biased(self) -> bool:
        """Whether a cause may have biased the nuisance parameters of a model without any."""
        model = self._state.model
        far = self._settings.relinearise and not model.terms
        return far and self._fitter.birge_ratio(model.z) >= BIASED_BIRGE_RATIO

    def select(self) -> Added | Restarted | Done:
        """Fit the best candidates for one more cause; accept one, if one is significant."""
        step = self._fit_candidates()
        if isinstance(step, Restarted):
            return step
        best, self._fitter = self._state.nonparametric.best(
            self._fitter, step, self._refit_from_nominal, self._linearised_at
        )
        if best is not None:
            model, noise = self._fitter.alternate_noise_and_fit(best.model, best.noise, 1)
            return _added(step, best, model, noise, step.significant)
        best = self._best_significant(step)
        if best is None:
            return Done(_why_none(step), step.threshold)
        best, significant = self._refine_location(best, step.significant)
        model = self._fitter.fit(best.model, best.noise, 4, self._settings.relinearise)
        model, noise = self._fitter.alternate_noise_and_fit(model, best.noise, 2)
        others = (c for c in {*step.fitted, *significant} if c is not best)
        rest = [c for c in others if c in significant or criterion(c) >= criterion(best)]
        return _added(step, best, model, noise, sorted(rest, key=criterion))

    def _fit_candidates(self) -> SelectionStep | Restarted:
        """Fit the shortlist, from the nominal vehicle too and with onsets, and compute the gains."""
        state = self._state
        model, effective_parameters = state.model, state.screening.effective_parameters
        allowance = FormErrorAllowance(state.explained, self._fitter, model, state.noise, state.candidates.jacobian)
        fits, tests, fitted, threshold = self._fit_shortlist(allowance)
        discrepancy = LocalDiscrepancy(state.candidates, effective_parameters)
        reference, noise = fits.reference, fits.noise

        def with_gains() -> list[FittedHypothesis]:
            best, fitter = min(fitted, key=criterion), self._fitter
            factors = [discrepancy.factor(fitter, c, best, threshold) for c in fitted]
            return [
                with_gain(c, reference - allowance.of(c.term.candidate), factor)
                for c, factor in zip(fitted, factors, strict=True)
            ]

        if fitted and self._settings.relinearise:
            threshold = self._lowered_at_fit(threshold, state.candidates, fitted)
            if self._biased or max(one.gain for one in with_gains()) >= threshold.gain:
                fitted, (bare, bare_noise) = self._refit_near(model, fitted, tests, reference)
                improvement, best_gain = reference - bare.cost, bare.cost - min(c.cost for c in fitted)
                if not state.restarted and improvement > max(threshold.gain, RESTART_SHARE * best_gain):
                    return Restarted(bare, bare_noise, threshold)
                reference = min(reference, bare.cost)
            fitted, self._fitter = estimate_onsets_of_best(self._fitter, fitted)
            fitted, self._fitter = add_same_onset_alternatives(self._fitter, state.candidates, model, fitted)
            threshold = self._lowered_at_fit(threshold, state.candidates, fitted)
        elif fitted:
            fitted, self._fitter = estimate_onsets_of_best(self._fitter, fitted)
        if fitted:
            noise = min(fitted, key=criterion).noise
            reference = min(reference, self._fitter.fit(model, noise, 3).cost)
            fitted = with_gains()
        significant = [c for c in fitted if is_significant(c, threshold.gain, self._fitter, effective_parameters)]
        significant = [c for c in significant if agrees(self._fitter, c, threshold.gain)]
        significant.sort(key=criterion)
        return SelectionStep(
            model, noise, reference, threshold, fits, fitted, significant, allowance, discrepancy, self._biased
        )

    def _fit_shortlist(
        self, allowance: FormErrorAllowance
    ) -> tuple[CandidateFits, list[ScoreTest], list[FittedHypothesis], DetectionThreshold]:
        """The shortlist and its fits, empty where none can be significant; the threshold given the causes so far."""
        model, noise, candidates = self._state.model, self._state.noise, self._state.candidates
        screening, threshold = self._state.screening, self._state.threshold
        tests, blocks = screening.scores, screening.information
        if model.terms:
            blocks = self._fitter.information_blocks(model, candidates.jacobian, noise)
            self._fitter = self._fitter.at_baseline(model)
            tests = candidates.scores(self._fitter, blocks, model, noise)
            threshold = threshold.lowered(inflation_given_best(tests, blocks, self._fitter, model))
        tests = candidates.shortlist(self._fitter, tests, blocks, model, self._biased)
        fits = CandidateFits(self._fitter, candidates.jacobian, model, noise, self._settings.relinearise)
        fitted = fit_shortlist(fits, tests, allowance.of, threshold, self._biased, self._progress)
        if self._biased:
            fitted = self._add_fits_at_nominal(fitted, candidates, noise, allowance, threshold, fits.reference)
            fitted = merge_best(fitted, self._fit_beyond_bounds(model, noise))
        return fits, *fitted, threshold

    def _add_fits_at_nominal(
        self, first: Fitted, candidates: CandidateSet, noise: Noise, allowance: FormErrorAllowance,
        threshold: DetectionThreshold, reference: float,
    ) -> Fitted:  # fmt: skip
        """A ``first`` shortlist, and that at the nominal vehicle, where no nuisance parameter has absorbed a cause.

        Where neither explains enough, changes since reference logs are fitted with the car held (`change_fits`).
        """
        self._progress("Jacobian at the nominal vehicle")
        fitter = self._nominal_fitter.with_simulator(self._fitter.simulator)
        nominal = fitter.at(fitter.origin, (), noise)
        fitter = fitter.at_baseline(nominal)
        self._fitter = self._fitter.with_simulator(fitter.simulator)
        candidates = candidates.at(fitter, nominal, self._progress)
        blocks = fitter.information_blocks(nominal, candidates.jacobian, noise)
        tests = candidates.scores(fitter, blocks, nominal, noise)
        tests = candidates.shortlist(fitter, tests, blocks, nominal, False)
        fits = CandidateFits(fitter, candidates.jacobian, nominal, noise, self._settings.relinearise)
        both = merge_best(first, fit_shortlist(fits, tests, allowance.of, threshold, False, self._progress))
        enough = any(corrected(one, reference - one.cost) >= threshold.gain for one in both[1])
        if enough or not self._settings.relinearise:
            return both
        _, guess = fitter.start(noise.enabled)
        return merge_best(both, fit_changes(self._nuisance_fit, fitter, tests, guess, self._progress))

    def _fit_beyond_bounds(self, model: Model, noise: Noise) -> Fitted:
        """Quantities whose nuisance parameters are at their bounds, each as a cause fitted from the nominal vehicle.

        The first noise is a guess: what is not explained yet counts as noise. In the little noise that is left where
        nuisance parameters absorbed a cause, every step overshoots.
        """
        beyond = candidates_at_bounds(self._fitter, model, self._state.candidates.candidates)
        tests = {item.candidate: item for item in self._state.screening.scores}
        found: list[tuple[ScoreTest, FittedHypothesis]] = []
        if beyond and self._settings.relinearise:
            self._progress(f"fitting {len(beyond)} quantities that are at their bounds, from the nominal vehicle")
        last, nominal = self._fitter, self._nominal_fitter.with_simulator(self._fitter.simulator)
        _, guess = nominal.start(noise.enabled)
        tried = beyond if self._settings.relinearise else []
        for candidate in counted(self._progress, "quantities at their bounds", tried, len(tried)):
            self._fitter = nominal.copy()
            start = nominal.at(nominal.origin, (Term(candidate, 0.0),), guess)
            fitted, own = self._nuisance_fit.fit(start, guess)
            item = tests[candidate]
            found.append((item, refitted(unscored(fitted, own, item.information), fitted, own)))
        self._fitter = last
        return [item for item, _ in found], [one for _, one in found]

    def _lowered_at_fit(
        self, threshold: DetectionThreshold, candidates: CandidateSet, fitted: list[FittedHypothesis]
    ) -> DetectionThreshold:
        """By the inflation given the best as fitted, which releases nuisance parameters that it had biased."""
        if threshold.inflation <= REFINED_INFLATION:
            return threshold
        best = min(fitted, key=criterion)
        return threshold.lowered(inflation_factor(candidates.scores_given(self._fitter, best.model, best.noise)))

    def _refit_near(
        self, model: Model, fitted: list[FittedHypothesis], tests: list[ScoreTest], reference: float
    ) -> Refits:
        """The hypotheses, those that explain much fitted from the nominal vehicle too; the best fit without any."""
        explained = [max(item.raw_gain, reference - c.cost) for c, item in zip(fitted, tests, strict=True)]
        least = 0.0 if self._biased else NEAR_SHARE * max(explained)
        near = [c for c, gain in zip(fitted, explained, strict=True) if gain >= least]
        (refits, without), self._fitter = self._refit_from_nominal(
            self._fitter, model, near, refitted, reference, RELINEARISED_RIVALS
        )
        better = dict(zip(map(id, near), refit_from_best(self._fitter, refits), strict=True))
        return [better.get(id(c), c) for c in fitted], without

    def _refit_from_nominal(
        self, fitter: Fitter, model: Model, fitted: Sequence[FittedHypothesis], refit: RefitHypothesis,
        reference: float, relinearised: int, rival_criterion: float = np.inf,
    ) -> tuple[Refits, Fitter]:  # fmt: skip
        """See `hil.diagnosis.detection.restart`; the fitter comes back with inputs denoised by ``model``."""
        self._fitter = fitter
        self._progress("fitting again from the nominal vehicle")
        refits = refit_from_nominal(
            self._nuisance_fit, fitted, model, refit, reference, relinearised, rival_criterion, self._progress
        )
        return refits, self._fitter.denoised(model)

    def _linearised_at(self, fitter: Fitter, model: Model) -> Fitter:
        """With the Jacobian of the nuisance parameters at a model."""
        self._fitter = fitter
        self._nuisance_fit.relinearise_cached(model.z, model.terms)
        return self._fitter

    def _best_significant(self, step: SelectionStep) -> FittedHypothesis | None:
        """The best significant hypothesis, also given a better one that is not significant."""
        better, effective_parameters = step.best, self._state.screening.effective_parameters
        given = step.threshold.gain, self._fitter, effective_parameters, self._settings.relinearise
        for one in step.significant:
            if better is None or one is better or is_significant_given(one, better, *given):
                return one
        return None

    def _refine_location(
        self, best: FittedHypothesis, significant: list[FittedHypothesis]
    ) -> tuple[FittedHypothesis, list[FittedHypothesis]]:
        """The best at the location where it fits best: the screening depends on the nuisance parameters there."""
        name = candidate_key(best.term.candidate)
        same = [item for item in self._state.screening.scores if candidate_key(item.candidate)[:2] == name[:2]]
        own = (item.raw_gain for item in same if item.candidate is best.term.candidate)
        least = NEAR_SHARE * max(own, default=np.inf)
        others = [
            item.candidate for item in same if item.candidate is not best.term.candidate and item.raw_gain >= least
        ]
        if not self._settings.relinearise or not others:
            return best, significant
        self._progress(f"{best.term.candidate.name} at other locations")
        placed = refit_substitutes(self._fitter, best, [(other, best.term.value) for other in others], True)
        placed = [*significant, *placed]
        better = [
            one
            for one in placed
            if candidate_key(one.term.candidate)[:2] == name[:2] and criterion(one) < criterion(best)
        ]
        return min(better, key=criterion, default=best), placed


def _added(
    step: SelectionStep, best: FittedHypothesis, model: Model, noise: Noise, others: list[FittedHypothesis]
) -> Added:
    """The best hypothesis, with its final fit, accepted before others."""
    hypotheses = [replace(best, model=model, term=model.terms[-1]), *others]
    return Added(model, noise, hypotheses, step.reference - best.cost, step.threshold)


def _why_none(step: SelectionStep) -> str:
    best = step.best
    if best is None:
        return "no candidate can reach the detection threshold"
    if step.significant:
        return f"{best.term.candidate.name} explains more, is not significant, and given it no other cause is"
    most = max(step.fitted, key=lambda c: c.gain)
    return f"{most.term.candidate.name} gains {most.gain:.1f}, the detection threshold is {step.threshold.gain:.1f}"
