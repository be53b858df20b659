"""The race of the unlisted laws: how much each explains at each place, beside what listed effects do."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.nonparametric import BASIS_SIZE, BasisExpansion, at_each_location, basis_expansions
from hil.diagnosis.detection.profile_fit import FittedHypothesis
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Term, Tracks
from hil.diagnosis.estimation.information import finite_difference_jacobian, marginalise
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator
from plant.effects.effect import Scope

_BY_WHEEL, _AXLES = ("friction.mu",), ("front", "rear")
_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class GroupScore:
    """A law at a place: coefficients of one linear step, gain in chi2, log of its Bayes factor.

    ``choices`` is the number of laws and places that it was chosen from.
    """

    expansion: BasisExpansion
    values: Floats
    gain: float
    evidence: float
    choices: int

    @property
    def terms(self) -> tuple[Term, ...]:
        """As terms of a model, where they do nothing yet."""
        return tuple(Term(piece, 0.0) for piece in self.expansion.functions)


class GroupScoreTest:
    """Sensitivities to all laws at one model, simulated once from the fitter's baseline; by wheel for the law that
    leads."""

    def __init__(self, fitter: Fitter, world: ParameterSet) -> None:
        self._frame, self._world = fitter.masks, world
        self._parts = {
            curve: [curve.at(place) for place in _parts(curve)] for curve in basis_expansions(fitter.simulator, world)
        }
        self._columns = self._simulated(fitter.simulator, [part for parts in self._parts.values() for part in parts])

    def _simulated(self, simulator: Simulator, parts: Sequence[BasisExpansion]) -> dict[tuple[str, str], Tracks]:
        """Columns of each law and place."""
        pieces = [piece for part in parts for piece in part.functions]
        steps = [_SHARE * piece.term.typical for piece in pieces]
        worlds = [piece.applied(self._world, step) for piece, step in zip(pieces, steps, strict=True)]
        all_of = finite_difference_jacobian(simulator, self._frame, simulator.run(self._world), worlds, steps)
        return {
            (part.term.name, part.location): {
                name: values[:, BASIS_SIZE * k : BASIS_SIZE * (k + 1)] for name, values in all_of.items()
            }
            for k, part in enumerate(parts)
        }

    def scores(self, fitter: Fitter, model: Model, noise: Noise) -> tuple[list[GroupScore], Fitter]:
        """Every law at every place it was simulated for, the best first, by the fitter's sensitivities to numbers; the
        fitter with the baseline of the last simulated."""
        found = self._ranked(fitter, model, noise)
        leading = next(curve for curve in self._parts if curve.term is found[0].expansion.term)
        if len(self._parts[leading]) == len(_AXLES):
            self._parts[leading] = [leading.at(wheel) for wheel in Scope.WHEEL.members]
            fitter = fitter.with_simulator(fitter.simulator.with_baseline(self._world))
            self._columns |= self._simulated(fitter.simulator, self._parts[leading])
            found = self._ranked(fitter, model, noise)
        return found, fitter

    def columns(self, entry: GroupScore) -> Tracks:
        """Sensitivities to the coefficients of a law at a place."""
        curve = next(curve for curve in self._parts if curve.term is entry.expansion.term)
        parts = self._parts[curve]
        taken = next(taken for placed, taken in _offered(curve, parts) if placed.location == entry.expansion.location)
        listed = [self._columns[parts[k].term.name, parts[k].location] for k in taken]
        return {name: np.sum([columns[name] for columns in listed], axis=0) for name in listed[0]}

    def _ranked(self, fitter: Fitter, model: Model, noise: Noise) -> list[GroupScore]:
        listed = [self._columns[part.term.name, part.location] for parts in self._parts.values() for part in parts]
        joined = {name: np.hstack([columns[name] for columns in listed]) for name in self._frame.names}
        sums = fitter.information_blocks(model, joined, noise)
        accepted = len(model.terms)
        projected = marginalise(sums.total(), sums.nuisances, range(accepted), model.z, fitter.at_bounds(model.z))
        b, q = projected.b[accepted:], projected.q[accepted:, accepted:]
        offered = {curve: _offered(curve, parts) for curve, parts in self._parts.items()}
        choices = sum(map(len, offered.values()))
        found, at = [], 0
        for curve, parts in self._parts.items():
            size = BASIS_SIZE * len(parts)
            own = slice(at, at + size)
            for placed, taken in offered[curve]:
                moves = np.hstack([np.eye(BASIS_SIZE) * float(k in taken) for k in range(len(parts))])
                found.append(_entry(placed, moves @ b[own], moves @ q[own, own] @ moves.T, choices))
            at += size
        return sorted(found, key=lambda entry: -entry.evidence)


def _parts(curve: BasisExpansion) -> Sequence[str]:
    """Places that are simulated at first; all others are sums of them."""
    return _AXLES if curve.term.injection_point in _BY_WHEEL else ("car",)


def _offered(curve: BasisExpansion, parts: Sequence[BasisExpansion]) -> list[tuple[BasisExpansion, list[int]]]:
    """The law at every place that parts add up to, with those parts."""
    found = []
    for placed in at_each_location(curve):
        members = set(placed.functions[0].members())
        taken = [k for k, part in enumerate(parts) if set(part.functions[0].members()) <= members]
        if sum(len(parts[k].functions[0].members()) for k in taken) == len(members):
            found.append((placed, taken))
    return found


def _entry(curve: BasisExpansion, b: Floats, q: Floats, choices: int) -> GroupScore:
    usual = curve.term.typical
    values = np.linalg.solve(q + np.eye(BASIS_SIZE) / usual**2, b)
    gain = float(values @ b)
    return GroupScore(curve, values, gain, 0.5 * gain + _volume(q, usual) - float(np.log(choices)), choices)


def _volume(information: Floats, usual: float) -> float:
    """Log of the share of its prior that the data leave a law; hats they say nothing of cost nothing."""
    return -0.5 * float(np.linalg.slogdet(np.eye(BASIS_SIZE) + usual**2 * information)[1])


def best_of_each_term(entries: Sequence[GroupScore], count: int) -> list[GroupScore]:
    """The first of each law, of so many laws."""
    best: dict[str, GroupScore] = {}
    for entry in entries:
        best.setdefault(entry.expansion.term.name, entry)
    return list(best.values())[:count]


def fitted_hypothesis(entry: GroupScore, model: Model, noise: Noise, reference: float) -> FittedHypothesis:
    """A model with the law as its last terms; it takes its cost off ``reference``."""
    values = np.array([term.value for term in model.terms[-BASIS_SIZE:]])
    share = log_occam_factor(entry, values, model.covariance[-BASIS_SIZE:, -BASIS_SIZE:])
    return FittedHypothesis(model.terms[-1], model, model.cost, share, 0.0, noise, reference - model.cost)


def log_occam_factor(entry: GroupScore, values: Floats, covariance: Floats) -> float:
    """Log of the prior's density and of the share of it that is left, at the fitted coefficients.

    Parameters
    ----------
    values, covariance : (PIECES,) and (PIECES, PIECES) of the law's coefficients, from the data alone.
    """
    usual = entry.expansion.term.typical
    density = -0.5 * float(values @ values) / usual**2
    return density + _volume(np.linalg.inv(covariance), usual) - float(np.log(entry.choices))


def group_detection_threshold(looks: int, alpha: float) -> float:
    """Gain that nothing hidden exceeds with probability ``alpha`` in so many looks, the model's error shared out."""
    return float(chi2.isf(alpha / max(looks, 1), BASIS_SIZE))
