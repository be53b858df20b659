"""Group score test of the nonparametric terms: what each gains at each location by one linear step.

Takes a fitter and a parameter set, at which all terms are simulated once; gives a `GroupScore` for each.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.nonparametric import BASIS_SIZE, BasisExpansion, at_each_location, basis_expansions
from hil.diagnosis.detection.profile_fit import FittedHypothesis
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import finite_difference_jacobian, marginalise
from hil.diagnosis.estimation.model import Model, Term, Tracks
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator
from plant.effects.effect import Scope

_BY_WHEEL, _AXLES = ("friction.mu",), ("front", "rear")
STEP_SHARE = 0.1
"""Finite difference of a coefficient, in typical sizes."""


@dataclass(frozen=True, eq=False)
class GroupScore:
    """Score test of a nonparametric term at a location: coefficients of one linear step, gain in chi-squared, log Bayes
    factor; ``choices`` is the number of terms and locations that it is chosen from."""

    expansion: BasisExpansion
    values: Floats
    gain: float
    log_bayes_factor: float
    choices: int

    @property
    def terms(self) -> tuple[Term, ...]:
        """As terms of a model, of value 0."""
        return tuple(Term(function, 0.0) for function in self.expansion.functions)


class GroupScoreTest:
    """Group score test of all nonparametric terms at one parameter set, the fitter's baseline; wheel by wheel for the
    best term."""

    def __init__(self, fitter: Fitter, base: ParameterSet) -> None:
        self._masks, self._base = fitter.masks, base
        self._parts = {
            expansion: [expansion.at(location) for location in _parts(expansion)]
            for expansion in basis_expansions(fitter.simulator, base)
        }
        parts = [part for parts in self._parts.values() for part in parts]
        self._jacobians = self._linearised(fitter.simulator, parts)

    def _linearised(self, simulator: Simulator, parts: Sequence[BasisExpansion]) -> dict[tuple[str, str], Tracks]:
        """Jacobian of the coefficients of each term and location."""
        functions = [function for part in parts for function in part.functions]
        steps = [STEP_SHARE * function.term.typical for function in functions]
        stepped = [function.applied(self._base, step) for function, step in zip(functions, steps, strict=True)]
        whole = finite_difference_jacobian(simulator, self._masks, simulator.run(self._base), stepped, steps)
        return {
            (part.term.name, part.location): {
                name: values[:, BASIS_SIZE * k : BASIS_SIZE * (k + 1)] for name, values in whole.items()
            }
            for k, part in enumerate(parts)
        }

    def scores(self, fitter: Fitter, model: Model, noise: Noise) -> tuple[list[GroupScore], Fitter]:
        """Every term at every location that the simulated parts add up to, by log Bayes factor, best first; the fitter
        with the last baseline."""
        ranked = self._ranked(fitter, model, noise)
        leading = next(expansion for expansion in self._parts if expansion.term is ranked[0].expansion.term)
        if len(self._parts[leading]) == len(_AXLES):
            self._parts[leading] = [leading.at(wheel) for wheel in Scope.WHEEL.members]
            fitter = fitter.with_simulator(fitter.simulator.with_baseline(self._base))
            self._jacobians |= self._linearised(fitter.simulator, self._parts[leading])
            ranked = self._ranked(fitter, model, noise)
        return ranked, fitter

    def jacobian(self, entry: GroupScore) -> Tracks:
        """Jacobian of the coefficients of a term at a location, tracks of (samples, BASIS_SIZE)."""
        expansion = next(expansion for expansion in self._parts if expansion.term is entry.expansion.term)
        parts = self._parts[expansion]
        taken = next(at for placed, at in _offered(expansion, parts) if placed.location == entry.expansion.location)
        listed = [self._jacobians[parts[k].term.name, parts[k].location] for k in taken]
        return {name: np.sum([tracks[name] for tracks in listed], axis=0) for name in listed[0]}

    def _ranked(self, fitter: Fitter, model: Model, noise: Noise) -> list[GroupScore]:
        listed = [self._jacobians[part.term.name, part.location] for parts in self._parts.values() for part in parts]
        joined = {name: np.hstack([tracks[name] for tracks in listed]) for name in self._masks.names}
        blocks, accepted = fitter.information_blocks(model, joined, noise), len(model.terms)
        marginal = marginalise(blocks.total(), blocks.nuisances, range(accepted), model.z, fitter.at_bounds(model.z))
        b, q = marginal.b[accepted:], marginal.q[accepted:, accepted:]
        offered = {expansion: _offered(expansion, parts) for expansion, parts in self._parts.items()}
        choices = sum(map(len, offered.values()))
        entries, at = [], 0
        for expansion, parts in self._parts.items():
            own = slice(at, at + BASIS_SIZE * len(parts))
            for placed, taken in offered[expansion]:
                sums = np.hstack([np.eye(BASIS_SIZE) * float(k in taken) for k in range(len(parts))])
                entries.append(_group_score(placed, sums @ b[own], sums @ q[own, own] @ sums.T, choices))
            at = own.stop
        return sorted(entries, key=lambda entry: -entry.log_bayes_factor)


def _parts(expansion: BasisExpansion) -> Sequence[str]:
    """Locations that are simulated at first; all others are sums of them."""
    return _AXLES if expansion.term.injection_point in _BY_WHEEL else ("car",)


def _offered(expansion: BasisExpansion, parts: Sequence[BasisExpansion]) -> list[tuple[BasisExpansion, list[int]]]:
    """The term at every location that parts add up to, with the indices of those parts."""
    offered = []
    for placed in at_each_location(expansion):
        members = set(placed.functions[0].members())
        taken = [k for k, part in enumerate(parts) if set(part.functions[0].members()) <= members]
        if sum(len(parts[k].functions[0].members()) for k in taken) == len(members):
            offered.append((placed, taken))
    return offered


def _group_score(expansion: BasisExpansion, b: Floats, q: Floats, choices: int) -> GroupScore:
    typical = expansion.term.typical
    values = np.linalg.solve(q + np.eye(BASIS_SIZE) / typical**2, b)
    gain = float(values @ b)
    log_bayes_factor = 0.5 * gain + _log_volume_ratio(q, typical) - float(np.log(choices))
    return GroupScore(expansion, values, gain, log_bayes_factor, choices)


def _log_volume_ratio(information: Floats, typical: float) -> float:
    """Log of posterior over prior volume of the coefficients; basis functions without information cost nothing."""
    return -0.5 * float(np.linalg.slogdet(np.eye(BASIS_SIZE) + typical**2 * information)[1])


def best_of_each_term(entries: Sequence[GroupScore], count: int) -> list[GroupScore]:
    """The best location of each of the ``count`` best terms."""
    best: dict[str, GroupScore] = {}
    for entry in entries:
        best.setdefault(entry.expansion.term.name, entry)
    return list(best.values())[:count]


def fitted_hypothesis(entry: GroupScore, model: Model, noise: Noise, reference: float) -> FittedHypothesis:
    """A model whose last terms are the nonparametric term; its gain is against the cost ``reference``."""
    values = np.array([term.value for term in model.terms[-BASIS_SIZE:]])
    occam = log_occam_factor(entry, values, model.covariance[-BASIS_SIZE:, -BASIS_SIZE:])
    return FittedHypothesis(model.terms[-1], model, model.cost, occam, 0.0, noise, reference - model.cost)


def log_occam_factor(entry: GroupScore, values: Floats, covariance: Floats) -> float:
    """Log of prior density and of posterior over prior volume at the fitted coefficients.

    Parameters
    ----------
    values, covariance : (BASIS_SIZE,) and (BASIS_SIZE, BASIS_SIZE) of the coefficients, from the data alone.
    """
    typical = entry.expansion.term.typical
    density = -0.5 * float(values @ values) / typical**2
    return density + _log_volume_ratio(np.linalg.inv(covariance), typical) - float(np.log(entry.choices))
