"""Contenders that begin in the middle: the best are dated, and what begins when the best one does competes with it."""

from dataclasses import replace

from hil.diagnosis.detection.candidates import Field, number_of
from hil.diagnosis.detection.onset import dated_anew, price, with_onsets
from hil.diagnosis.detection.profile_fit import Contender, instead, odds
from hil.diagnosis.detection.result import TIED
from hil.diagnosis.detection.score_test import leaders
from hil.diagnosis.estimation.gauss_newton import Fitter, Model

_DATED = 2
"""Contenders for which it is asked when they begin before they are compared."""
_LIKE = 8
"""Others that are fitted from its beginning on: several act alike, and must be seen beside it."""
_LIKELY = 4.0 * TIED
"""Twice the log of the odds, within which what begins when the best does is dated by itself."""


def since_when(fitter: Fitter, fitted: list[Contender]) -> list[Contender]:
    """The best with the time they begin at: a law by time would explain more than a cause that was always there."""
    best = sorted(fitted, key=odds)[:_DATED]
    dated = {id(one): with_onsets(fitter, one.model, one.noise) for one in best}
    return [_dated(fitter, one, dated.get(id(one), one.model)) for one in fitted]


def with_its_like(fitter: Fitter, field: Field, model: Model, fitted: list[Contender]) -> list[Contender]:
    """Beside a best that begins in the middle, others that begin when it does.

    As if always there they explained too little to be looked at. ``model`` has the causes before it.
    """
    best = min(fitted, key=odds)
    if best.term.onset is None:
        return fitted
    bare = fitter.at(best.model.z, model.terms, best.noise)
    tried = {number_of(c.term.candidate) for c in fitted if c.term.onset == best.term.onset}
    tried |= {number_of(term.candidate) for term in model.terms}
    listed = field.begun_at(fitter, bare, best.noise, best.term.onset)
    top = leaders([item for item in listed if number_of(item.candidate) not in tried], _LIKE)
    found = instead(fitter, best, [(item.candidate, item.value) for item in top], True)
    near = [one for one in found if odds(one) - odds(best) < _LIKELY]
    dated = {id(one): dated_anew(fitter, one.model, one.noise) for one in near}
    return [*fitted, *(_dated(fitter, one, dated.get(id(one), one.model)) for one in found)]


def _dated(fitter: Fitter, one: Contender, model: Model) -> Contender:
    """A contender with a model whose last cause may begin later."""
    if model is one.model:
        return one
    paid = 0.0 if model.terms[-1].onset is None else price(fitter.frame)
    return replace(one, model=model, term=model.terms[-1], cost=model.cost, price=paid)
