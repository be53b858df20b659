"""What is known of a cause's value: noise, what the model errs in its own way, the form of the cause's equation."""

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.estimation.aliases import alias_of
from hil.diagnosis.estimation.information import InformationBlocks, information_blocks, solve
from hil.diagnosis.estimation.model_discrepancy import variance_inflation
from hil.diagnosis.estimation.terms import Candidate

DEVIATION_BY_FORM = 0.05
"""Standard deviation of a value by the form of its equation, as a share of the value. Of 44 values found where
equations of another form had made the data, 77 % lay within the interval by noise alone, 89 % within that of noise and
the model's own error, 93 % with this share (docs/decisions/0066)."""
_DRAWS, _FEW, _MOST_SPREAD = 60, 6, 1.6
_TWO_SIDED_95 = 1.96


def half_width(candidate: Candidate, value: float, deviation: float) -> float:
    """Half of a 95 % interval, of a value whose standard deviation by noise is ``deviation``."""
    return _TWO_SIDED_95 * float(
        np.sqrt(variance_inflation(candidate) * deviation**2 + (DEVIATION_BY_FORM * value) ** 2)
    )


def intervals(found: Diagnosis) -> list[tuple[float, float]]:
    """95 % interval of each cause's value, within what the value may be.

    What is a number of the vehicle is known no better than that number.
    """
    model, fitter = found.final, found.fitter
    if not model.terms:
        return []
    world, nuisances = fitter.base.with_nuisances(fitter.nuisances, model.z), fitter.nuisances
    bounds = []
    for term, deviation in zip(model.terms, standard_deviations(found), strict=True):
        half = half_width(term.candidate, term.value, float(deviation))
        same = alias_of(term, nuisances, world)
        if same is not None:
            half = max(half, _TWO_SIDED_95 * same.deviation(nuisances))
        parameter = term.candidate.parameter
        low, high = np.clip((term.value - half, term.value + half), parameter.low, parameter.high)
        bounds.append((float(low), float(high)))
    return bounds


def standard_deviations(found: Diagnosis) -> Floats:
    """Standard deviation of each value by noise: curvature of the likelihood, more where manoeuvres disagree."""
    model, fitter = found.final, found.fitter
    own, count = fitter.term_jacobian(model), len(fitter.nuisances)
    columns = {name: np.hstack([values, own[name]]) for name, values in fitter.nuisance_jacobian_at(model).items()}
    of = information_blocks(model.residual, columns, fitter.masks, found.noise, count)
    _, covariance = solve(of.total(), count, range(len(model.terms)), model.z)
    curvature = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if len(of.matrix) < _FEW:
        return np.asarray(curvature)
    return np.clip(_drawn(of, count, model.z), curvature, _MOST_SPREAD * curvature)


def _drawn(of: InformationBlocks, count: int, z: Floats) -> Floats:
    """Spread of the values over manoeuvres drawn again and again."""
    rng, manoeuvres, width = np.random.default_rng(1), len(of.matrix), of.matrix.shape[1] - 1 - count
    shares = np.full(manoeuvres, 1.0 / manoeuvres)
    weights = [rng.multinomial(manoeuvres, shares).astype(np.float64) for _ in range(_DRAWS)]
    changes = [solve(of.total(drawn), count, range(width), z)[0][count:] for drawn in weights]
    low, high = np.quantile(np.array(changes), (0.16, 0.84), axis=0)
    return np.asarray(0.5 * (high - low))
