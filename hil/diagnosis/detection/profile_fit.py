"""Candidates for one more cause of a model, each fitted with the noise that is left beside it."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.detection.onset import segment_starts
from hil.diagnosis.detection.score_test import ScoreTest, log_occam_factor, replayed_score, rescored
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Term, Tracks
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.parallel import thread_map

_ROUNDS, _SETTLED, _SETTLED_SHARE = 4, 1.0, 0.01
"""Times that a contender and its noise are fitted in turn, and how little less cost ends it: by itself, and as a share
of all that it explains."""
_STILL = 2.0
"""How little less cost other noise makes beside a linear step for that not to be made again."""


@dataclass(frozen=True, eq=False)
class FittedHypothesis:
    """A model that explains the data with one cause in a certain place: its term, cost and log of the odds.

    ``noise`` is what is left beside it; ``gained`` is what it takes off chi-squared, shared out over the model's own
    error, ``error`` what that was divided by beside the table's, ``price`` what the choice of its beginning takes off
    (`paid`: of whatever the data chose).
    """

    term: Term
    model: Model
    cost: float
    log_occam_factor: float
    information: float
    noise: Noise
    gain: float = 0.0
    discrepancy_factor: float = np.inf
    onset_penalty: float = 0.0

    @property
    def total_penalty(self) -> float:
        """What all that was chosen by the data takes off its gain."""
        return self.onset_penalty + self.term.candidate.selection_penalty


def criterion(contender: FittedHypothesis) -> float:
    """Twice the negative log of the odds, the smaller the better."""
    return contender.cost + contender.total_penalty - 2.0 * contender.log_occam_factor


def delta_criterion(one: FittedHypothesis, best: FittedHypothesis) -> float:
    """How much worse the odds of one are than those of the best in its place, shared out over the model's error.

    What divides a gain before it is believed divides the difference of two.
    """
    return (criterion(one) - criterion(best)) / _shared_by(best)


def delta_chi2(one: FittedHypothesis, best: FittedHypothesis) -> float:
    """How much worse one fits than the best in its place, in chi-squared, shared out likewise."""
    return (one.cost - best.cost) / _shared_by(best)


def _shared_by(best: FittedHypothesis) -> float:
    return best.discrepancy_factor if np.isfinite(best.discrepancy_factor) else 1.0


def rival_hypotheses(listed: Sequence[FittedHypothesis], named: Collection[str]) -> list[FittedHypothesis]:
    """The best of a race and what may be in its place, less what is named beside it: that is there anyway."""
    own = listed[0].term.candidate.effect.name
    others = [c for c in listed[1:] if (name := c.term.candidate.effect.name) == own or name not in named]
    return [listed[0], *others]


def at_bound(term: Term) -> bool:
    """Whether its value is as far off as it may be: there it explains more than it can be."""
    parameter = term.candidate.parameter
    return bool(np.isclose(term.value, (parameter.low, parameter.high), rtol=1e-6, atol=0.0).any())


def log_bayes_factor(contender: FittedHypothesis) -> float:
    """Log of the odds for the cause against none, by what it explains beyond the model's own error.

    A number that data tell a thousand times better than its usual size has to explain more before a trace of it is
    believed (Lindley 1957, Biometrika 44, 187).
    """
    return 0.5 * contender.gain + contender.log_occam_factor


def refitted(contender: FittedHypothesis, model: Model, noise: Noise) -> FittedHypothesis:
    """A contender with one cause as fitted otherwise."""
    term = model.terms[-1]
    information = 1.0 / max(float(model.covariance[-1, -1]), 1e-30) if model.covariance.size else contender.information
    evidence = log_occam_factor(term.candidate, information, term.value)
    return replace(
        contender,
        term=term,
        model=model,
        cost=model.cost,
        log_occam_factor=evidence,
        information=information,
        noise=noise,
    )


def refit_substitutes(
    fitter: Fitter, best: FittedHypothesis, others: Sequence[tuple[Candidate, float]], relinearise: bool
) -> list[FittedHypothesis]:
    """Other causes, or places, with values to begin at, each fitted from where the best ended, from its beginning on,
    with its noise."""

    def placed(other: tuple[Candidate, float]) -> FittedHypothesis:
        candidate, value = other
        terms = (*best.model.terms[:-1], replace(best.term, candidate=candidate, value=value))
        model = fitter.refit_amplitudes(fitter.at(best.model.z, terms, best.noise), best.noise)
        return refitted(best, fitter.fit(model, best.noise, 3, relinearise), best.noise)

    return thread_map(placed, others)


def refit_from_best(fitter: Fitter, fitted: Sequence[FittedHypothesis]) -> list[FittedHypothesis]:
    """Contenders, each fitted from where the best ended and begun when it does, too, where that explains more.

    What acts alike ends alike: a fit that stopped on its way, or began late beside numbers that stood in for the cause,
    would be no rival.
    """
    best = min(fitted, key=criterion)
    others = [one for one in fitted if one is not best]
    again = refit_substitutes(fitter, best, [(one.term.candidate, one.term.value) for one in others], True)
    better = dict(zip(map(id, others), again, strict=True))
    return [min(one, better.get(id(one), one), key=criterion) for one in fitted]


class CandidateFits:
    """One place for a cause in a model.

    ``columns`` are sensitivities to all candidates; ``noise`` and ``reference`` are those of the model without any.
    """

    def __init__(self, fitter: Fitter, columns: Tracks, model: Model, noise: Noise, relinearise: bool) -> None:
        self._fitter, self._columns, self._model, self._relinearise = fitter, columns, model, relinearise
        self._now = fitter.term_jacobian(model) if model.terms else None
        self._begins = segment_starts(fitter.simulator.dataset)
        self.noise = self._no_worse(model, fitter.estimate_noise(model, noise), noise)
        self.reference = fitter.cost(model.residual, model.z, self.noise)
        fitter.nuisance_information(self.noise)  # which all looks need

    def _no_worse(self, model: Model, new: Noise, old: Noise) -> Noise:
        """The new noise unless the old was likelier: its parts are estimated in turn."""
        costs = [self._fitter.cost(model.residual, model.z, noise) for noise in (new, old)]
        return new if costs[0] < costs[1] else old

    def _begun(self, terms: Sequence[Term], columns: Tracks) -> tuple[Model, Tracks]:
        """More terms in the model where they do nothing yet, and the sensitivities to all values."""
        begun = replace(self._model, terms=(*self._model.terms, *terms), covariance=np.zeros((0, 0)))
        if self._now is None:
            return begun, columns
        return begun, {name: np.hstack([self._now[name], values]) for name, values in columns.items()}

    def _of(self, item: ScoreTest) -> tuple[list[Term], Tracks]:
        """A candidate as a term, and its sensitivities; where it begins later, nothing before."""
        at = list(item.candidate.columns)
        own = {name: values[:, at].sum(axis=1, keepdims=True) for name, values in self._columns.items()}
        if item.onset is not None:
            there = (np.asarray(self._fitter.masks.segment_id) >= self._begins.index(item.onset))[:, None]
            own = {name: np.where(there, values, 0.0) for name, values in own.items()}
        return [Term(item.candidate, 0.0, item.onset)], own

    def linear_prediction(self, terms: Sequence[Term], columns: Tracks) -> tuple[Model, Noise]:
        """The model with more terms by one linear step, and the noise that is left beside them.

        Noise estimated without a cause takes much of a slow one for its own. ``columns`` (samples, terms) are
        sensitivities to the terms. Of several terms at once data may leave some open: they stay at usual sizes.
        """
        begun, own = self._begun(terms, columns)
        known = np.zeros(len(begun.terms))
        if len(terms) > 1:
            known[-len(terms) :] = [term.candidate.parameter.typical**-2 for term in terms]
        model, noise = self._fitter.linear_prediction(begun, own, self.noise, known), self.noise
        for last in (False, True):
            noise = self._no_worse(model, self._fitter.estimate_noise(model, noise), noise)
            before, model = model.cost, replace(model, cost=self._fitter.cost(model.residual, model.z, noise))
            if last or before - model.cost < _STILL:
                break
            model = self._fitter.linear_prediction(begun, own, noise, known)
        return model, noise

    def profile_over_noise(self, item: ScoreTest) -> tuple[ScoreTest, Noise]:
        """The candidate with the noise that is left beside it: by one linear step, or at the size of its replay."""
        if item.replayed:
            model = self._fitter.at(self._model.z, (*self._model.terms, Term(item.candidate, item.value)), self.noise)
            quieter = self._no_worse(model, self._fitter.estimate_noise(model, self.noise), self.noise)
            raw = self.reference - self._fitter.cost(model.residual, model.z, quieter)
            return replayed_score(item, item.value, max(raw, item.raw_gain)), quieter
        model, quieter = self.linear_prediction(*self._of(item))
        raw = max(self.reference - model.cost, item.raw_gain)
        information = 1.0 / max(float(model.covariance[-1, -1]), 1e-30)
        return rescored(item, model.terms[-1].value, raw, information), quieter

    def fit(self, item: ScoreTest, noise: Noise) -> FittedHypothesis:
        """A leader fitted from where it does nothing, or was replayed, with the noise that is left beside it."""
        begun, own = self._begun(*self._of(item))
        if item.replayed:
            term = Term(item.candidate, item.value)
            fitted = self._fitter.at(begun.z, (*begun.terms[:-1], term), noise)
            fitted = self._fitter.fit(fitted, noise, 3, self._relinearise)
        else:
            fitted = self._fitter.fit(begun, noise, 3, self._relinearise, own)
        for _ in range(_ROUNDS):  # what noise took for its own it gives back step by step
            noise = self._no_worse(fitted, self._fitter.estimate_noise(fitted, noise), noise)
            before = self._fitter.cost(fitted.residual, fitted.z, noise)
            fitted = self._fitter.fit(fitted, noise, 2, self._relinearise)
            if before - fitted.cost < max(_SETTLED, _SETTLED_SHARE * (self.reference - fitted.cost)):
                break
        begun_with = FittedHypothesis(
            fitted.terms[-1], fitted, fitted.cost, 0.0, item.information, noise, onset_penalty=item.onset_penalty
        )
        return refitted(begun_with, fitted, noise)
