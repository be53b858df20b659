"""The race of the unlisted laws: how much each explains at each place, beside what listed effects do."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.nonparametric import PIECES, Curve, curves, places
from hil.diagnosis.detection.profile_fit import Contender
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Term, Tracks
from hil.diagnosis.estimation.information import project, track_columns
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.simulation.parameter_set import World
from plant.effects.effect import Scope

_BY_WHEEL, _AXLES = ("friction.mu",), ("front", "rear")
_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class Entry:
    """A law at a place: coefficients of one linear step, gain in chi2, log of its Bayes factor.

    ``choices`` is the number of laws and places that it was chosen from.
    """

    curve: Curve
    values: Floats
    gain: float
    evidence: float
    choices: int

    @property
    def begun(self) -> tuple[Term, ...]:
        """As terms of a model, where they do nothing yet."""
        return tuple(Term(piece, 0.0) for piece in self.curve.pieces)


class LawRace:
    """Sensitivities to all laws at one model, simulated once; wheel by wheel for the law that leads."""

    def __init__(self, fitter: Fitter, world: World) -> None:
        self._rig, self._frame, self._world = fitter.rig, fitter.frame, world
        self._rig.keep(world)
        self._parts = {curve: [curve.at(place) for place in _parts(curve)] for curve in curves(fitter.rig, world)}
        self._columns = self._simulated([part for parts in self._parts.values() for part in parts])

    def _simulated(self, parts: Sequence[Curve]) -> dict[tuple[str, str], Tracks]:
        """Columns of each law and place."""
        pieces = [piece for part in parts for piece in part.pieces]
        steps = [_SHARE * piece.law.usual for piece in pieces]
        worlds = [piece.applied(self._world, step) for piece, step in zip(pieces, steps, strict=True)]
        all_of = track_columns(self._rig, self._frame, self._rig.run(self._world), worlds, steps)
        return {
            (part.law.name, part.place): {
                name: values[:, PIECES * k : PIECES * (k + 1)] for name, values in all_of.items()
            }
            for k, part in enumerate(parts)
        }

    def entries(self, fitter: Fitter, model: Model, noise: Noise) -> list[Entry]:
        """Every law at every place it was simulated for, the best first, by the fitter's sensitivities to numbers."""
        found = self._ranked(fitter, model, noise)
        leading = next(curve for curve in self._parts if curve.law is found[0].curve.law)
        if len(self._parts[leading]) == len(_AXLES):
            self._parts[leading] = [leading.at(wheel) for wheel in Scope.WHEEL.members]
            self._rig.keep(self._world)
            self._columns |= self._simulated(self._parts[leading])
            found = self._ranked(fitter, model, noise)
        return found

    def columns(self, entry: Entry) -> Tracks:
        """Sensitivities to the coefficients of a law at a place."""
        curve = next(curve for curve in self._parts if curve.law is entry.curve.law)
        parts = self._parts[curve]
        taken = next(taken for placed, taken in _offered(curve, parts) if placed.place == entry.curve.place)
        listed = [self._columns[parts[k].law.name, parts[k].place] for k in taken]
        return {name: np.sum([columns[name] for columns in listed], axis=0) for name in listed[0]}

    def _ranked(self, fitter: Fitter, model: Model, noise: Noise) -> list[Entry]:
        listed = [self._columns[part.law.name, part.place] for parts in self._parts.values() for part in parts]
        joined = {name: np.hstack([columns[name] for columns in listed]) for name in self._frame.names}
        sums = fitter.screen(model, joined, noise)
        accepted = len(model.terms)
        projected = project(sums.total(), sums.nuisances, range(accepted), model.z, fitter.at_their_end(model.z))
        b, q = projected.b[accepted:], projected.q[accepted:, accepted:]
        offered = {curve: _offered(curve, parts) for curve, parts in self._parts.items()}
        choices = sum(map(len, offered.values()))
        found, at = [], 0
        for curve, parts in self._parts.items():
            size = PIECES * len(parts)
            own = slice(at, at + size)
            for placed, taken in offered[curve]:
                moves = np.hstack([np.eye(PIECES) * float(k in taken) for k in range(len(parts))])
                found.append(_entry(placed, moves @ b[own], moves @ q[own, own] @ moves.T, choices))
            at += size
        return sorted(found, key=lambda entry: -entry.evidence)


def _parts(curve: Curve) -> Sequence[str]:
    """Places that are simulated at first; all others are sums of them."""
    return _AXLES if curve.law.joint in _BY_WHEEL else ("car",)


def _offered(curve: Curve, parts: Sequence[Curve]) -> list[tuple[Curve, list[int]]]:
    """The law at every place that parts add up to, with those parts."""
    found = []
    for placed in places(curve):
        members = set(placed.pieces[0].members())
        taken = [k for k, part in enumerate(parts) if set(part.pieces[0].members()) <= members]
        if sum(len(parts[k].pieces[0].members()) for k in taken) == len(members):
            found.append((placed, taken))
    return found


def _entry(curve: Curve, b: Floats, q: Floats, choices: int) -> Entry:
    usual = curve.law.usual
    values = np.linalg.solve(q + np.eye(PIECES) / usual**2, b)
    gain = float(values @ b)
    return Entry(curve, values, gain, 0.5 * gain + _volume(q, usual) - float(np.log(choices)), choices)


def _volume(information: Floats, usual: float) -> float:
    """Log of the share of its prior that the data leave a law; hats they say nothing of cost nothing."""
    return -0.5 * float(np.linalg.slogdet(np.eye(PIECES) + usual**2 * information)[1])


def best_of_each(entries: Sequence[Entry], count: int) -> list[Entry]:
    """The first of each law, of so many laws."""
    best: dict[str, Entry] = {}
    for entry in entries:
        best.setdefault(entry.curve.law.name, entry)
    return list(best.values())[:count]


def with_law(entry: Entry, model: Model, noise: Noise, reference: float) -> Contender:
    """A model with the law as its last terms; it takes its cost off ``reference``."""
    values = np.array([term.value for term in model.terms[-PIECES:]])
    share = share_left(entry, values, model.covariance[-PIECES:, -PIECES:])
    return Contender(model.terms[-1], model, model.cost, share, 0.0, noise, reference - model.cost)


def share_left(entry: Entry, values: Floats, covariance: Floats) -> float:
    """Log of the prior's density and of the share of it that is left, at the fitted coefficients.

    Parameters
    ----------
    values, covariance : (PIECES,) and (PIECES, PIECES) of the law's coefficients, from the data alone.
    """
    usual = entry.curve.law.usual
    density = -0.5 * float(values @ values) / usual**2
    return density + _volume(np.linalg.inv(covariance), usual) - float(np.log(entry.choices))


def least_gain(looks: int, alpha: float) -> float:
    """Gain that nothing hidden exceeds with probability ``alpha`` in so many looks, the model's error shared out."""
    return float(chi2.isf(alpha / max(looks, 1), PIECES))
