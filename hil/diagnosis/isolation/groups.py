"""What cannot be told apart: causes whose signatures, alone or together, imitate another one's within the noise.

From the joint information matrix and its null vectors, not from pairs: mass, pad friction front and rear and drag are
tied by straight stops although no two of them look alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.threshold import ISOLABILITY_SIGMA
from hil.diagnosis.estimation.terms import Candidate

MOST_RIVALS = 4
_LEAST_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class IsolabilityGroup:
    """What imitates a candidate of a certain value.

    Attributes
    ----------
    members : the rivals that together leave least of it, the most important first; empty where they leave too much to
        be tied with it. A single one where that is enough.
    values : their values in the imitation: with the named one's, a null vector of the information.
    apart : standard deviations left after the best imitation, the rivals' usual sizes held against them.
    alone : standard deviations it stands out with nothing to imitate it; below `ISOLABILITY_SIGMA` nothing is to be told.
    pairs : each rival that imitates it alone, with the standard deviations left, the closest first.
    """

    members: tuple[int, ...]
    values: tuple[float, ...]
    separation: float
    alone: float
    pairs: tuple[tuple[int, float], ...]

    @property
    def indices(self) -> tuple[int, ...]:
        """All that are tied with it: together or one by one."""
        return tuple(dict.fromkeys((*self.members, *(index for index, _ in self.pairs))))


def summed(q: Floats, candidates: Sequence[Candidate], offset: int = 0) -> Floats:
    """Products of the candidates' signatures: columns that move together summed, (candidates, candidates)."""
    moves = np.zeros((len(candidates), q.shape[0]))
    for row, candidate in enumerate(candidates):
        moves[row, [offset + k for k in candidate.columns]] = 1.0
    return np.asarray(moves @ q @ moves.T)


def isolability_group(
    q: Floats, candidates: Sequence[Candidate], named: int, value: float, offset: int = 0
) -> IsolabilityGroup:
    """What cannot be told from ``candidates[named]`` of size ``value`` by these data.

    Places of the same effect are no rivals; values of rivals stay within their bounds.

    Parameters
    ----------
    q : (columns, columns) whitened products after the nuisances are projected out
        (`hil.diagnosis.estimation.information.Marginal`); the named candidate must not be projected out.
    candidates : their ``columns`` count from ``offset`` in ``q``.
    value : of the named one, in its unit.
    """
    bounds = np.array([(c.parameter.low, c.parameter.high) for c in candidates])
    precision = np.array([c.prior_sd for c in candidates]) ** -2.0
    own = candidates[named].effect.name
    allowed = np.array([c.effect.name != own for c in candidates])
    return imitation(summed(q, candidates, offset), precision, bounds, named, value, allowed)


def imitation(
    products: Floats, precision: Floats, bounds: Floats, named: int, value: float, allowed: Floats | None = None
) -> IsolabilityGroup:
    """`isolability_group` on plain numbers.

    Parameters
    ----------
    products : (n, n) of the signatures per unit.  precision : (n,) of the normal priors around 0.
    bounds : (n, 2) lowest and highest values.  allowed : (n,) whether it may be a rival, all but the named by default.
    """
    rivals = np.ones(len(products), bool) if allowed is None else np.asarray(allowed, bool).copy()
    rivals[named] = False
    rivals &= np.diag(products) > 0.0
    total = value * value * max(float(products[named, named]), 0.0)
    alone = float(np.sqrt(total))
    if alone < ISOLABILITY_SIGMA:
        return IsolabilityGroup((), (), alone, alone, ())
    left = _pairwise(products, precision, bounds, named, value)
    left[~rivals] = np.inf
    pairs = tuple((int(k), float(left[k])) for k in np.argsort(left) if left[k] < ISOLABILITY_SIGMA)
    chosen = _forward(products, precision, bounds, named, value, rivals)
    chosen = _backward(products, precision, bounds, named, value, chosen)
    values, apart = _jointly(products, precision, named, value, chosen)
    if apart >= ISOLABILITY_SIGMA:
        return IsolabilityGroup((), (), apart, alone, pairs)
    return IsolabilityGroup(tuple(chosen), tuple(values.tolist()), apart, alone, pairs)


def remaining(products: Floats, precision: Floats, named: int, value: float, rivals: Sequence[int]) -> float:
    """Standard deviations left of a signature after the best imitation by all these rivals together."""
    return _jointly(products, precision, named, value, rivals)[1]


def _pairwise(products: Floats, precision: Floats, bounds: Floats, named: int, value: float) -> Floats:
    """What each rival alone leaves, (n,): d'^2 = v^2 (q_ss - q_sr^2 / (q_rr + prior)), at the bound where it is met."""
    penalised = np.maximum(np.diag(products), 0.0) + precision
    cross = value * products[named]
    best = np.clip(cross / penalised, bounds[:, 0], bounds[:, 1])
    left = value * value * products[named, named] - 2.0 * best * cross + best * best * penalised
    return np.asarray(np.sqrt(np.maximum(left, 0.0)))


def _jointly(
    products: Floats, precision: Floats, named: int, value: float, rivals: Sequence[int]
) -> tuple[Floats, float]:
    """Values of the rivals that imitate best, and what they leave."""
    total = value * value * float(products[named, named])
    if not rivals:
        return np.zeros(0), float(np.sqrt(max(total, 0.0)))
    at = list(rivals)
    a = products[np.ix_(at, at)] + np.diag(precision[at])
    cross = value * products[at, named]
    scale = 1.0 / np.sqrt(np.diag(a))  # units differ by ten decades
    values = scale * np.linalg.solve(a * scale[:, None] * scale, scale * cross)
    return np.asarray(values), float(np.sqrt(max(total - float(values @ cross), 0.0)))


def _forward(
    products: Floats, precision: Floats, bounds: Floats, named: int, value: float, rivals: Floats
) -> list[int]:
    """The rival that helps most, again and again, until what is left is within the noise."""
    chosen: list[int] = []
    left = remaining(products, precision, named, value, chosen)
    while left >= ISOLABILITY_SIGMA and len(chosen) < MOST_RIVALS:
        found = _next(products, precision, bounds, named, value, rivals, chosen)
        if found is None:
            break
        better = remaining(products, precision, named, value, [*chosen, found])
        if better > (1.0 - _LEAST_SHARE) * left:
            break
        chosen, left = [*chosen, found], better
    return chosen


def _next(
    products: Floats, precision: Floats, bounds: Floats, named: int, value: float, rivals: Floats, chosen: list[int]
) -> int | None:
    """The rival that leaves least beside those chosen with all values within their bounds."""
    cross, own = products[named].copy(), np.diag(products) + precision
    if chosen:
        a = products[np.ix_(chosen, chosen)] + np.diag(precision[chosen])
        solved = np.linalg.solve(a, products[chosen])
        cross -= products[named, chosen] @ solved
        own = own - np.einsum("ck,ck->k", products[chosen], solved)
    gain = np.where(rivals, cross**2 / np.maximum(own, 1e-300), 0.0)
    gain[chosen] = 0.0
    for k in np.argsort(-gain):
        if gain[k] <= 0.0:
            return None
        at = [*chosen, int(k)]
        values, _ = _jointly(products, precision, named, value, at)
        if np.all((values >= bounds[at, 0]) & (values <= bounds[at, 1])):
            return int(k)
    return None


def _backward(
    products: Floats, precision: Floats, bounds: Floats, named: int, value: float, chosen: list[int]
) -> list[int]:
    """Without those that were not needed after all."""
    for k in list(chosen):
        rest = [other for other in chosen if other != k]
        values, left = _jointly(products, precision, named, value, rest)
        if rest and left < ISOLABILITY_SIGMA and np.all((values >= bounds[rest, 0]) & (values <= bounds[rest, 1])):
            chosen = rest
    return chosen
