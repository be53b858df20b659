"""Onset: the change point from which a cause acts; first the segment, then the time within.

Takes fitted models; gives them with an onset for each term that was clearly absent before (`estimate_onsets`), and adds
hypotheses that have the best one's onset (`add_same_onset_alternatives`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.dataset import ROW_S, Segment
from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.candidates import CandidateSet
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion, refit_substitutes
from hil.diagnosis.detection.score_test import OnsetTime, candidate_key, onset_penalty, segment_starts, shortlist
from hil.diagnosis.detection.threshold import (
    MIN_SNR_BEFORE_ONSET,
    ONSET_ALPHA,
    ONSET_STEP_S,
    ONSETS_OF_BEST,
    SAME_ONSET_ALTERNATIVES,
    SAME_ONSET_CRITERION,
    chi2_quantile,
)
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import information_blocks
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.estimation.model_discrepancy import variance_inflation
from hil.diagnosis.noise.model import Noise

_FINER_S, _MOST_TIMES = (0.05, 0.01), 80
"""Steps of the time after the first, s: an abrupt onset sets hubs swinging, so that only the neighbourhood of the truth
fits. Largest number of times in the first round."""


def estimate_onsets(fitter: Fitter, model: Model, noise: Noise) -> tuple[Model, Fitter]:
    """The model with an onset for each term that was clearly absent before, and for no other.

    A time that may be chosen is one more way to fit what the model gets wrong, so it has to gain more. A term with an
    onset from `scan_onset_by_segment` may always have been there: nuisance parameters may have absorbed it before. The
    fitter comes back with the baseline of the last times tried.
    """
    starts = segment_starts(fitter.simulator.dataset)
    for k, term in enumerate(model.terms):
        if isinstance(term.candidate, BasisFunction):
            continue
        if term.onset is None:
            later, fitter = _with_onset(fitter, model, noise, k)
            model = model if later is None else later
        elif term.onset in starts:
            times = _times_around(fitter, starts.index(term.onset))
            dated, fitter = _best_onset(fitter, model, noise, k, times, term.value)
            later = min(model, dated, key=_cost)
            always = fitter.fit(fitter.at(model.z, _with_term(model, k, term.value, None), noise), noise, 3)
            model = later if later.cost + onset_penalty(fitter.masks) < always.cost else always
    return model, fitter


def refine_onset(fitter: Fitter, model: Model, noise: Noise) -> tuple[Model, Fitter]:
    """The model with the onset of its last term where it fits best, near the one it has; the fitter likewise."""
    term = model.terms[-1]
    assert term.onset is not None
    recording, onset_s = term.onset
    near = np.arange(max(onset_s - ONSET_STEP_S, 0.0), onset_s + ONSET_STEP_S, _FINER_S[0])
    times = [(recording, float(t)) for t in near]
    dated, fitter = _best_onset(fitter, model, noise, len(model.terms) - 1, times, term.value)
    return min(model, dated, key=_cost), fitter


def nearest(starts: Sequence[OnsetTime], onset: OnsetTime) -> int:
    """Index of the segment, of the same recording, that starts nearest to an onset."""
    recording, onset_s = onset
    return min((abs(start - onset_s), index) for index, (of, start) in enumerate(starts) if of == recording)[1]


def _with_onset(fitter: Fitter, model: Model, noise: Noise, k: int) -> tuple[Model | None, Fitter]:
    b, q = _products_by_segment(fitter, model, noise, k)
    segment = detect_change_point(b, q)
    if segment is None:
        return None, fitter
    parameter = model.terms[k].candidate.parameter
    value = float(np.clip(b[segment:].sum() / q[segment:].sum(), parameter.low, parameter.high))
    times = _times_around(fitter, segment)
    least = chi2_quantile(len(b) * len(times), ONSET_ALPHA) * variance_inflation(model.terms[k].candidate)
    fitted, fitter = _best_onset(fitter, model, noise, k, times, value)
    return (fitted if model.cost - fitted.cost > least else None), fitter


def _times_around(fitter: Fitter, segment: int) -> list[OnsetTime]:
    """Times to try for a cause that shows from a segment on."""
    segments = fitter.simulator.dataset.segments
    return times_between(segments[segment - 1], segments[segment])


def _best_onset(
    fitter: Fitter, model: Model, noise: Noise, k: int, times: list[OnsetTime], value: float
) -> tuple[Model, Fitter]:
    """The model with the onset of a term at the best of these times, or near it; the fitter, the first its baseline."""
    fitter = fitter.at_baseline(replace(model, terms=_with_term(model, k, value, times[0])))
    best_of_each: list[Model] = []
    for finer_s in (*_FINER_S, None):
        tried = ((fitter.at(model.z, _with_term(model, k, value, time), noise), time) for time in times)
        best, (recording, onset_s) = min(tried, key=lambda one: _cost(one[0]))
        best_of_each.append(best)
        if finer_s is not None:
            step = min((abs(t - onset_s) for r, t in times if r == recording and t != onset_s), default=finer_s)
            times = [(recording, float(t)) for t in np.arange(max(onset_s - step, 0.0), onset_s + step, finer_s)]
    return fitter.fit(min(best_of_each, key=_cost), noise, 3), fitter


def _cost(model: Model) -> float:
    return model.cost


def times_between(before: tuple[int, Segment], after: tuple[int, Segment]) -> list[OnsetTime]:
    """Times to try, from the start of one segment to the end of the next, in one recording or in two."""
    (recording, first), (same, last) = before, after
    if same == recording:
        spans = [(recording, first.first, last.last)]
    else:
        spans = [(index, segment.first, segment.last) for index, segment in (before, after)]
    return [
        (index, float(t))
        for index, low, high in spans
        for t in np.linspace(low * ROW_S, high * ROW_S, _number_of_times(high - low))
    ]


def _with_term(model: Model, k: int, value: float, onset: OnsetTime | None) -> tuple[Term, ...]:
    """The terms of the model, one of them with another value and onset."""
    changed = replace(model.terms[k], value=value, onset=onset)
    return (*model.terms[:k], changed, *model.terms[k + 1 :])


def _number_of_times(rows: int) -> int:
    """Times tried at first in so many rows."""
    return int(np.clip(rows * ROW_S / ONSET_STEP_S, 2, _MOST_TIMES)) + 1


def _products_by_segment(fitter: Fitter, model: Model, noise: Noise, k: int) -> tuple[Floats, Floats]:
    """Products of a term's signature with the innovations without it, and with itself, (segments,) each."""
    own = {name: values[:, k : k + 1] for name, values in fitter.term_jacobian(model).items()}
    matrix = information_blocks(model.residual, own, fitter.masks, noise, 0).matrix
    q = matrix[:, 1, 1]
    return matrix[:, 0, 1] + q * model.terms[k].value, q


def detect_change_point(b: Floats, q: Floats) -> int | None:
    """First segment in which a cause acts; None where it may always have been there.

    Parameters
    ----------
    b, q : (segments,) products of its signature with the innovations and with itself.
    """
    b_after, q_after = np.cumsum(b[::-1])[::-1], np.cumsum(q[::-1])[::-1]
    gain = b_after**2 / np.maximum(q_after, 1e-30)
    segment = int(np.argmax(gain))
    if segment == 0 or q_after[segment] <= 0.0:
        return None
    value = b_after[segment] / q_after[segment]
    before = float(q[:segment].sum())
    if abs(value) * np.sqrt(before) < MIN_SNR_BEFORE_ONSET:
        return None
    return segment if gain[segment] - gain[0] > chi2_quantile(len(b), ONSET_ALPHA) else None


# --- hypotheses with an onset


def estimate_onsets_of_best(fitter: Fitter, fitted: list[FittedHypothesis]) -> tuple[list[FittedHypothesis], Fitter]:
    """The hypotheses, the best with an onset: without one a nonparametric term by time would explain more than they.

    The fitter comes back with the baseline of `estimate_onsets`.
    """
    best = sorted(fitted, key=criterion)[:ONSETS_OF_BEST]
    models: dict[int, Model] = {}
    for one in best:
        models[id(one)], fitter = estimate_onsets(fitter, one.model, one.noise)
    return [_with_model(fitter, one, models.get(id(one), one.model)) for one in fitted], fitter


def add_same_onset_alternatives(
    fitter: Fitter, candidates: CandidateSet, model: Model, fitted: list[FittedHypothesis]
) -> tuple[list[FittedHypothesis], Fitter]:
    """Where the best has an onset, the hypotheses and others with that onset.

    As ever-present ones these gain too little to be shortlisted. ``model`` has the causes accepted before. The fitter
    comes back with the baseline of `refine_onset`.
    """
    best = min(fitted, key=criterion)
    if best.term.onset is None:
        return fitted, fitter
    bare = fitter.at(best.model.z, model.terms, best.noise)
    tried = {candidate_key(c.term.candidate) for c in fitted if c.term.onset == best.term.onset}
    tried |= {candidate_key(term.candidate) for term in model.terms}
    tests = candidates.scores_from_onset(fitter, bare, best.noise, best.term.onset)
    top = shortlist([item for item in tests if candidate_key(item.candidate) not in tried], SAME_ONSET_ALTERNATIVES)
    added = refit_substitutes(fitter, best, [(item.candidate, item.value) for item in top], True)
    near = [one for one in added if criterion(one) - criterion(best) < SAME_ONSET_CRITERION]
    models: dict[int, Model] = {}
    for one in near:
        models[id(one)], fitter = refine_onset(fitter, one.model, one.noise)
    return [*fitted, *(_with_model(fitter, one, models.get(id(one), one.model)) for one in added)], fitter


def _with_model(fitter: Fitter, one: FittedHypothesis, model: Model) -> FittedHypothesis:
    """A hypothesis with a model whose last term may have an onset."""
    if model is one.model:
        return one
    penalty = 0.0 if model.terms[-1].onset is None else onset_penalty(fitter.masks)
    return replace(one, model=model, term=model.terms[-1], cost=model.cost, onset_penalty=penalty)
