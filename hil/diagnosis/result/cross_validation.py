"""Cross-validation: the error on manoeuvres that no fit saw, nominal, extended, and with the best wrong effect."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.profile_fit import FittedHypothesis, delta_criterion
from hil.diagnosis.detection.result import Diagnosis, Progress
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import information_blocks
from hil.diagnosis.estimation.model import Model, Term, Tracks
from hil.diagnosis.noise.model import Noise, SampleMasks
from hil.diagnosis.result.statistics import (
    FOLDS,
    bootstrap_interval,
    root_mean_square,
    squares_by_segment,
)

_TEMPERING = 1.5
"""Divisor of the criterion differences: two hypotheses differ less than an exact noise model would say."""

_CLEARLY = 0.05
"""Share by which an error is clearly less or more: of ten in 120 that lose 1 to 10 % by the true cause (docs/trials.md)
most lose less."""


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

    @property
    def improves_on_tuning(self) -> bool:
        """Clearly less than with nuisance parameters alone."""
        return self.after < (1.0 - _CLEARLY) * self.tuned

    @property
    def worse_than_tuning(self) -> bool:
        """Clearly more than with nuisance parameters alone."""
        return self.after > (1.0 + _CLEARLY) * self.tuned


def best_wrong(diagnosis: Diagnosis) -> FittedHypothesis | None:
    """The best hypothesis of another effect in place of the first cause; None where there is none."""
    if not diagnosis.hypotheses:
        return None
    right = diagnosis.final.terms[0].candidate.effect.name
    return next((c for c in diagnosis.hypotheses[0] if c.term.candidate.effect.name != right), None)


def folds(masks: SampleMasks, first: int = 0) -> list[Floats]:
    """Training weights of each fold, (segments,) each; neighbours in time go to different folds.

    Segments before ``first``, those of a reference, are in none: every fit may use them.
    """
    count = int(np.max(masks.segment_id)) + 1
    parts = min(FOLDS, count - first)
    return [np.array([0.0 if k >= first and k % parts == fold else 1.0 for k in range(count)]) for fold in range(parts)]


def held_out_residual(fitter: Fitter, noise: Noise, model: Model, first: int = 0) -> Tracks:
    """Residual of every segment from ``first`` on from a fit to the other folds, within the bounds of all parameters.

    That fit is the present one plus the change of one linear step by leaving the fold out: near the tyres' limit, where
    the cost is not quadratic, a full step would move on from the best fit with all segments, too.
    """
    masks = fitter.masks
    trained = folds(masks, first)
    if len(trained) < 2:
        return model.residual
    columns = dict(fitter.nuisance_jacobian)
    if model.terms:
        own = fitter.term_jacobian(model)
        columns = {name: np.hstack([values, own[name]]) for name, values in columns.items()}
    blocks = information_blocks(model.residual, columns, masks, noise, len(fitter.nuisances))
    out = {name: values.copy() for name, values in model.residual.items()}
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


def confirmed(diagnosis: Diagnosis, progress: Progress) -> Diagnosis:
    """Without the causes that manoeuvres contradict which no fit saw, the cause accepted last first.

    A cause is contradicted where the held-out residuals are less likely with it than with the nuisance parameters
    alone. The error of a speed in free run is no such measure: over a few manoeuvres a slow disturbance moves it more
    than a true cause does.
    """
    fitter, noise, first = diagnosis.fitter, diagnosis.noise, diagnosis.reference_segments
    if not diagnosis.final.terms:
        return diagnosis
    none = np.zeros(len(fitter.nuisances))
    tuned = fitter.cost(held_out_residual(fitter, noise, diagnosis.base, first), none, noise)
    while diagnosis.final.terms:
        after = fitter.cost(held_out_residual(fitter, noise, diagnosis.final, first), none, noise)
        if after < tuned:
            break
        diagnosis = _without_last(diagnosis)
        progress(diagnosis.remarks[-1])
    return diagnosis


def _without_last(diagnosis: Diagnosis) -> Diagnosis:
    """Without the cause accepted last, which may have several terms."""
    last = diagnosis.hypotheses[-1]
    kept = [k for k, listed in enumerate(diagnosis.hypotheses) if listed is not last]
    terms = diagnosis.final.terms
    names = ", ".join(f"{one.candidate.name} = {one.value:.3g}" for k, one in enumerate(terms) if k not in kept)
    why = "manoeuvres that no fit saw are less likely with it than without"
    remarks = (*diagnosis.remarks, f"{names} is not named: {why}")
    hypotheses = tuple(diagnosis.hypotheses[k] for k in kept)
    diagnosis = replace(diagnosis, hypotheses=hypotheses, remarks=remarks)
    if not kept:
        return replace(diagnosis, final=diagnosis.base, noise=diagnosis.first_noise)
    start = diagnosis.fitter.at(diagnosis.final.z, [terms[k] for k in kept], diagnosis.noise)
    return replace(diagnosis, final=diagnosis.fitter.fit(start, diagnosis.noise, 5))


def held_out_error(diagnosis: Diagnosis) -> list[HeldOutError]:
    """Held-out error of every channel, over what is no reference."""
    fitter, noise, masks = diagnosis.fitter, diagnosis.noise, diagnosis.fitter.masks
    wrong, first = best_wrong(diagnosis), diagnosis.reference_segments
    after = held_out_residual(fitter, noise, diagnosis.final, first) if diagnosis.final.terms else None
    tuned = held_out_residual(fitter, noise, diagnosis.base, first)
    other = held_out_residual(fitter, noise, wrong.model, first) if wrong is not None else None
    errors = []
    for name in masks.names:
        before = _squares(diagnosis.nominal.residual[name], masks, name)[first:]
        own = _squares((after or tuned)[name], masks, name)[first:]
        low, high = bootstrap_interval(own)
        errors.append(
            HeldOutError(
                name, root_mean_square(before), root_mean_square(own), low, high,
                root_mean_square(_squares(tuned[name], masks, name)[first:]),
                None if other is None else root_mean_square(_squares(other[name], masks, name)[first:]),
            )
        )  # fmt: skip
    return errors


def _squares(values: Floats, masks: SampleMasks, name: str) -> Floats:
    return squares_by_segment(values[:, 0], masks.present[name] > 0.5, masks.segment_id)


def probabilities(hypotheses: Sequence[FittedHypothesis]) -> list[float]:
    """Posterior probability of each hypothesis among these: softmax of half the tempered criterion differences."""
    logs = np.array([-0.5 * delta_criterion(one, hypotheses[0]) / _TEMPERING for one in hypotheses])
    logs -= logs.max()
    weights = np.exp(logs)
    return [float(v) for v in weights / weights.sum()]
