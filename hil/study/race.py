"""The race of the unlisted laws: how much each explains at each place, beside what listed effects do."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from hil.study.basis import PIECES, Curve, curves, places
from hil.study.fit import Fitter, Model, Term, Tracks
from hil.study.linear import project, track_columns
from hil.study.noise import Noise
from hil.study.own_error import USUAL
from hil.study.table import Floats
from hil.study.world import World

_SINGLE_WHEELS = ("friction.mu",)
_SHARE = 0.1
_WHEELS = ("fl", "fr", "rl", "rr")


@dataclass(frozen=True, eq=False)
class Entry:
    """A law at a place: coefficients of one linear step, gain in chi2, log of its Bayes factor."""

    curve: Curve
    values: Floats
    gain: float
    evidence: float

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
        return _WHEELS if curve.law.joint in _SINGLE_WHEELS else ("car",)

    def _simulated(self, fitter: Fitter, world: World, model: Model) -> Tracks:
        pieces = [piece for of in self._single for curve in of for piece in curve.pieces]
        steps = [_SHARE * piece.law.usual for piece in pieces]
        worlds = [piece.applied(world, step) for piece, step in zip(pieces, steps, strict=True)]
        return track_columns(fitter.rig, fitter.frame, model.stack or fitter.rig.run(world), worlds, steps)

    def entries(self, fitter: Fitter, model: Model, noise: Noise) -> list[Entry]:
        """Every law at every place it was simulated for, the best first."""
        sums = fitter.screen(model, self.columns, noise)
        accepted = len(model.terms)
        projected = project(sums.total(), sums.nuisances, range(accepted), model.z)
        b, q = projected.b[accepted:], projected.q[accepted:, accepted:]
        found, at = [], 0
        for curve, of in zip(self._curves, self._single, strict=True):
            size = PIECES * len(of)
            own = slice(at, at + size)
            found += self._of(curve, len(of), b[own], q[own, own])
            at += size
        prior = float(np.log(max(len(found), 1)))
        return sorted((_fined(entry, prior) for entry in found), key=lambda entry: -entry.evidence)

    @staticmethod
    def _of(curve: Curve, wheels: int, b: Floats, q: Floats) -> list[Entry]:
        """One law at each place: columns of single wheels summed."""
        found = []
        usual = np.full(PIECES, curve.law.usual**-2.0)
        for placed in places(curve) if wheels > 1 else [curve]:
            members = placed.pieces[0].members() if wheels > 1 else (0,)
            moves = np.hstack([np.eye(PIECES) * float(wheel in members) for wheel in range(wheels)])
            own_b, own_q = moves @ b, moves @ q @ moves.T
            a = own_q + np.diag(usual)
            values = np.linalg.solve(a, own_b)
            gain = float(values @ own_b)
            occam = float(np.linalg.slogdet(a)[1] + np.log(usual**-1.0).sum())
            found.append(Entry(placed, values, gain, 0.5 * (gain - occam)))
        return found


def occam(entry: Entry, covariance: Floats) -> float:
    """Log of the share of its prior that a fitted law uses up."""
    usual = entry.curve.law.usual
    if covariance.shape[0] < PIECES:
        return entry.evidence - 0.5 * entry.gain
    own = covariance[-PIECES:, -PIECES:]
    return 0.5 * (float(np.linalg.slogdet(own)[1]) - 2.0 * PIECES * float(np.log(usual)))


def least_gain(looks: int, alpha: float) -> float:
    """Gain that nothing hidden exceeds with probability ``alpha`` in so many looks, the model's error included."""
    return float(chi2.isf(alpha / max(looks, 1), PIECES)) * USUAL**2


def _fined(entry: Entry, prior: float) -> Entry:
    return Entry(entry.curve, entry.values, entry.gain, entry.evidence - prior)


__all__ = ["Entry", "LawRace", "least_gain", "occam"]
