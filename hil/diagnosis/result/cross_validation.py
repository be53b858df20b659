"""What the extension gains on manoeuvres that its fit never saw, beside doing nothing and the best wrong cause."""

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


@dataclass(frozen=True)
class HeldOutError:
    """Error of one track: root mean square as handed in, extended, and with the best wrong effect."""

    channel: str
    before: float
    after: float
    low: float
    high: float
    tuned: float
    best_wrong: float | None


def best_wrong(found: Diagnosis) -> FittedHypothesis | None:
    """The best contender of another effect for the first cause."""
    if not found.hypotheses:
        return None
    right = found.final.terms[0].candidate.effect.name
    return next((c for c in found.hypotheses[0] if c.term.candidate.effect.name != right), None)


def folds(frame: SampleMasks) -> list[Floats]:
    """Weights of the manoeuvres each fold trains on; neighbours in time go to different folds."""
    count = int(np.max(frame.segment_id)) + 1
    parts = min(FOLDS, count)
    return [np.array([0.0 if k % parts == fold else 1.0 for k in range(count)]) for fold in range(parts)]


def held_out_residual(fitter: Fitter, noise: Noise, model: Model) -> Tracks:
    """Residual of every manoeuvre from a fit on the others, in which no number goes farther than it may.

    That fit is the one at hand and what leaving the manoeuvre out changes in one linear step: where tyres near their
    limit bend the cost, a step goes on from the best fit with all manoeuvres, too.
    """
    frame = fitter.masks
    trained = folds(frame)
    if len(trained) < 2:
        return model.residual
    columns = dict(fitter.nuisance_jacobian)
    if model.terms:
        own = fitter.term_jacobian(model)
        columns = {name: np.hstack([values, own[name]]) for name, values in columns.items()}
    of = information_blocks(model.residual, columns, frame, noise, len(fitter.nuisances))
    out = {name: np.zeros_like(values) for name, values in model.residual.items()}
    blocks = np.asarray(frame.segment_id, np.int64)
    z_of_all, of_all, *_ = fitter.moved(model, of.total())
    for weights in trained:
        z, terms, *_ = fitter.moved(model, of.total(weights))
        z = np.clip(model.z + z - z_of_all, fitter.lower, fitter.upper)
        terms = tuple(map(_changed, model.terms, terms, of_all))
        residual = fitter.residual(z, terms)
        test = weights[blocks] < 0.5
        for name, values in residual.items():
            out[name][test] = values[test]
    return out


def _changed(now: Term, without: Term, of_all: Term) -> Term:
    """An effect as fitted, with what a step without some manoeuvres changes beside one with all."""
    parameter = now.candidate.parameter
    return replace(now, value=float(np.clip(now.value + without.value - of_all.value, parameter.low, parameter.high)))


def held_out_error(found: Diagnosis) -> list[HeldOutError]:
    """Gain of every track."""
    fitter, noise, frame = found.fitter, found.noise, found.fitter.masks
    wrong = best_wrong(found)
    after = held_out_residual(fitter, noise, found.final) if found.final.terms else None
    tuned = held_out_residual(fitter, noise, found.base)
    other = held_out_residual(fitter, noise, wrong.model) if wrong is not None else None
    listed = []
    for name in frame.names:
        before = _by_manoeuvre(found.nominal.residual[name], frame, name)
        own = _by_manoeuvre((after or tuned)[name], frame, name)
        low, high = _interval(own)
        listed.append(
            HeldOutError(
                name, _rms(before), _rms(own), low, high, _rms(_by_manoeuvre(tuned[name], frame, name)),
                None if other is None else _rms(_by_manoeuvre(other[name], frame, name)),
            )
        )  # fmt: skip
    return listed


def _by_manoeuvre(values: Floats, frame: SampleMasks, name: str) -> Floats:
    """Sums of squares and counts, (manoeuvres, 2); the start speed's error within a manoeuvre is part of it."""
    known = frame.present[name] > 0.5
    blocks = np.asarray(frame.segment_id, np.int64)[known]
    count = int(np.max(frame.segment_id)) + 1
    squares = np.bincount(blocks, values[known, 0].astype(np.float64) ** 2, count)
    return np.column_stack((squares, np.bincount(blocks, minlength=count)))


def _rms(sums_by: Floats) -> float:
    return float(np.sqrt(sums_by[:, 0].sum() / max(sums_by[:, 1].sum(), 1.0)))


def _interval(sums_by: Floats) -> tuple[float, float]:
    """95 % by bootstrap over manoeuvres."""
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(sums_by), (_DRAWS, len(sums_by)))
    total = sums_by[drawn].sum(axis=1)
    values = np.sqrt(total[:, 0] / np.maximum(total[:, 1], 1.0))
    low, high = np.quantile(values, (0.025, 0.975))
    return float(low), float(high)


def probabilities(contenders: Sequence[FittedHypothesis], tempering: float = 1.5) -> list[float]:
    """Softmax of the log-odds, tempered: two contenders are less far apart than an exact noise model would say."""
    logs = np.array([-0.5 * delta_criterion(c, contenders[0]) / tempering for c in contenders])
    logs -= logs.max()
    weights = np.exp(logs)
    return [float(v) for v in weights / weights.sum()]
