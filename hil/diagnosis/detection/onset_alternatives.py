"""Contenders that begin in the middle: the best are dated, and what begins when the best one does competes with it."""

from dataclasses import replace

from hil.diagnosis.detection.candidates import CandidateSet, candidate_key
from hil.diagnosis.detection.onset import estimate_onsets, onset_penalty, refine_onset
from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion, refit_substitutes
from hil.diagnosis.detection.result import INDISTINGUISHABLE
from hil.diagnosis.detection.score_test import shortlist
from hil.diagnosis.estimation.gauss_newton import Fitter, Model

_DATED = 2
"""Contenders for which it is asked when they begin before they are compared."""
_LIKE = 8
"""Others that are fitted from its beginning on: several act alike, and must be seen beside it."""
_LIKELY = 4.0 * INDISTINGUISHABLE
"""Twice the log of the odds, within which what begins when the best does is dated by itself."""


def estimate_onsets_of_best(fitter: Fitter, fitted: list[FittedHypothesis]) -> tuple[list[FittedHypothesis], Fitter]:
    """The best with the time they begin at: a law by time would explain more than a cause that was always there.

    The fitter comes back with the baseline of `estimate_onsets`.
    """
    best = sorted(fitted, key=criterion)[:_DATED]
    dated: dict[int, Model] = {}
    for one in best:
        dated[id(one)], fitter = estimate_onsets(fitter, one.model, one.noise)
    return [_dated(fitter, one, dated.get(id(one), one.model)) for one in fitted], fitter


def add_same_onset_alternatives(
    fitter: Fitter, field: CandidateSet, model: Model, fitted: list[FittedHypothesis]
) -> tuple[list[FittedHypothesis], Fitter]:
    """Beside a best that begins in the middle, others that begin when it does.

    As if always there they explained too little to be looked at. ``model`` has the causes before it. The fitter comes
    back with the baseline of `refine_onset`.
    """
    best = min(fitted, key=criterion)
    if best.term.onset is None:
        return fitted, fitter
    bare = fitter.at(best.model.z, model.terms, best.noise)
    tried = {candidate_key(c.term.candidate) for c in fitted if c.term.onset == best.term.onset}
    tried |= {candidate_key(term.candidate) for term in model.terms}
    listed = field.scores_from_onset(fitter, bare, best.noise, best.term.onset)
    top = shortlist([item for item in listed if candidate_key(item.candidate) not in tried], _LIKE)
    found = refit_substitutes(fitter, best, [(item.candidate, item.value) for item in top], True)
    near = [one for one in found if criterion(one) - criterion(best) < _LIKELY]
    dated: dict[int, Model] = {}
    for one in near:
        dated[id(one)], fitter = refine_onset(fitter, one.model, one.noise)
    return [*fitted, *(_dated(fitter, one, dated.get(id(one), one.model)) for one in found)], fitter


def _dated(fitter: Fitter, one: FittedHypothesis, model: Model) -> FittedHypothesis:
    """A contender with a model whose last cause may begin later."""
    if model is one.model:
        return one
    paid = 0.0 if model.terms[-1].onset is None else onset_penalty(fitter.masks)
    return replace(one, model=model, term=model.terms[-1], cost=model.cost, onset_penalty=paid)
