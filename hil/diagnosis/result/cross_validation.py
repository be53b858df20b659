"""Cross-validation: the error on manoeuvres that no fit saw, nominal, extended, and with the best wrong effect."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.profile_fit import FittedHypothesis, delta_criterion
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Term, Tracks
from hil.diagnosis.estimation.information import information_blocks
from hil.diagnosis.noise.model import Noise, SampleMasks

FOLDS = 4
_DRAWS = 400
_TEMPERING = 1.5
"""Divisor of the criterion differences: two hypotheses differ less than an exact noise model would say."""


@dataclass(frozen=True)
class HeldOutError:
    """Root mean square residual of one channel, in its unit.

    Attributes
    ----------
    before : of the nominal vehicle.  after : of the extended model, held out; ``low`` to ``high`` is its 95 % interval.
    tuned : with nuisance parameters alone, held out.  best_wrong : with the best wrong effect, held out.
    """

    channel: str
    before: float
    after: float
    low: float
    high: float
    tuned: float
    best_wrong: float | None


def best_wrong(diagnosis: Diagnosis) -> FittedHypothesis | None:
    """The best hypothesis of another effect in place of the first cause; None where there is none."""
    if not diagnosis.hypotheses:
        return None
    right = diagnosis.final.terms[0].candidate.effect.name
    return next((c for c in diagnosis.hypotheses[0] if c.term.candidate.effect.name != right), None)


def folds(masks: SampleMasks) -> list[Floats]:
    """Training weights of each fold, (segments,) each; neighbours in time go to different folds."""
    count = int(np.max(masks.segment_id)) + 1
    parts = min(FOLDS, count)
    return [np.array([0.0 if k % parts == fold else 1.0 for k in range(count)]) for fold in range(parts)]


def held_out_residual(fitter: Fitter, noise: Noise, model: Model) -> Tracks:
    """Residual of every segment from a fit to the other folds, within the bounds of all parameters.

    That fit is the present one plus the change of one linear step by leaving the fold out: near the tyres' limit, where
    the cost is not quadratic, a full step would move on from the best fit with all segments, too.
    """
    masks = fitter.masks
    trained = folds(masks)
    if len(trained) < 2:
        return model.residual
    columns = dict(fitter.nuisance_jacobian)
    if model.terms:
        own = fitter.term_jacobian(model)
        columns = {name: np.hstack([values, own[name]]) for name, values in columns.items()}
    blocks = information_blocks(model.residual, columns, masks, noise, len(fitter.nuisances))
    out = {name: np.zeros_like(values) for name, values in model.residual.items()}
    segments = np.asarray(masks.segment_id, np.int64)
    z_of_all, of_all, *_ = fitter.moved(model, blocks.total())
    for weights in trained:
        z, terms, *_ = fitter.moved(model, blocks.total(weights))
        z = np.clip(model.z + z - z_of_all, fitter.lower, fitter.upper)
        terms = tuple(map(_changed, model.terms, terms, of_all))
        residual = fitter.residual(z, terms)
        test = weights[segments] < 0.5
        for name, values in residual.items():
            out[name][test] = values[test]
    return out


def _changed(now: Term, without: Term, of_all: Term) -> Term:
    """A term as fitted, changed by the difference of the steps without the fold and with all segments."""
    parameter = now.candidate.parameter
    return replace(now, value=float(np.clip(now.value + without.value - of_all.value, parameter.low, parameter.high)))


def held_out_error(diagnosis: Diagnosis) -> list[HeldOutError]:
    """Held-out error of every channel."""
    fitter, noise, masks = diagnosis.fitter, diagnosis.noise, diagnosis.fitter.masks
    wrong = best_wrong(diagnosis)
    after = held_out_residual(fitter, noise, diagnosis.final) if diagnosis.final.terms else None
    tuned = held_out_residual(fitter, noise, diagnosis.base)
    other = held_out_residual(fitter, noise, wrong.model) if wrong is not None else None
    errors = []
    for name in masks.names:
        before = _by_segment(diagnosis.nominal.residual[name], masks, name)
        own = _by_segment((after or tuned)[name], masks, name)
        low, high = _interval(own)
        errors.append(
            HeldOutError(
                name, _rms(before), _rms(own), low, high, _rms(_by_segment(tuned[name], masks, name)),
                None if other is None else _rms(_by_segment(other[name], masks, name)),
            )
        )  # fmt: skip
    return errors


def _by_segment(values: Floats, masks: SampleMasks, name: str) -> Floats:
    """Sums of squares and counts, (segments, 2)."""
    known = masks.present[name] > 0.5
    blocks = np.asarray(masks.segment_id, np.int64)[known]
    count = int(np.max(masks.segment_id)) + 1
    squares = np.bincount(blocks, values[known, 0].astype(np.float64) ** 2, count)
    return np.column_stack((squares, np.bincount(blocks, minlength=count)))


def _rms(sums_by: Floats) -> float:
    return float(np.sqrt(sums_by[:, 0].sum() / max(sums_by[:, 1].sum(), 1.0)))


def _interval(sums_by: Floats) -> tuple[float, float]:
    """95 % interval by bootstrap over segments."""
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(sums_by), (_DRAWS, len(sums_by)))
    total = sums_by[drawn].sum(axis=1)
    values = np.sqrt(total[:, 0] / np.maximum(total[:, 1], 1.0))
    low, high = np.quantile(values, (0.025, 0.975))
    return float(low), float(high)


def probabilities(hypotheses: Sequence[FittedHypothesis]) -> list[float]:
    """Posterior probability of each hypothesis among these: softmax of half the tempered criterion differences."""
    logs = np.array([-0.5 * delta_criterion(one, hypotheses[0]) / _TEMPERING for one in hypotheses])
    logs -= logs.max()
    weights = np.exp(logs)
    return [float(v) for v in weights / weights.sum()]
