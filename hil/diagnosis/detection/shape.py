"""Shape parameters: a listed effect whose curve has another shape than the typical one.

All candidates are tested with typical shape parameters (where a fade begins, how pads dry,
`plant.effects.effect.shape`). Where a nonparametric term leads, takes the listed effects at its injection point and
location; gives the best of them with its shape parameter fitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, log, pi, sqrt

import numpy as np
from scipy.optimize import minimize_scalar

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.detection.profile_fit import CandidateFits, FittedHypothesis, refitted
from hil.diagnosis.detection.threshold import SHAPE_MIN_SHARE
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import finite_difference_jacobian, information_blocks, solve
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.estimation.model_discrepancy import FORM_SHARE, variance_inflation
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.estimation.uncertainty import FORM_SD_SHARE
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.parallel import thread_map
from hil.diagnosis.simulation.parameter_set import ParameterSet
from plant.effects.effect import Parameter
from plant.injection.theta import THETA

_GRID = 9
"""Values of a shape parameter tested by one step, evenly between its bounds, by a constant factor where these are far
from each other."""
_WIDE_RATIO = 4.0
_ROUNDS, _TURNS, _SETTLED = 8, 4, 1.0
"""Values that are fitted, fits in turn at each, and the decrease of the cost that ends them."""
_STEP_SHARE, _RISES = 0.1, 1.0
"""Finite difference, in typical sizes; rise of chi-squared that tells the curvature."""
_TWO_SIDED_95 = 1.96


@dataclass(frozen=True, eq=False)
class ShapedCandidate(Candidate):
    """A candidate whose effect has its parameter ``shape`` at the value ``at``, known to ``deviation`` (sd)."""

    shape: Parameter
    at: float
    deviation: float = 0.0

    def applied(self, base: ParameterSet, value: float) -> ParameterSet:
        """The parameter set with ``value`` added, and the shape parameter set."""
        changed = super().applied(base, value)
        own = THETA.slice(self.effect.name, self.shape.name)
        if changed.change is None:
            changed.theta[own] = self.at
        else:
            changed.change.theta[own] = self.at - changed.theta[own]
        return changed

    def interval(self) -> tuple[float, float]:
        """95 % interval of the shape parameter, within its bounds."""
        half = _TWO_SIDED_95 * self.deviation
        return max(self.at - half, self.shape.low), min(self.at + half, self.shape.high)


def fit_shape_parameters(
    fits: CandidateFits, fitter: Fitter, listed: Sequence[Candidate], nonparametric: FittedHypothesis
) -> tuple[FittedHypothesis | None, Fitter]:
    """The best listed effect where a nonparametric term acts, of any shape; None where no effect there has a shape. The
    fitter comes back with the model without the term as its baseline.

    Parameters
    ----------
    fits : of the step in which the term leads.  listed : all candidates.
    nonparametric : the hypothesis with the term.
    """
    function = nonparametric.term.candidate
    assert isinstance(function, BasisFunction)
    offered = [
        ShapedCandidate(
            one.effect,
            one.parameter,
            one.location,
            one.columns,
            one.locations,
            shape,
            at,
            suspension_stated=one.suspension_stated,
            form_sd=one.form_sd,
        )
        for one in listed
        for shape in one.effect.parameters
        if shape.shape
        and function.term.injection_point in one.effect.injection_points
        and one.location == function.location
        for at in _grid(shape)
    ]
    if not offered:
        return None, fitter
    noise = nonparametric.noise
    terms = tuple(term for term in nonparametric.model.terms if not isinstance(term.candidate, BasisFunction))
    bare = fitter.at(nonparametric.model.z, terms, noise)
    base = fitter.parameter_set(bare.z, terms)
    fitter = fitter.at_baseline(bare)
    steps = [_STEP_SHARE * one.parameter.typical for one in offered]
    stepped = [one.applied(base, step) for one, step in zip(offered, steps, strict=True)]
    jacobian = finite_difference_jacobian(fitter.simulator, fitter.masks, bare.channels, stepped, steps)

    def predicted(k: int) -> Model:
        own = {name: values[:, k : k + 1] for name, values in jacobian.items()}
        return fits.linear_prediction([Term(offered[k], 0.0)], own)[0]

    best: dict[str, tuple[Model, ShapedCandidate]] = {}  # of each effect, by one step, which errs far from the start
    for model, one in sorted(zip(thread_map(predicted, range(len(offered))), offered, strict=True), key=_cost):
        best.setdefault(one.effect.name, (model, one))
    simulated = thread_map(lambda pair: fitter.at(pair[0].z, pair[0].terms, noise), list(best.values()))
    start = min(zip(simulated, (one for _, one in best.values()), strict=True), key=_cost)[1]
    return _fitted(fitter, bare, start, nonparametric), fitter


def refit_shape_parameter(
    fitter: Fitter, listed: FittedHypothesis, nonparametric: FittedHypothesis
) -> FittedHypothesis | None:
    """A hypothesis of `fit_shape_parameters` with its shape fitted again, given the Jacobian of ``fitter``."""
    candidate, *others = listed.term.candidate, *listed.model.terms[:-1]
    assert isinstance(candidate, ShapedCandidate)
    bare = fitter.at(listed.model.z, others, nonparametric.noise)
    return _fitted(fitter, bare, replace(candidate, deviation=0.0), nonparametric)


def _cost(pair: tuple[Model, ShapedCandidate]) -> float:
    return pair[0].cost


def _grid(shape: Parameter) -> list[float]:
    """Values of a shape parameter to test."""
    return list(map(float, (np.geomspace if _wide(shape) else np.linspace)(shape.low, shape.high, _GRID)))


def _wide(shape: Parameter) -> bool:
    return shape.high > _WIDE_RATIO * shape.low > 0.0


def _neighbours(shape: Parameter, at: float) -> tuple[float, float]:
    """One step of the grid to either side of a value, within the bounds."""
    if _wide(shape):
        factor = (shape.high / shape.low) ** (1.0 / (_GRID - 1))
        below, above = at / factor, at * factor
    else:
        step = (shape.high - shape.low) / (_GRID - 1)
        below, above = at - step, at + step
    return max(below, shape.low), min(above, shape.high)


def _fitted(
    fitter: Fitter, bare: Model, start: ShapedCandidate, nonparametric: FittedHypothesis
) -> FittedHypothesis | None:
    """The effect with the best shape between the neighbours of ``start``; None far behind the nonparametric term."""
    tried: list[tuple[float, Model]] = []
    noise = nonparametric.noise

    def fitted_from(z: Floats, term: Term) -> Model:
        own = fitter.copy()
        model = own.refit_amplitudes(own.at(z, (*bare.terms, term), noise), noise)
        for _ in range(_TURNS):
            before = model.cost
            model = own.fit(model, noise, 4, follow=True)
            if before - model.cost < _SETTLED:
                break
        return model

    def cost(at: float) -> float:
        best = min((model for _, model in tried), key=lambda model: model.cost, default=None)
        term = Term(replace(start, at=at), start.parameter.typical if best is None else best.terms[-1].value)
        starts = [bare.z] if best is None else [bare.z, best.z]
        models = thread_map(lambda z: fitted_from(z, term), starts)
        tried.append((at, min(models, key=lambda model: model.cost)))
        return tried[-1][1].cost

    neighbours = _neighbours(start.shape, start.at)
    if bare.cost - cost(start.at) < SHAPE_MIN_SHARE * (bare.cost - nonparametric.cost):
        return None
    minimize_scalar(cost, bounds=neighbours, method="bounded", options={"maxiter": _ROUNDS})
    at, model = min(tried, key=lambda one: one[1].cost)
    by_noise = _deviation(at, model.cost, [(other, of.cost) for other, of in tried], start.shape)
    form_share = hypot(FORM_SD_SHARE, FORM_SHARE if start.form_sd else 0.0)  # as for the value beside it
    by_form = form_share * (neighbours[1] - neighbours[0])
    deviation = hypot(
        by_noise * sqrt(variance_inflation(start)), by_form, _deviation_by_nuisances(fitter, model, noise, by_noise)
    )
    term = replace(model.terms[-1], candidate=replace(start, at=at, deviation=deviation))
    model = replace(model, terms=(*model.terms[:-1], term))
    hypothesis = refitted(replace(nonparametric, gain=0.0), model, noise)
    share = sqrt(2.0 * pi) * deviation / (start.shape.high - start.shape.low)
    return replace(hypothesis, log_occam_factor=hypothesis.log_occam_factor + min(log(max(share, 1e-12)), 0.0))


def _deviation(at: float, least: float, tried: Sequence[tuple[float, float]], shape: Parameter) -> float:
    """Standard deviation of a shape parameter: the distance that costs one more in chi-squared, by the nearest value
    tried on each side, the larger."""
    rises = [(other - at, abs(other - at) / sqrt(cost - least)) for other, cost in tried if cost > least + _RISES]
    sides = [[one for one in rises if one[0] < 0.0], [one for one in rises if one[0] > 0.0]]
    nearest = [min(side, key=lambda one: abs(one[0]))[1] for side in sides if side]
    return min(max(nearest, default=shape.high - shape.low), shape.high - shape.low)


def _deviation_by_nuisances(fitter: Fitter, model: Model, noise: Noise, step: float) -> float:
    """Standard deviation of a shape parameter by nuisance parameters on which nothing depended before the effect."""
    *others, term = model.terms
    shape = term.candidate
    assert isinstance(shape, ShapedCandidate)
    step = _within(shape.at, step, shape.shape)
    moved = fitter.at(model.z, (*others, replace(term, candidate=replace(shape, at=shape.at + step))), noise)
    own = {
        name: np.hstack([values, (model.residual[name] - moved.residual[name]) / step])
        for name, values in fitter.term_jacobian(model).items()
    }
    count, free = len(model.z), range(len(model.terms) + 1)
    variances = []
    for nuisances in (fitter.nuisance_jacobian, fitter.nuisance_jacobian_at(model)):
        columns = {name: np.hstack([values, own[name]]) for name, values in nuisances.items()}
        total = information_blocks(model.residual, columns, fitter.masks, noise, count).total()
        variances.append(float(solve(total, count, free, model.z)[1][-1, -1]))
    return sqrt(max(variances[1] - variances[0], 0.0))


def _within(at: float, step: float, shape: Parameter) -> float:
    """A step of a shape parameter, up where there is room for it, else as far as the further of its bounds."""
    up, down = shape.high - at, at - shape.low
    return min(step, up) if step <= up or up >= down else -min(step, down)
