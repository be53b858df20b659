"""Isolability groups: candidates whose signatures, alone or together, imitate another one's within the noise.

They follow from the joint information matrix and its null vectors, not from pairs: after straight stops mass, pad
friction front and rear and drag are not isolable although no two of them look alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.threshold import ISOLABILITY_SIGMA
from hil.diagnosis.estimation.terms import Candidate, summed

MAX_RIVALS = 4
"""Rivals that imitate together, at most."""
_MIN_REDUCTION = 0.02
"""Share of the separation that one rival more must take off."""


@dataclass(frozen=True, eq=False)
class IsolabilityGroup:
    """The candidates that these data cannot isolate from one of a certain value.

    Attributes
    ----------
    members : the rivals whose joint imitation leaves least of it, the most important first; empty where it is isolable
        from all of them together.
    values : their values in the imitation: with that of the named one, a null vector of the information matrix.
    separation : standard deviations that remain after the best imitation, the rivals' priors included.
    alone : standard deviations without any rival; below `ISOLABILITY_SIGMA` the candidate is not detectable.
    pairs : each rival that imitates it alone, with the standard deviations that remain, the closest first.
    """

    members: tuple[int, ...]
    values: tuple[float, ...]
    separation: float
    alone: float
    pairs: tuple[tuple[int, float], ...]

    @property
    def indices(self) -> tuple[int, ...]:
        """Every rival: of the joint imitation and of the pairs."""
        return tuple(dict.fromkeys((*self.members, *(index for index, _ in self.pairs))))


def isolability_group(
    q: Floats, candidates: Sequence[Candidate], named: int, value: float, offset: int = 0
) -> IsolabilityGroup:
    """The isolability group of ``candidates[named]`` at ``value``.

    Locations of the same effect are no rivals; values of rivals stay within their bounds.

    Parameters
    ----------
    q : (columns, columns) information with the nuisances marginalised
        (`hil.diagnosis.estimation.information.Marginal`); the named candidate must not be marginalised.
    candidates : their ``columns`` count from ``offset`` in ``q``.
    value : of the named candidate, in its unit.
    """
    bounds = np.array([(c.parameter.low, c.parameter.high) for c in candidates])
    precision = np.array([c.prior_sd for c in candidates]) ** -2.0
    own = candidates[named].effect.name
    allowed = np.array([c.effect.name != own for c in candidates])
    return imitation(summed(q, candidates, offset), precision, bounds, named, value, allowed)


def imitation(
    products: Floats, precision: Floats, bounds: Floats, named: int, value: float, allowed: Floats | None = None
) -> IsolabilityGroup:
    """`isolability_group` on plain arrays.

    Parameters
    ----------
    products : (n, n) information matrix, per unit.  precision : (n,) of the normal priors around 0.
    bounds : (n, 2) lowest and highest values.  allowed : (n,) which may be a rival; all but the named by default.
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
    values, separation = _jointly(products, precision, named, value, chosen)
    if separation >= ISOLABILITY_SIGMA:
        return IsolabilityGroup((), (), separation, alone, pairs)
    return IsolabilityGroup(tuple(chosen), tuple(values.tolist()), separation, alone, pairs)


def remaining(products: Floats, precision: Floats, named: int, value: float, rivals: Sequence[int]) -> float:
    """Standard deviations that remain of a signature after the best joint imitation by these rivals."""
    return _jointly(products, precision, named, value, rivals)[1]


def _pairwise(products: Floats, precision: Floats, bounds: Floats, named: int, value: float) -> Floats:
    """Separation from each rival alone, (n,): d'^2 = v^2 (q_ss - q_sr^2 / (q_rr + prior)), within the bounds."""
    penalised = np.maximum(np.diag(products), 0.0) + precision
    cross = value * products[named]
    best = np.clip(cross / penalised, bounds[:, 0], bounds[:, 1])
    left = value * value * products[named, named] - 2.0 * best * cross + best * best * penalised
    return np.asarray(np.sqrt(np.maximum(left, 0.0)))


def _jointly(
    products: Floats, precision: Floats, named: int, value: float, rivals: Sequence[int]
) -> tuple[Floats, float]:
    """Values of the rivals in their best joint imitation, and the separation that remains."""
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
    """Forward selection of rivals until the separation falls below `ISOLABILITY_SIGMA`."""
    chosen: list[int] = []
    left = remaining(products, precision, named, value, chosen)
    while left >= ISOLABILITY_SIGMA and len(chosen) < MAX_RIVALS:
        rival = _next(products, precision, bounds, named, value, rivals, chosen)
        if rival is None:
            break
        less = remaining(products, precision, named, value, [*chosen, rival])
        if less > (1.0 - _MIN_REDUCTION) * left:
            break
        chosen, left = [*chosen, rival], less
    return chosen


def _next(
    products: Floats, precision: Floats, bounds: Floats, named: int, value: float, rivals: Floats, chosen: list[int]
) -> int | None:
    """The rival that, given those chosen, reduces the separation most with all values within their bounds."""
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
    """Backward elimination of rivals that the imitation does not need."""
    for k in list(chosen):
        rest = [other for other in chosen if other != k]
        values, left = _jointly(products, precision, named, value, rest)
        if rest and left < ISOLABILITY_SIGMA and np.all((values >= bounds[rest, 0]) & (values <= bounds[rest, 1])):
            chosen = rest
    return chosen
