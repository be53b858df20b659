"""Listed causes of another shape than the usual one: a fade that begins elsewhere shows as its curve, in no list.

The race has every cause at the usual value of what says how it acts (`plant.effects.effect.shape`). Where a law in no
list leads, the listed causes at its joint are asked at all values of that number.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, log, pi, sqrt

import numpy as np
from scipy.optimize import minimize_scalar

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.detection.profile_fit import CandidateFits, FittedHypothesis, refitted
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Term
from hil.diagnosis.estimation.information import finite_difference_jacobian, information_blocks, solve
from hil.diagnosis.estimation.model_discrepancy import variance_inflation
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.isolation.intervals import DEVIATION_BY_FORM
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.parallel import thread_map
from hil.diagnosis.simulation.parameter_set import ParameterSet
from plant.effects.effect import Parameter
from plant.effects.theta import THETA

_OFFERED = 9
"""Values of a shape that are looked at by one step, evenly between its bounds, in proportion where these are far
apart."""
_FAR_APART = 4.0
_ROUNDS, _TURNS, _SETTLED = 8, 4, 1.0
"""Values that are fitted, how often in turn, and how little less cost ends it."""
_FAR_BEHIND = 0.5
"""Share of what a law explains, below which a shape as offered is not followed: the values around it are no further
off than an eighth of its range."""
_SHARE, _RISES = 0.1, 1.0
"""A finite difference, of what is usual; and what in chi-squared tells how well a shape is known."""
_TWO_SIDED_95 = 1.96


@dataclass(frozen=True, eq=False)
class ShapedCandidate(Candidate):
    """A listed effect's number at a place, its ``shape`` ``at`` a value of its own; how well that is known."""

    shape: Parameter
    at: float
    deviation: float = 0.0

    def applied(self, world: ParameterSet, value: float) -> ParameterSet:
        """The world with this number added, and the shape set."""
        world = super().applied(world, value)
        world.theta[THETA.slice(self.effect.name, self.shape.name)] = self.at
        return world

    def interval(self) -> tuple[float, float]:
        """95 % interval of the shape, within its bounds."""
        half = _TWO_SIDED_95 * self.deviation
        return max(self.at - half, self.shape.low), min(self.at + half, self.shape.high)


def fit_shape_parameters(
    contest: CandidateFits, fitter: Fitter, listed: Sequence[Candidate], law: FittedHypothesis
) -> tuple[FittedHypothesis | None, Fitter]:
    """The best listed cause at the joint and the place of a law, of any shape; None where no effect there has one. The
    fitter comes back with the model without the law as its baseline.

    Parameters
    ----------
    contest : the race that the law leads.  listed : all candidates.  law : its pieces are the last terms of its model.
    """
    piece = law.term.candidate
    assert isinstance(piece, BasisFunction)
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
        )
        for one in listed
        for shape in one.effect.parameters
        if shape.shape and piece.term.injection_point in one.effect.joints and one.location == piece.location
        for at in _values(shape)
    ]
    if not offered:
        return None, fitter
    terms = tuple(term for term in law.model.terms if not isinstance(term.candidate, BasisFunction))
    bare = fitter.at(law.model.z, terms, law.noise)
    world = fitter.parameter_set(bare.z, terms)
    fitter = fitter.at_baseline(bare)
    steps = [_SHARE * one.parameter.typical for one in offered]
    worlds = [one.applied(world, step) for one, step in zip(offered, steps, strict=True)]
    columns = finite_difference_jacobian(fitter.simulator, fitter.masks, bare.channels, worlds, steps)

    def foreseen(k: int) -> Model:
        own = {name: values[:, k : k + 1] for name, values in columns.items()}
        return contest.linear_prediction([Term(offered[k], 0.0)], own)[0]

    best: dict[str, tuple[Model, ShapedCandidate]] = {}  # of each effect, as foreseen by one step, which far off errs
    for model, one in sorted(zip(thread_map(foreseen, range(len(offered))), offered, strict=True), key=_cost):
        best.setdefault(one.effect.name, (model, one))
    replayed = thread_map(lambda seen: fitter.at(seen[0].z, seen[0].terms, law.noise), list(best.values()))
    _, first = min(zip(replayed, (one for _, one in best.values()), strict=True), key=_cost)
    return _fitted(fitter, bare, first, law), fitter


def _cost(seen: tuple[Model, ShapedCandidate]) -> float:
    return seen[0].cost


def _values(shape: Parameter) -> list[float]:
    """Values of a shape to look at."""
    far_apart = shape.high > _FAR_APART * shape.low > 0.0
    return list(map(float, (np.geomspace if far_apart else np.linspace)(shape.low, shape.high, _OFFERED)))


def _fitted(fitter: Fitter, bare: Model, begun: ShapedCandidate, law: FittedHypothesis) -> FittedHypothesis | None:
    """The cause with the shape that explains most, near the one at which it is offered; None far behind the law."""
    seen: list[tuple[float, Model]] = []

    def found_from(z: Floats, term: Term) -> Model:
        own = fitter.copy()
        model = own.refit_amplitudes(own.at(z, (*bare.terms, term), law.noise), law.noise)
        for _ in range(_TURNS):
            before = model.cost
            model = own.fit(model, law.noise, 4, follow=True)
            if before - model.cost < _SETTLED:
                break
        return model

    def cost(at: float) -> float:
        best = min((model for _, model in seen), key=lambda model: model.cost, default=None)
        term = Term(replace(begun, at=at), begun.parameter.typical if best is None else best.terms[-1].value)
        starts = [bare.z] if best is None else [bare.z, best.z]
        found = thread_map(lambda z: found_from(z, term), starts)
        seen.append((at, min(found, key=lambda model: model.cost)))
        return seen[-1][1].cost

    offered = _values(begun.shape)
    number = offered.index(begun.at)
    beyond = offered[max(number - 1, 0)], offered[min(number + 1, len(offered) - 1)]
    if bare.cost - cost(begun.at) < _FAR_BEHIND * (bare.cost - law.cost):
        return None
    minimize_scalar(cost, bounds=beyond, method="bounded", options={"maxiter": _ROUNDS})
    at, model = min(seen, key=lambda one: one[1].cost)
    by_noise = _deviation(at, model.cost, [(other, of.cost) for other, of in seen], begun.shape)
    by_form = DEVIATION_BY_FORM * (beyond[1] - beyond[0])
    deviation = hypot(
        by_noise * sqrt(variance_inflation(begun)), by_form, _by_numbers(fitter, model, law.noise, by_noise)
    )
    term = replace(model.terms[-1], candidate=replace(begun, at=at, deviation=deviation))
    model = replace(model, terms=(*model.terms[:-1], term))
    found = refitted(replace(law, gain=0.0), model, law.noise)
    told = sqrt(2.0 * pi) * deviation / (begun.shape.high - begun.shape.low)
    return replace(found, log_occam_factor=found.log_occam_factor + min(log(max(told, 1e-12)), 0.0))


def _deviation(at: float, least: float, seen: Sequence[tuple[float, float]], shape: Parameter) -> float:
    """Standard deviation of a shape: how far off costs one more in chi-squared, by the nearest seen on both sides."""
    rises = [(other - at, abs(other - at) / sqrt(cost - least)) for other, cost in seen if cost > least + _RISES]
    sides = [[one for one in rises if one[0] < 0.0], [one for one in rises if one[0] > 0.0]]
    nearest = [min(side, key=lambda one: abs(one[0]))[1] for side in sides if side]
    return min(max(nearest, default=shape.high - shape.low), shape.high - shape.low)


def _by_numbers(fitter: Fitter, model: Model, noise: Noise, step: float) -> float:
    """Standard deviation of a shape by numbers that mattered to nothing before it (`Fitter.columns_at`)."""
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
    for numbers in (fitter.nuisance_jacobian, fitter.nuisance_jacobian_at(model)):
        columns = {name: np.hstack([values, own[name]]) for name, values in numbers.items()}
        total = information_blocks(model.residual, columns, fitter.masks, noise, count).total()
        variances.append(float(solve(total, count, free, model.z)[1][-1, -1]))
    return sqrt(max(variances[1] - variances[0], 0.0))


def _within(at: float, step: float, shape: Parameter) -> float:
    """A step of a shape, up where there is room for it, else as far as the further of its bounds."""
    up, down = shape.high - at, at - shape.low
    return min(step, up) if step <= up or up >= down else -min(step, down)
