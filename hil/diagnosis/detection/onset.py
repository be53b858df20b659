"""When a cause begins: at the manoeuvre from which on it is seen, then to the time within."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from hil.diagnosis.data.dataset import ROW_S, Dataset, Segment
from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Term
from hil.diagnosis.estimation.information import information_blocks
from hil.diagnosis.estimation.model_discrepancy import variance_inflation
from hil.diagnosis.noise.model import Noise, SampleMasks

OnsetTime = tuple[int, float]
"""A time: which drive, and s in it."""
_ALPHA = 3e-4
_COARSE_S, _FINER, _MOST_TIMES = 0.25, (0.05, 0.01), 80
"""Steps of the time, s: what begins at once sets hubs swinging, so that only the neighbourhood of the truth fits."""
MIN_SNR_BEFORE_ONSET = 3.0
"""Standard deviations that the cause would have shown before it begins, had it been there."""


def estimate_onsets(fitter: Fitter, model: Model, noise: Noise) -> tuple[Model, Fitter]:
    """The model with a beginning for each cause that was clearly absent before, and for no other.

    A time that may be chosen is one more way to fit what the model gets wrong, and is asked for more than that.
    What was taken to begin, where the numbers still stood in for it, may always have been there. The fitter comes back
    with the baseline of the last time tried.
    """
    starts = segment_starts(fitter.simulator.dataset)
    for k, term in enumerate(model.terms):
        if isinstance(term.candidate, BasisFunction):
            continue
        if term.onset is None:
            later, fitter = _later(fitter, model, noise, k)
            model = model if later is None else later
        elif term.onset in starts:
            moments = _about(fitter, starts.index(term.onset))
            begun, fitter = _begun(fitter, model, noise, k, moments, term.value)
            begun = min(model, begun, key=_cost)
            always = fitter.fit(fitter.at(model.z, _since(model, k, term.value, None), noise), noise, 3)
            model = begun if begun.cost + onset_penalty(fitter.masks) < always.cost else always
    return model, fitter


def refine_onset(fitter: Fitter, model: Model, noise: Noise) -> tuple[Model, Fitter]:
    """The model with the beginning of its last cause where it fits best, near the one it has."""
    term = model.terms[-1]
    assert term.onset is not None
    drive, since_s = term.onset
    about = np.arange(max(since_s - _COARSE_S, 0.0), since_s + _COARSE_S, _FINER[0])
    moments = [(drive, float(t)) for t in about]
    begun, fitter = _begun(fitter, model, noise, len(model.terms) - 1, moments, term.value)
    return min(model, begun, key=_cost), fitter


def onset_penalty(frame: SampleMasks) -> float:
    """What of a gain goes to the choice of a time to begin at: twice the log of how many were offered."""
    return 2.0 * float(np.log(len(frame.log_start) * frame.sample_s / _COARSE_S))


def segment_starts(case: Dataset) -> list[OnsetTime]:
    """When each manoeuvre begins."""
    return [(drive, segment.first * ROW_S) for drive, segment in case.segments]


def nearest(starts: Sequence[OnsetTime], moment: OnsetTime) -> int:
    """Number of the manoeuvre, of the same drive, that begins nearest to a moment."""
    drive, since_s = moment
    return min((abs(start - since_s), number) for number, (of, start) in enumerate(starts) if of == drive)[1]


def _later(fitter: Fitter, model: Model, noise: Noise, k: int) -> tuple[Model | None, Fitter]:
    b, q = _by_manoeuvre(fitter, model, noise, k)
    block = detect_change_point(b, q)
    if block is None:
        return None, fitter
    value = float(np.clip(b[block:].sum() / q[block:].sum(), *_bounds(model.terms[k])))
    moments = _about(fitter, block)
    least = float(chi2.isf(_ALPHA / (len(b) * len(moments)), 1)) * variance_inflation(model.terms[k].candidate)
    fitted, fitter = _begun(fitter, model, noise, k, moments, value)
    return (fitted if model.cost - fitted.cost > least else None), fitter


def _about(fitter: Fitter, block: int) -> list[OnsetTime]:
    """Times to try for what is seen from a manoeuvre on."""
    segments = fitter.simulator.dataset.segments
    return moments_of(segments[block - 1], segments[block])


def _begun(
    fitter: Fitter, model: Model, noise: Noise, k: int, moments: list[OnsetTime], value: float
) -> tuple[Model, Fitter]:
    """The model with a cause that begins at the best of these times, or near it; the fitter with its baseline."""
    fitter = fitter.at_baseline(replace(model, terms=_since(model, k, value, moments[0])))
    seen: list[Model] = []
    for finer in (*_FINER, None):
        tried = ((fitter.at(model.z, _since(model, k, value, moment), noise), moment) for moment in moments)
        best, (drive, since_s) = min(tried, key=lambda one: _cost(one[0]))
        seen.append(best)
        if finer is not None:
            beside = min((abs(t - since_s) for d, t in moments if d == drive and t != since_s), default=finer)
            moments = [(drive, float(t)) for t in np.arange(max(since_s - beside, 0.0), since_s + beside, finer)]
    return fitter.fit(min(seen, key=_cost), noise, 3), fitter


def _cost(model: Model) -> float:
    return model.cost


def moments_of(before: tuple[int, Segment], after: tuple[int, Segment]) -> list[OnsetTime]:
    """Times to try, from the begin of the manoeuvre before to the end of the one after it, in one drive or in two."""
    (drive, first), (same, last) = before, after
    spans = [(drive, first.first, last.last)] if same == drive else [(d, s.first, s.last) for d, s in (before, after)]
    return [
        (number, float(t))
        for number, low, high in spans
        for t in np.linspace(low * ROW_S, high * ROW_S, _most(high - low))
    ]


def _since(model: Model, k: int, value: float, moment: OnsetTime | None) -> tuple[Term, ...]:
    """The terms of the model, one of them with another value, from a time on or always there."""
    changed = replace(model.terms[k], value=value, onset=moment)
    return (*model.terms[:k], changed, *model.terms[k + 1 :])


def _most(rows: int) -> int:
    """How many times are tried at first."""
    return int(np.clip(rows * ROW_S / _COARSE_S, 2, _MOST_TIMES)) + 1


def _by_manoeuvre(fitter: Fitter, model: Model, noise: Noise, k: int) -> tuple[Floats, Floats]:
    """Products of the cause's signature with what the data have beside all else, and with itself, by manoeuvre."""
    own = {name: values[:, k : k + 1] for name, values in fitter.term_jacobian(model).items()}
    matrix = information_blocks(model.residual, own, fitter.masks, noise, 0).matrix
    q = matrix[:, 1, 1]
    return matrix[:, 0, 1] + q * model.terms[k].value, q


def detect_change_point(b: Floats, q: Floats) -> int | None:
    """First manoeuvre in which a cause is seen; None where it may always have been there.

    Parameters
    ----------
    b, q : (manoeuvres,) products of its signature with the data and with itself.
    """
    after_b, after_q = np.cumsum(b[::-1])[::-1], np.cumsum(q[::-1])[::-1]
    explained = after_b**2 / np.maximum(after_q, 1e-30)
    block = int(np.argmax(explained))
    if block == 0 or after_q[block] <= 0.0:
        return None
    value = after_b[block] / after_q[block]
    before = float(q[:block].sum())
    if abs(value) * np.sqrt(before) < MIN_SNR_BEFORE_ONSET:
        return None
    gained = explained[block] - explained[0]
    return block if gained > float(chi2.isf(_ALPHA / len(b), 1)) else None


def _bounds(term: Term) -> tuple[float, float]:
    return term.candidate.parameter.low, term.candidate.parameter.high
