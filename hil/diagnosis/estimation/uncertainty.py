"""Covariance and 95 % intervals of the values of a fit: noise, model discrepancy and the form of each equation."""

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.aliases import alias_of
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import InformationBlocks, information_blocks, solve
from hil.diagnosis.estimation.model import Model
from hil.diagnosis.estimation.model_discrepancy import variance_inflation
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.noise.model import Noise

FORM_SD_SHARE = 0.05
"""Standard deviation of a value by the form of its equation, as a share of the value. Of 44 values estimated from data
of other equations 77 % lay within the interval by noise alone, 89 % within that of noise and model discrepancy, 93 %
with this share (docs/decisions/isolability-and-intervals.md)."""
_DRAWS, _MIN_SEGMENTS, _MAX_WIDENING = 60, 6, 1.6
_TWO_SIDED_95 = 1.96


def half_width(candidate: Candidate, value: float, sd: float) -> float:
    """Half of the 95 % interval of a value, in its unit, whose standard deviation by noise is ``sd``."""
    by_form = np.hypot(FORM_SD_SHARE * value, candidate.form_sd)
    return _TWO_SIDED_95 * float(np.sqrt(variance_inflation(candidate) * sd**2 + by_form**2))


def intervals(fitter: Fitter, model: Model, noise: Noise) -> list[tuple[float, float]]:
    """95 % interval of each term's value, within the bounds of its parameter.

    A term that is an alias of a nuisance parameter is known no better than that parameter.
    """
    if not model.terms:
        return []
    nominal, nuisances = fitter.base.with_nuisances(fitter.nuisances, model.z), fitter.nuisances
    bounds = []
    for term, sd in zip(model.terms, standard_deviations(fitter, model, noise), strict=True):
        half = half_width(term.candidate, term.value, float(sd))
        alias = alias_of(term, nuisances, nominal)
        if alias is not None:
            half = max(half, _TWO_SIDED_95 * alias.deviation(nuisances))
        parameter = term.candidate.parameter
        low, high = np.clip((term.value - half, term.value + half), parameter.low, parameter.high)
        bounds.append((float(low), float(high)))
    return bounds


def standard_deviations(fitter: Fitter, model: Model, noise: Noise) -> Floats:
    """Standard deviation of each term's value by noise, (terms,).

    From the information matrix with the nuisances marginalised; wider, up to 1.6 times, where a bootstrap over the
    segments scatters more.
    """
    own, count = fitter.term_jacobian(model), len(fitter.nuisances)
    columns = {name: np.hstack([values, own[name]]) for name, values in fitter.nuisance_jacobian_at(model).items()}
    blocks = information_blocks(model.residual, columns, fitter.masks, noise, count)
    _, covariance = solve(blocks.total(), count, range(len(model.terms)), model.z)
    by_curvature = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if len(blocks.matrix) < _MIN_SEGMENTS:
        return np.asarray(by_curvature)
    return np.clip(_bootstrap(blocks, count, model.z), by_curvature, _MAX_WIDENING * by_curvature)


def _bootstrap(blocks: InformationBlocks, count: int, z: Floats) -> Floats:
    """Half the central 68 % range of the values over segments drawn with replacement, (terms,)."""
    rng, segments, width = np.random.default_rng(1), len(blocks.matrix), blocks.matrix.shape[1] - 1 - count
    shares = np.full(segments, 1.0 / segments)
    weights = [rng.multinomial(segments, shares).astype(np.float64) for _ in range(_DRAWS)]
    changes = [solve(blocks.total(drawn), count, range(width), z)[0][count:] for drawn in weights]
    low, high = np.quantile(np.array(changes), (0.16, 0.84), axis=0)
    return np.asarray(0.5 * (high - low))
