"""When a cause begins: at the manoeuvre from which on it is seen, then to the time within."""

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from hil.study.basis import Piece
from hil.study.fit import Fitter, Model, Term
from hil.study.linear import sums
from hil.study.noise import Noise
from hil.study.prepare import ROW_S
from hil.study.table import Floats

_ALPHA = 0.003
_TIMES, _ROUNDS = 7, 3
_LEAST_BEFORE = 3.0
"""Standard deviations that the cause would have shown before it begins, had it been there."""


def with_onsets(fitter: Fitter, model: Model, noise: Noise) -> Model:
    """The model with a beginning for each cause that was clearly absent before."""
    for k, term in enumerate(model.terms):
        if term.onset is None and not isinstance(term.candidate, Piece):
            later = _later(fitter, model, noise, k)
            model = model if later is None else later
    return model


def _later(fitter: Fitter, model: Model, noise: Noise, k: int) -> Model | None:
    b, q = _by_manoeuvre(fitter, model, noise, k)
    block = begin_of(b, q)
    if block is None:
        return None
    segments = fitter.rig.case.segments
    least = float(chi2.isf(_ALPHA / len(b), 1))
    (drive, before), (same, after) = segments[block - 1], segments[block]
    low, high = before.first, after.last if same == drive else before.last
    value = float(np.clip(b[block:].sum() / q[block:].sum(), *_bounds(model.terms[k])))
    best: Model | None = None
    from_s, to_s = low * ROW_S, high * ROW_S
    for _ in range(_ROUNDS):
        times = np.linspace(from_s, to_s, _TIMES)
        tried = [_begun(fitter, model, noise, k, value, drive, float(t)) for t in times]
        at = int(np.argmin([one.cost for one in tried]))
        best = tried[at] if best is None or tried[at].cost < best.cost else best
        from_s, to_s = float(times[max(at - 1, 0)]), float(times[min(at + 1, _TIMES - 1)])
    assert best is not None  # there was a round
    fitted = fitter.fit(best, noise, 3)
    return fitted if model.cost - fitted.cost > least else None


def _begun(
    fitter: Fitter, model: Model, noise: Noise, k: int, value: float, drive: int, since_s: float
) -> Model:  # fmt: skip
    changed = replace(model.terms[k], value=value, onset=(drive, since_s))
    return fitter.at(model.z, (*model.terms[:k], changed, *model.terms[k + 1 :]), noise)


def _by_manoeuvre(fitter: Fitter, model: Model, noise: Noise, k: int) -> tuple[Floats, Floats]:
    """Products of the cause's signature with what the data have beside all else, and with itself, by manoeuvre."""
    own = {name: values[:, k : k + 1] for name, values in fitter.term_columns(model).items()}
    matrix = sums(model.residual, own, fitter.frame, noise, 0).matrix
    q = matrix[:, 1, 1]
    return matrix[:, 0, 1] + q * model.terms[k].value, q


def begin_of(b: Floats, q: Floats) -> int | None:
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
    if abs(value) * np.sqrt(before) < _LEAST_BEFORE:
        return None
    gained = explained[block] - explained[0]
    return block if gained > float(chi2.isf(_ALPHA / len(b), 1)) else None


def _bounds(term: Term) -> tuple[float, float]:
    return term.candidate.parameter.low, term.candidate.parameter.high
