"""The race: how much each candidate explains beyond nuisances and what is accepted, and what the data cannot show."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from hil.study.candidates import Candidate
from hil.study.linear import Projected

_USUAL = 1.5
SEEN = 3.0
_MEDIAN_CHI2 = 0.455
INDIFFERENT = 0.08
"""Share of an effect's usual size that no model of a car is better than: less is not called a cause."""
_ANYWAY = {"clock_drift": 0.5}
"""The same where healthy parts differ by more: clocks of nodes."""
_LEAST_INFLATION = 2.0


@dataclass(frozen=True, eq=False)
class Score:
    """One candidate: estimate by one linear step, gain in chi2, log of the Bayes factor against leaving it out,
    ``raw`` is the gain before what is too small to matter is taken off;
    how many standard deviations its largest allowed value would make (``reach``) and its usual one (``usual``)."""

    candidate: Candidate
    value: float
    gain: float
    evidence: float
    reach: float
    usual: float
    information: float
    raw: float = 0.0


def scores(candidates: Sequence[Candidate], projected: Projected, offset: int, now: Sequence[float]) -> list[Score]:
    """Scores of all candidates; ``offset`` columns of ``projected`` come before theirs, ``now`` are values in use."""
    found = []
    for candidate, value in zip(candidates, now, strict=True):
        at = [offset + k for k in candidate.columns]
        b, q = float(projected.b[at].sum()), float(projected.q[np.ix_(at, at)].sum())
        found.append(score(candidate, b, q, value))
    return found


def score(candidate: Candidate, b: float, q: float, now: float = 0.0) -> Score:
    """Score from the products of the column with the residual and with itself."""
    parameter = candidate.parameter
    q = max(q, 0.0)
    tau = _USUAL * abs(parameter.typical) if parameter.typical else 0.5 * (parameter.high - parameter.low)
    largest = max(abs(parameter.low), abs(parameter.high))
    if q * largest**2 < 1e-6:
        return Score(candidate, 0.0, 0.0, 0.0, 0.0, 0.0, q)
    step = b / (q + 1.0 / tau**2)
    step = float(np.clip(now + step, parameter.low, parameter.high)) - now
    gain = 2.0 * b * step - q * step * step
    raw = gain
    gain *= relevance(candidate, now + step)
    evidence = 0.5 * (gain - (step / tau) ** 2) - 0.5 * float(np.log1p(q * tau * tau)) - float(np.log(candidate.places))
    reach, usual = largest * float(np.sqrt(q)), tau / _USUAL * float(np.sqrt(q))
    return Score(candidate, now + step, gain, evidence, reach, usual, q, raw)


def relevance(candidate: Candidate, value: float) -> float:
    """Share of a gain that counts: that of the value beyond what no model is better than."""
    least = _ANYWAY.get(candidate.effect.name, INDIFFERENT) * abs(candidate.parameter.typical)
    return max(1.0 - least / max(abs(value), 1e-300), 0.0) ** 2


def threshold(looks: int, alpha: float) -> float:
    """Gain in chi2 that nothing hidden exceeds with probability ``alpha`` in so many looks (Holm's first step)."""
    return float(chi2.isf(alpha / max(looks, 1), 1))


def inflation(found: Sequence[Score]) -> float:
    """How much more candidates explain than noise alone would let them: median gain over that of chi-squared.

    Most candidates are absent; what half of them seem to explain measures the model's own error (genomic control,
    Devlin and Roeder 1999).
    """
    shown = [item.raw for item in found if item.reach > SEEN]
    return float(np.clip(np.median(shown) / _MEDIAN_CHI2, _LEAST_INFLATION, 6.0)) if shown else _LEAST_INFLATION


def leaders(found: Sequence[Score], count: int) -> list[Score]:
    """Best candidates: the best place of each effect's number first, then places that explain nearly as much."""
    ranked = sorted(found, key=lambda s: -s.evidence)
    best: list[Score] = []
    seen: set[tuple[str, str]] = set()
    for item in ranked:
        key = (item.candidate.effect.name, item.candidate.parameter.name)
        if key not in seen and item.gain > 4.0:
            seen.add(key)
            best.append(item)
    top = best[:count]
    if top:
        near = [s for s in ranked if s.evidence > top[0].evidence - 6.0 and s not in top]
        top += near[: max(count // 2, 1)]
    return top


def not_testable(found: Sequence[Score]) -> list[str]:
    """Effects that would not show here at any place, however large they are allowed to be."""
    reach: dict[str, float] = {}
    for item in found:
        name = item.candidate.effect.name
        reach[name] = max(reach.get(name, 0.0), min(item.reach, 3.0 * item.usual))
    return sorted(name for name, value in reach.items() if value < SEEN)
