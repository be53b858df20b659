"""Profile fits: each shortlisted candidate fitted non-linearly, with nuisance parameters and noise refitted.

Takes a model and the score tests of the candidates for one more cause; gives a `FittedHypothesis` for each that is
worth a fit (`fit_shortlist`), and what compares hypotheses.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.detection.score_test import (
    ScoreTest,
    candidate_key,
    log_occam_factor,
    replayed_score,
    rescored,
    segment_starts,
    shortlist,
)
from hil.diagnosis.detection.threshold import (
    BIASED_SHORTLIST_SIZE,
    HOPELESS_SHARE,
    POOR_SHARE,
    SHORTLIST_SIZE,
    DetectionThreshold,
)
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model import Model, Term, Tracks
from hil.diagnosis.estimation.model_discrepancy import corrected_gain, variance_inflation
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.parallel import thread_map

_ROUNDS, _SETTLED, _SETTLED_SHARE = 4, 1.0, 0.01
"""Times that a hypothesis and its noise are fitted in turn, and the decrease of the cost that ends it: by itself, and
as a share of all that it gains."""
_NOISE_SETTLED = 2.0
"""Decrease of the cost by new noise below which the linear step is not repeated with it."""


@dataclass(frozen=True, eq=False)
class FittedHypothesis:
    """A model with one cause more, at one location.

    Attributes
    ----------
    term : the cause, the last of ``model``.  cost : of the model, -2 log likelihood.  noise : that remains given it.
    information : inverse variance of its value.
    gain : reduction of chi-squared, divided by the model discrepancy and by ``discrepancy_factor`` (of these logs),
        less `total_penalty`.
    onset_penalty : for the choice of its onset, in chi-squared.
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
        """What is subtracted from the gain for all that the data chose."""
        return self.onset_penalty + self.term.candidate.selection_penalty


def criterion(hypothesis: FittedHypothesis) -> float:
    """Minus twice the log of its marginal likelihood (of the Bayes factor, less a constant): smaller is better."""
    return hypothesis.cost + hypothesis.total_penalty - 2.0 * hypothesis.log_occam_factor


def delta_criterion(one: FittedHypothesis, best: FittedHypothesis) -> float:
    """Criterion behind the best, divided by what divides the best one's gain."""
    return (criterion(one) - criterion(best)) / _divisor(best)


def delta_chi2(one: FittedHypothesis, best: FittedHypothesis) -> float:
    """Chi-squared behind the best, divided likewise."""
    return (one.cost - best.cost) / _divisor(best)


def _divisor(best: FittedHypothesis) -> float:
    return best.discrepancy_factor if np.isfinite(best.discrepancy_factor) else 1.0


def rival_hypotheses(listed: Sequence[FittedHypothesis], named: Collection[str]) -> list[FittedHypothesis]:
    """The best of one step and what may be in its place, without effects that are ``named`` as other causes."""
    own = listed[0].term.candidate.effect.name
    others = [c for c in listed[1:] if (name := c.term.candidate.effect.name) == own or name not in named]
    return [listed[0], *others]


def at_bound(term: Term) -> bool:
    """Whether its value is at a bound of the parameter: there it explains more than it can be."""
    parameter = term.candidate.parameter
    return bool(np.isclose(term.value, (parameter.low, parameter.high), rtol=1e-6, atol=0.0).any())


def corrected(hypothesis: FittedHypothesis, raw: float) -> float:
    """A gain in chi-squared of a hypothesis, ``raw`` by noise alone, with the model discrepancy."""
    return corrected_gain(hypothesis.term.candidate, raw, hypothesis.term.value, hypothesis.term.onset is None)


def log_bayes_factor(hypothesis: FittedHypothesis) -> float:
    """Log Bayes factor of the cause against none, from the corrected gain.

    A parameter that data determine a thousand times better than its typical size has to gain more before a trace of it
    is accepted (Lindley 1957, Biometrika 44, 187).
    """
    return 0.5 * hypothesis.gain + hypothesis.log_occam_factor


def refitted(hypothesis: FittedHypothesis, model: Model, noise: Noise) -> FittedHypothesis:
    """The hypothesis with another fit."""
    term = model.terms[-1]
    information = 1.0 / max(float(model.covariance[-1, -1]), 1e-30) if model.covariance.size else hypothesis.information
    return replace(
        hypothesis,
        term=term,
        model=model,
        cost=model.cost,
        log_occam_factor=log_occam_factor(term.candidate, information, term.value),
        information=information,
        noise=noise,
    )


def refit_substitutes(
    fitter: Fitter, best: FittedHypothesis, others: Sequence[tuple[Candidate, float]], relinearise: bool
) -> list[FittedHypothesis]:
    """Other candidates, with start values, each in place of the best cause: fitted from its nuisance parameters, with
    its onset and noise."""

    def substituted(other: tuple[Candidate, float]) -> FittedHypothesis:
        candidate, value = other
        terms = (*best.model.terms[:-1], replace(best.term, candidate=candidate, value=value))
        model = fitter.refit_amplitudes(fitter.at(best.model.z, terms, best.noise), best.noise)
        return refitted(best, fitter.fit(model, best.noise, 3, relinearise), best.noise)

    return thread_map(substituted, others)


def refit_from_best(fitter: Fitter, fitted: Sequence[FittedHypothesis]) -> list[FittedHypothesis]:
    """Each hypothesis also fitted from the best one's end, with its onset; the better fit of the two.

    What acts alike ends alike: a fit that stopped early, or has a late onset given biased nuisance parameters, would be
    no rival.
    """
    best = min(fitted, key=criterion)
    others = [one for one in fitted if one is not best]
    again = refit_substitutes(fitter, best, [(one.term.candidate, one.term.value) for one in others], True)
    better = dict(zip(map(id, others), again, strict=True))
    return [min(one, better.get(id(one), one), key=criterion) for one in fitted]


class CandidateFits:
    """Fits of candidates for one more cause of ``model``.

    Parameters
    ----------
    jacobian : of all candidates at the last linearisation, tracks of (samples, columns).
    relinearise : whether fits renew the Jacobian of the terms.

    Attributes
    ----------
    noise, reference : noise of the model without a further cause, and its cost with it.
    """

    def __init__(self, fitter: Fitter, jacobian: Tracks, model: Model, noise: Noise, relinearise: bool) -> None:
        self._fitter, self._jacobian, self._model, self._relinearise = fitter, jacobian, model, relinearise
        self._accepted = fitter.term_jacobian(model) if model.terms else None
        self._starts = segment_starts(fitter.simulator.dataset)
        self.noise = self._likelier(model, fitter.estimate_noise(model, noise), noise)
        self.reference = fitter.cost(model.residual, model.z, self.noise)
        fitter.nuisance_information(self.noise)  # which all threads need

    def _likelier(self, model: Model, new: Noise, old: Noise) -> Noise:
        """The new noise unless the old was likelier: its parts are estimated in turn."""
        costs = [self._fitter.cost(model.residual, model.z, noise) for noise in (new, old)]
        return new if costs[0] < costs[1] else old

    def _extended(self, terms: Sequence[Term], jacobian: Tracks) -> tuple[Model, Tracks]:
        """The model with more terms of value 0, and the Jacobian of all its terms."""
        model = replace(self._model, terms=(*self._model.terms, *terms), covariance=np.zeros((0, 0)))
        if self._accepted is None:
            return model, jacobian
        return model, {name: np.hstack([self._accepted[name], values]) for name, values in jacobian.items()}

    def _term(self, item: ScoreTest) -> tuple[list[Term], Tracks]:
        """A candidate as a term of value 0, and its signature, zero before its onset."""
        at = list(item.candidate.columns)
        own = {name: values[:, at].sum(axis=1, keepdims=True) for name, values in self._jacobian.items()}
        if item.onset is not None:
            there = (np.asarray(self._fitter.masks.segment_id) >= self._starts.index(item.onset))[:, None]
            own = {name: np.where(there, values, 0.0) for name, values in own.items()}
        return [Term(item.candidate, 0.0, item.onset)], own

    def linear_prediction(self, terms: Sequence[Term], jacobian: Tracks) -> tuple[Model, Noise]:
        """The model with more terms by one linear step, and the noise that remains given them.

        Noise estimated without a cause explains much of a slow one. ``jacobian`` (samples, terms) is of the new terms.
        Of several, those that the data do not determine stay at typical sizes.
        """
        start, own = self._extended(terms, jacobian)
        prior = np.zeros(len(start.terms))
        if len(terms) > 1:
            prior[-len(terms) :] = [term.candidate.parameter.typical**-2 for term in terms]
        model, noise = self._fitter.linear_prediction(start, own, self.noise, prior), self.noise
        for last in (False, True):
            noise = self._likelier(model, self._fitter.estimate_noise(model, noise), noise)
            before, model = model.cost, replace(model, cost=self._fitter.cost(model.residual, model.z, noise))
            if last or before - model.cost < _NOISE_SETTLED:
                break
            model = self._fitter.linear_prediction(start, own, noise, prior)
        return model, noise

    def profile_over_noise(self, item: ScoreTest) -> tuple[ScoreTest, Noise]:
        """The score test with the noise that remains given the candidate, and that noise."""
        if item.replayed:
            model = self._fitter.at(self._model.z, (*self._model.terms, Term(item.candidate, item.value)), self.noise)
            noise = self._likelier(model, self._fitter.estimate_noise(model, self.noise), self.noise)
            raw = self.reference - self._fitter.cost(model.residual, model.z, noise)
            return replayed_score(item, item.value, max(raw, item.raw_gain)), noise
        model, noise = self.linear_prediction(*self._term(item))
        raw = max(self.reference - model.cost, item.raw_gain)
        information = 1.0 / max(float(model.covariance[-1, -1]), 1e-30)
        return rescored(item, model.terms[-1].value, raw, information), noise

    def fit(self, item: ScoreTest, noise: Noise) -> FittedHypothesis:
        """Fit a candidate from 0, or from the value of its replay, alternating with the noise that remains given it."""
        start, own = self._extended(*self._term(item))
        if item.replayed:
            term = Term(item.candidate, item.value)
            fitted = self._fitter.at(start.z, (*start.terms[:-1], term), noise)
            fitted = self._fitter.fit(fitted, noise, 3, self._relinearise)
        else:
            fitted = self._fitter.fit(start, noise, 3, self._relinearise, own)
        for _ in range(_ROUNDS):  # the noise gives back step by step what it explained of the cause
            noise = self._likelier(fitted, self._fitter.estimate_noise(fitted, noise), noise)
            before = self._fitter.cost(fitted.residual, fitted.z, noise)
            fitted = self._fitter.fit(fitted, noise, 2, self._relinearise)
            if before - fitted.cost < max(_SETTLED, _SETTLED_SHARE * (self.reference - fitted.cost)):
                break
        return refitted(unscored(fitted, noise, item.information, item.onset_penalty), fitted, noise)


def unscored(model: Model, noise: Noise, information: float, onset_penalty: float = 0.0) -> FittedHypothesis:
    """The last term of a model as a hypothesis, its Occam factor still 0."""
    return FittedHypothesis(model.terms[-1], model, model.cost, 0.0, information, noise, onset_penalty=onset_penalty)


Fitted = tuple[list[ScoreTest], list[FittedHypothesis]]
"""Shortlisted candidates and their fits."""


def fit_shortlist(
    fits: CandidateFits, tests: Sequence[ScoreTest], allowance: Callable[[Candidate], float],
    threshold: DetectionThreshold, biased: bool, progress: Callable[[str], None],
) -> Fitted:  # fmt: skip
    """Score the candidates again with their own noise and fit the best; none where none can be significant.

    Parameters
    ----------
    allowance : chi-squared that the form of the accepted causes may leave for a candidate.
    biased : whether the nuisance parameters may be biased, and with them the order of the candidates.
    """

    def beyond(item: ScoreTest, gain: float) -> float:
        return gain - allowance(item.candidate) / variance_inflation(item.candidate)

    def best(some: Sequence[ScoreTest]) -> float:
        return max((beyond(item, item.gain) for item in some), default=0.0)

    if best(tests) < HOPELESS_SHARE * threshold.gain:
        return [], []
    progress(f"noise given each of {len(tests)} candidates")
    profiled = thread_map(fits.profile_over_noise, tests, "noise given candidates", progress)
    noise_given = {id(item): noise for item, noise in profiled}
    tests = [item for item, _ in profiled]
    if biased:
        top = sorted(tests, key=lambda s: -s.log_bayes_factor)[:BIASED_SHORTLIST_SIZE]
    else:
        top = shortlist(tests, SHORTLIST_SIZE)
    if best(top) < POOR_SHARE * threshold.gain:
        return [], []
    least = threshold.uninflated_gain

    def fit_each(some: Sequence[ScoreTest]) -> list[FittedHypothesis]:
        progress(f"fitting {len(some)} candidates")
        return thread_map(lambda item: fits.fit(item, noise_given[id(item)]), some, "candidates fitted", progress)

    first = [item for item in top if biased or beyond(item, item.gain) >= POOR_SHARE * least]
    fitted = fit_each(first)
    gains = [corrected(c, fits.reference - c.cost) for c in fitted]
    rest = [item for item in top if item not in first]
    if rest and any(beyond(*one) >= least for one in zip(first, gains, strict=True)):
        return [*first, *rest], [*fitted, *fit_each(rest)]
    return first, fitted


def merge_best(some: Fitted, others: Fitted) -> Fitted:
    """Two shortlists with their fits as one; of what is in both the better fit."""
    best: dict[tuple[str, str, str], tuple[ScoreTest, FittedHypothesis]] = {}
    for item, one in (*zip(*some, strict=True), *zip(*others, strict=True)):
        name = candidate_key(item.candidate)
        if name not in best or criterion(one) < criterion(best[name][1]):
            best[name] = item, one
    return [item for item, _ in best.values()], [one for _, one in best.values()]
