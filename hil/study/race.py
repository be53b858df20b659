"""The race of the unlisted laws: how much each explains at each place, beside what listed effects do."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from hil.study.basis import PIECES, Curve, curves, places
from hil.study.fit import Fitter, Model, Term, Tracks
from hil.study.linear import project, track_columns
from hil.study.noise import Noise
from hil.study.table import Floats
from hil.study.world import World
from plant.effects.effect import Scope

_SINGLE_WHEELS = ("friction.mu",)
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
    def terms(self) -> tuple[Term, ...]:
        """As terms of a model."""
        return tuple(Term(piece, float(value)) for piece, value in zip(self.curve.pieces, self.values, strict=True))


class LawRace:
    """Sensitivities to all laws at one model, simulated once."""

    def __init__(self, fitter: Fitter, world: World, model: Model) -> None:
        self._curves = curves(fitter.rig, world)
        self._single = [[curve.at(place) for place in self._places(curve)] for curve in self._curves]
        self.columns = self._simulated(fitter, world, model)

    @staticmethod
    def _places(curve: Curve) -> Sequence[str]:
        return Scope.WHEEL.members if curve.law.joint in _SINGLE_WHEELS else ("car",)

    def _simulated(self, fitter: Fitter, world: World, model: Model) -> Tracks:
        pieces = [piece for of in self._single for curve in of for piece in curve.pieces]
        steps = [_SHARE * piece.law.usual for piece in pieces]
        worlds = [piece.applied(world, step) for piece, step in zip(pieces, steps, strict=True)]
        return track_columns(fitter.rig, fitter.frame, model.stack or fitter.rig.run(world), worlds, steps)

    def entries(self, fitter: Fitter, model: Model, noise: Noise) -> list[Entry]:
        """Every law at every place it was simulated for, the best first."""
        sums = fitter.screen(model, self.columns, noise)
        accepted = len(model.terms)
        projected = project(sums.total(), sums.nuisances, range(accepted), model.z, fitter.at_their_end(model.z))
        b, q = projected.b[accepted:], projected.q[accepted:, accepted:]
        choices = sum(len(self._offered(curve, of)) for curve, of in zip(self._curves, self._single, strict=True))
        found, at = [], 0
        for curve, of in zip(self._curves, self._single, strict=True):
            size = PIECES * len(of)
            own = slice(at, at + size)
            for placed in self._offered(curve, of):
                members = placed.pieces[0].members() if len(of) > 1 else (0,)
                moves = np.hstack([np.eye(PIECES) * float(wheel in members) for wheel in range(len(of))])
                found.append(_entry(placed, moves @ b[own], moves @ q[own, own] @ moves.T, choices))
            at += size
        return sorted(found, key=lambda entry: -entry.evidence)

    @staticmethod
    def _offered(curve: Curve, of: Sequence[Curve]) -> list[Curve]:
        """The law at every place where it is in the race: columns of single wheels are summed."""
        return list(places(curve)) if len(of) > 1 else [curve]


def _entry(curve: Curve, b: Floats, q: Floats, choices: int) -> Entry:
    usual = curve.law.usual
    values = np.linalg.solve(q + np.eye(PIECES) / usual**2, b)
    gain = float(values @ b)
    return Entry(curve, values, gain, 0.5 * gain + _volume(q, usual) - float(np.log(choices)), choices)


def _volume(information: Floats, usual: float) -> float:
    """Log of the share of its prior that the data leave a law; hats they say nothing of cost nothing."""
    return -0.5 * float(np.linalg.slogdet(np.eye(PIECES) + usual**2 * information)[1])


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
