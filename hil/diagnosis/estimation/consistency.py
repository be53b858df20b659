"""Consistency: whether every manoeuvre tells the same value of a term.

Takes a fitted model; gives for each term what every segment says of its value. A property of the car has one value in
all manoeuvres; what only imitates an error of the model's form has another in each. Sums of squared scores over the
segments estimate the variance of a value whatever the noise model says (Liang and Zeger 1986, Biometrika 73, 13).
"""

from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import information_blocks
from hil.diagnosis.estimation.model import Model
from hil.diagnosis.noise.model import Noise

_PRIOR_SEGMENTS = 4.0
"""Segments that the assumption of a consistent value counts for: two or three say little of a variance."""


@dataclass(frozen=True)
class Consistency:
    """What the segments say of one term: score and information (segments,), all other parameters marginalised."""

    score: Floats
    information: Floats

    @property
    def effective_segments(self) -> float:
        """Segments that share in the information (Kish 1965, Survey Sampling)."""
        squares = float(np.square(self.information).sum())
        return float(self.information.sum()) ** 2 / squares if squares else 0.0

    @property
    def ratio(self) -> float:
        """Variance of the scores over that by noise: 1 where the noise is all that moves them."""
        return float(np.square(self.score).sum()) / max(float(self.information.sum()), 1e-300)

    @property
    def variance_inflation(self) -> float:
        """Variance of the value over that by noise, at least 1."""
        segments = self.effective_segments
        return max(1.0, (_PRIOR_SEGMENTS + segments * self.ratio) / (_PRIOR_SEGMENTS + segments))


def consistencies(fitter: Fitter, model: Model, noise: Noise) -> list[Consistency]:
    """Of each term of a fitted model.

    A nuisance parameter may be the same quantity as a term: what is left of the term without it is the small difference
    of two large columns.
    """
    if not model.terms:
        return []
    own, count = fitter.term_jacobian(model), len(fitter.nuisances)
    columns = {name: np.hstack([values, own[name]]) for name, values in fitter.nuisance_jacobian_at(model).items()}
    blocks = information_blocks(model.residual, columns, fitter.masks, noise, count, precise=True)
    normal = blocks.total()[1:, 1:]
    normal[range(count), range(count)] += 1.0
    held = fitter.at_bounds(model.z)
    found = []
    for k in range(len(model.terms)):
        at = count + k
        rest = [j for j in range(len(normal)) if j != at and j not in held]
        weights = np.zeros(len(normal))
        weights[at] = 1.0
        weights[rest] = -np.linalg.solve(normal[np.ix_(rest, rest)], normal[rest, at])
        score = np.array([weights @ block[1:, 0] for block in blocks.matrix])
        information = np.array([weights @ block[1:, 1:] @ weights for block in blocks.matrix])
        found.append(Consistency(score, information))
    return found
