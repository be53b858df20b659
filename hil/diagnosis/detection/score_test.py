"""The race: how much each candidate explains beyond nuisances and what is accepted, and what the data cannot show."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.information import InformationBlocks, Marginal, marginalise
from hil.diagnosis.estimation.model_discrepancy import variance_inflation
from hil.diagnosis.estimation.terms import PRIOR_SD_IN_TYPICAL_SIZES, Candidate

MIN_SNR = 3.0
SHORTLIST_SIZE = 5
"""How many of the best candidates are fitted, at least."""
_MEDIAN_CHI2 = 0.455
_MOST_INFLATION = 6.0


@dataclass(frozen=True, eq=False)
class ScoreTest:
    """One candidate: estimate by one linear step, gain in chi2, log of the Bayes factor against leaving it out;
    how many standard deviations its largest allowed value would make (``reach``) and its usual one (``usual``).

    ``raw`` is the gain before it is shared out over the model's own error (`hil.diagnosis.estimation.model_discrepancy`); ``replayed``
    where it is that of a replay at this value (`hil.diagnosis.detection.zero_gradient`). ``since`` is when it begins, as drive and s
    in it, None where it is always there; ``price`` what the choice of that takes off its gain (`paid`: of whatever the
    data chose).
    """

    candidate: Candidate
    value: float
    gain: float
    log_bayes_factor: float
    max_snr: float
    typical_snr: float
    information: float
    raw_gain: float = 0.0
    replayed: bool = False
    onset: tuple[int, float] | None = None
    onset_penalty: float = 0.0

    @property
    def total_penalty(self) -> float:
        """What all that was chosen by the data takes off its gain."""
        return self.onset_penalty + self.candidate.selection_penalty


def scores(candidates: Sequence[Candidate], projected: Marginal, offset: int, now: Sequence[float]) -> list[ScoreTest]:
    """Scores of all candidates; ``offset`` columns of ``projected`` come before theirs, ``now`` are values in use."""
    found = []
    for candidate, value in zip(candidates, now, strict=True):
        at = [offset + k for k in candidate.columns]
        b, q = float(projected.b[at].sum()), float(projected.q[np.ix_(at, at)].sum())
        found.append(score(candidate, b, q, value))
    return found


def score(candidate: Candidate, b: float, q: float, now: float = 0.0) -> ScoreTest:
    """Score from the products of the column with the residual and with itself."""
    parameter = candidate.parameter
    q = max(q, 0.0)
    tau = candidate.prior_sd
    largest = max(abs(parameter.low), abs(parameter.high))
    if q * largest**2 < 1e-6:
        return ScoreTest(candidate, 0.0, 0.0, 0.0, 0.0, 0.0, q)
    step = b / (q + 1.0 / tau**2)
    step = float(np.clip(now + step, parameter.low, parameter.high)) - now
    gain = 2.0 * b * step - q * step * step
    raw = gain
    gain = raw / variance_inflation(candidate) - candidate.selection_penalty
    evidence = 0.5 * (raw - candidate.selection_penalty) + log_occam_factor(candidate, q, step)
    reach, usual = largest * float(np.sqrt(q)), tau / PRIOR_SD_IN_TYPICAL_SIZES * float(np.sqrt(q))
    return ScoreTest(candidate, now + step, gain, evidence, reach, usual, q, raw)


def log_occam_factor(candidate: Candidate, information: float, value: float) -> float:
    """Log of the share of its prior that data leave a candidate at its value, one of its places."""
    tau = candidate.prior_sd
    return (
        -0.5 * float(np.log1p(information * tau * tau)) - 0.5 * (value / tau) ** 2 - float(np.log(candidate.locations))
    )


def rescored(item: ScoreTest, value: float, raw: float, information: float) -> ScoreTest:
    """A candidate looked at again: with another value, gain and information."""
    evidence = 0.5 * (raw - item.total_penalty) + log_occam_factor(item.candidate, information, value)
    gain = raw / variance_inflation(item.candidate) - item.total_penalty
    return replace(item, value=value, gain=gain, log_bayes_factor=evidence, information=information, raw_gain=raw)


def replayed_score(item: ScoreTest, value: float, raw: float) -> ScoreTest:
    """A candidate that was replayed at a value and takes so much off the cost there."""
    return replace(rescored(item, value, raw, raw / value**2), replayed=True)


def detection_threshold(looks: int, alpha: float) -> float:
    """Gain in chi2 that nothing hidden exceeds with probability ``alpha`` in so many looks (Holm's first step)."""
    return float(chi2.isf(alpha / max(looks, 1), 1))


def inflation_factor(found: Sequence[ScoreTest]) -> float:
    """How much more candidates explain here than noise and the model's usual error let them, at least 1.

    Most candidates are absent; what half of them seem to explain measures how wrong the model is for these logs (median
    gain over that of chi-squared: genomic control, Devlin and Roeder 1999).
    """
    shown = [item.gain for item in found if item.max_snr > MIN_SNR]
    return float(np.clip(np.median(shown) / _MEDIAN_CHI2, 1.0, _MOST_INFLATION)) if shown else 1.0


def scores_given_best(
    found: Sequence[ScoreTest], sums: InformationBlocks, z: Floats, held: Sequence[int], accepted: int = 0
) -> list[ScoreTest]:  # fmt: skip
    """What all candidates explain beside the best of them, whose members take what they can.

    A cause shows through whatever resembles it, and is no sign of a wrong model. ``accepted`` causes are in the model.
    """
    best = max(found, key=lambda item: item.raw_gain)
    taken = (*range(accepted), *(accepted + k for k in best.candidate.columns))
    left = marginalise(sums.total(), sums.nuisances, taken, z, held)
    return scores([item.candidate for item in found], left, accepted, [0.0] * len(found))


def shortlist(found: Sequence[ScoreTest], count: int) -> list[ScoreTest]:
    """Best candidates, the best place of each effect's number: by evidence, and by what the model's error leaves of it.

    Then places of the very best that explain nearly as much.
    """
    ranked = sorted(found, key=lambda s: -s.log_bayes_factor)
    best: dict[tuple[str, str], ScoreTest] = {}
    for item in ranked:
        if item.raw_gain > 4.0:
            best.setdefault((item.candidate.effect.name, item.candidate.parameter.name), item)
    by_evidence = list(best.values())
    by_gain = sorted(by_evidence, key=lambda s: -s.gain)
    top = list(dict.fromkeys([*by_evidence[:count], *by_gain[: max(count // 2, 1)]]))
    if top:
        near = [s for s in ranked if s.log_bayes_factor > top[0].log_bayes_factor - 6.0 and s not in top]
        top += near[: max(count // 2, 1)]
    return top


def undetectable_effects(found: Sequence[ScoreTest]) -> list[str]:
    """Effects that would not show here at any place, however large they are allowed to be."""
    reach: dict[str, float] = {}
    for item in found:
        name = item.candidate.effect.name
        reach[name] = max(reach.get(name, 0.0), min(item.max_snr, 3.0 * item.typical_snr))
    return sorted(name for name, value in reach.items() if value < MIN_SNR)
