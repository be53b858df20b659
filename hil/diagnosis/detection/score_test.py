"""Score test (Rao 1948): what each candidate gains by one linear step, nuisance parameters marginalised.

Takes the information matrix of a model, gives a `ScoreTest` for each candidate. Three kinds of candidates: those with a
gradient (`scores`), those behind a limit, which one step does not show (`line_search`), and those that act from a later
segment on (`scan_onset_by_segment`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.data.dataset import ROW_S, Dataset
from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.threshold import (
    MAX_INFLATION,
    MAX_TYPICAL_SIZES,
    MEDIAN_CHI2,
    MIN_SNR,
    MIN_SNR_BEFORE_ONSET,
    MIN_SNR_OF_A_TEST,
    ONSET_STEP_S,
    SHORTLIST_LOG_BAYES_RANGE,
    SHORTLIST_MIN_GAIN,
    TESTS_PER_PARAMETER,
    ZERO_GRADIENT_SNR,
)
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import InformationBlocks, Marginal, marginalise, marginalise_from_onset
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.estimation.model_discrepancy import corrected_gain
from hil.diagnosis.estimation.terms import PRIOR_SD_IN_TYPICAL_SIZES, Candidate, log_prior
from hil.diagnosis.noise.model import Noise, SampleMasks

OnsetTime = tuple[int, float]
"""From when a term acts: index of the recording, s in it."""
_LEAST_INFORMATION = 1e-6
"""Squared standard deviations of the largest value below which a column is zero but for rounding."""
_ROUNDS, _GOLDEN = 8, 0.618


@dataclass(frozen=True, eq=False)
class ScoreTest:
    """Result for one candidate.

    Attributes
    ----------
    value : estimate by one linear step, or by `line_search`, in the parameter's unit.
    gain : reduction of chi-squared, divided by the model discrepancy, less `total_penalty`; ``raw_gain`` is neither.
    log_bayes_factor : against leaving the candidate out.
    max_snr, typical_snr : standard deviations that its largest allowed and its typical value make.
    information : inverse variance of the value by the data.
    replayed : the gain is that of a simulation at ``value``.
    onset : when it starts to act; None: always there.  onset_penalty : for the choice of that time.
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
    onset: OnsetTime | None = None
    onset_penalty: float = 0.0

    @property
    def total_penalty(self) -> float:
        """What is subtracted from the gain for all that the data chose."""
        return self.onset_penalty + self.candidate.selection_penalty


def candidate_key(candidate: Candidate) -> tuple[str, str, str]:
    """Names of effect, parameter and location."""
    return candidate.effect.name, candidate.parameter.name, candidate.location


def scores(
    candidates: Sequence[Candidate], marginal: Marginal, offset: int, current: Sequence[float]
) -> list[ScoreTest]:
    """Test all candidates; their columns of ``marginal`` start at ``offset``, ``current`` are their values now."""
    tests = []
    for candidate, value in zip(candidates, current, strict=True):
        at = [offset + k for k in candidate.columns]
        b, q = float(marginal.b[at].sum()), float(marginal.q[np.ix_(at, at)].sum())
        tests.append(score(candidate, b, q, value))
    return tests


def score(candidate: Candidate, b: float, q: float, current: float = 0.0) -> ScoreTest:
    """Test a candidate by the products of its signature with the innovations, ``b``, and with itself, ``q``."""
    parameter = candidate.parameter
    q = max(q, 0.0)
    tau = candidate.prior_sd
    largest = max(abs(parameter.low), abs(parameter.high))
    if q * largest**2 < _LEAST_INFORMATION:
        return ScoreTest(candidate, 0.0, 0.0, 0.0, 0.0, 0.0, q)
    step = b / (q + 1.0 / tau**2)
    step = float(np.clip(current + step, parameter.low, parameter.high)) - current
    raw = 2.0 * b * step - q * step * step
    gain = corrected_gain(candidate, raw, current + step) - candidate.selection_penalty
    log_bayes_factor = 0.5 * (raw - candidate.selection_penalty) + log_occam_factor(candidate, q, step)
    max_snr, typical_snr = largest * float(np.sqrt(q)), tau / PRIOR_SD_IN_TYPICAL_SIZES * float(np.sqrt(q))
    return ScoreTest(candidate, current + step, gain, log_bayes_factor, max_snr, typical_snr, q, raw)


def log_occam_factor(candidate: Candidate, information: float, value: float) -> float:
    """Log of posterior over prior volume at a value, the location being one of those possible (MacKay 1992)."""
    tau = candidate.prior_sd
    volume = -0.5 * float(np.log1p(information * tau * tau))
    return volume + log_prior(value, tau) - float(np.log(candidate.locations))


def rescored(item: ScoreTest, value: float, raw: float, information: float) -> ScoreTest:
    """The test with another value, gain in chi-squared and information."""
    log_bayes_factor = 0.5 * (raw - item.total_penalty) + log_occam_factor(item.candidate, information, value)
    gain = corrected_gain(item.candidate, raw, value, item.onset is None) - item.total_penalty
    return replace(
        item, value=value, gain=gain, log_bayes_factor=log_bayes_factor, information=information, raw_gain=raw
    )


def replayed_score(item: ScoreTest, value: float, raw: float) -> ScoreTest:
    """The test of a candidate that, simulated at ``value``, takes ``raw`` off the cost."""
    return replace(rescored(item, value, raw, raw / value**2), replayed=True)


# --- behind a limit


def has_zero_gradient(item: ScoreTest) -> bool:
    """Whether a small step of the candidate changes nothing."""
    return item.max_snr < ZERO_GRADIENT_SNR and item.candidate.parameter.typical != 0.0


def line_search(fitter: Fitter, model: Model, noise: Noise, item: ScoreTest) -> ScoreTest:
    """Test a candidate with zero gradient at the size that explains most; its value is 0 where none does.

    The cost is flat up to the limit, falls and rises again: golden section (Kiefer 1953), outwards where two sizes gain
    the same. The change of cost at its largest and its typical size, up or down, is its SNR squared.
    """
    parameter = item.candidate.parameter
    reference = fitter.cost(model.residual, model.z, noise)

    def change(size: float) -> float:
        return fitter.at(model.z, (*model.terms, Term(item.candidate, size)), noise).cost - reference

    near, far = 0.0, parameter.high if parameter.typical > 0.0 else parameter.low
    if not (at_largest := change(far)):
        return item
    tried = {far: at_largest}
    inner, outer = far - _GOLDEN * far, _GOLDEN * far
    for _ in range(_ROUNDS):
        for size in (inner, outer):
            if size not in tried:
                tried[size] = change(size)
        if tried[outer] <= tried[inner]:
            near, inner, outer = inner, outer, inner + _GOLDEN * (far - inner)
        else:
            far, inner, outer = outer, outer - _GOLDEN * (outer - near), inner
    item = replace(item, max_snr=abs(at_largest) ** 0.5, typical_snr=abs(change(parameter.typical)) ** 0.5)
    best = min(tried, key=lambda size: tried[size])
    return replayed_score(item, best, -tried[best]) if tried[best] < 0.0 else item


# --- from a later segment on


def segment_starts(dataset: Dataset) -> list[OnsetTime]:
    """When each segment starts."""
    return [(recording, segment.first * ROW_S) for recording, segment in dataset.segments]


def onset_penalty(masks: SampleMasks) -> float:
    """Penalty for the choice of an onset, in chi-squared: twice the log of the number of times offered."""
    return 2.0 * float(np.log(len(masks.log_start) * masks.sample_s / ONSET_STEP_S))


def scan_onset_by_segment(
    tests: Sequence[ScoreTest], blocks: InformationBlocks, accepted: int, z: Floats, fixed: Sequence[int],
    starts: Sequence[OnsetTime], penalty: float,
) -> list[ScoreTest]:  # fmt: skip
    """Each candidate with the segment from which on it gains more, less the penalty, than as always there.

    The signature of a cause with an onset is little of that of an ever-present one, and the nuisance parameters absorb
    a part of it: from half of the data on an ever-present candidate keeps about a quarter of its gain.

    Parameters
    ----------
    accepted : terms of the model; their columns are the first of ``blocks`` after the nuisances.
    z : nuisance parameters, in prior sds; the ``fixed`` ones are not marginalised.
    starts : of each segment.  penalty : for the choice of one, in chi-squared.
    """
    columns = [[accepted + k for k in item.candidate.columns] for item in tests]
    b, q = marginalise_from_onset(blocks, columns, range(accepted), z, fixed)
    return [_with_onset(item, b[:, k], q[:, k], starts, penalty) for k, item in enumerate(tests)]


def _with_onset(item: ScoreTest, b: Floats, q: Floats, starts: Sequence[OnsetTime], penalty: float) -> ScoreTest:
    if item.replayed:
        return item
    first = 1 + int(np.argmax(b[1:] ** 2 / np.maximum(q[1:], 1e-30))) if len(b) > 1 else 0
    from_there = score(item.candidate, float(b[first]), float(q[first]))
    before = max(float(q[0] - q[first]), 0.0)
    if first == 0 or abs(from_there.value) * before**0.5 < MIN_SNR_BEFORE_ONSET:
        return item
    recordings = [recording for recording, _ in starts]
    logs = recordings if len(set(recordings)) > 1 else range(len(recordings))
    if _gain_without_best(from_there.value * -np.diff(b, append=0.0)[first:], logs[first:]) < MIN_SNR_BEFORE_ONSET**2:
        return item  # what the model gets wrong in one segment is no onset
    later = replace(item, onset=starts[first], onset_penalty=penalty)
    later = rescored(later, from_there.value, from_there.raw_gain, from_there.information)
    return later if later.gain > item.gain and later.log_bayes_factor > item.log_bayes_factor else item


def _gain_without_best(gains: Floats, logs: Sequence[int]) -> float:
    """Gain in all recordings but the best; of a single recording, in all segments but the best."""
    labels = np.array(logs)
    return float(gains.sum()) - max(float(gains[labels == log].sum()) for log in set(logs))


# --- all tests together


def effective_number_of_tests(tests: Sequence[ScoreTest]) -> int:
    """Effect parameters that can show at all, times `TESTS_PER_PARAMETER` for their locations."""
    names = {(s.candidate.effect.name, s.candidate.parameter.name) for s in tests if s.max_snr > MIN_SNR_OF_A_TEST}
    return max(1, round(TESTS_PER_PARAMETER * len(names)))


def inflation_factor(tests: Sequence[ScoreTest]) -> float:
    """How much more candidates gain than noise and model discrepancy let them, 1 to `MAX_INFLATION`.

    Most candidates are absent: what half of them gain says how wrong the model is for these logs (median gain over that
    of chi-squared: genomic control, Devlin and Roeder 1999).
    """
    gains = [item.gain for item in tests if item.max_snr > MIN_SNR]
    return float(np.clip(np.median(gains) / MEDIAN_CHI2, 1.0, MAX_INFLATION)) if gains else 1.0


def scores_given_best(
    tests: Sequence[ScoreTest], blocks: InformationBlocks, z: Floats, fixed: Sequence[int], accepted: int = 0
) -> list[ScoreTest]:
    """What all candidates gain given the best one, which is marginalised with the ``accepted`` terms of the model."""
    best = max(tests, key=lambda item: item.raw_gain)
    given = (*range(accepted), *(accepted + k for k in best.candidate.columns))
    marginal = marginalise(blocks.total(), blocks.nuisances, given, z, fixed)
    return scores([item.candidate for item in tests], marginal, accepted, [0.0] * len(tests))


def inflation_given_best(tests: Sequence[ScoreTest], blocks: InformationBlocks, fitter: Fitter, model: Model) -> float:
    """Inflation factor given the terms of a model and the best candidate: a cause shows through all that resembles it,
    which is no sign of a wrong model."""
    return inflation_factor(scores_given_best(tests, blocks, model.z, fitter.at_bounds(model.z), len(model.terms)))


def shortlist(tests: Sequence[ScoreTest], count: int) -> list[ScoreTest]:
    """Best location of each effect parameter: ``count`` by Bayes factor, half as many by gain; then other locations of
    the very best with nearly its Bayes factor."""
    ranked = sorted(tests, key=lambda s: -s.log_bayes_factor)
    best: dict[tuple[str, str], ScoreTest] = {}
    for item in ranked:
        if item.raw_gain > SHORTLIST_MIN_GAIN:
            best.setdefault((item.candidate.effect.name, item.candidate.parameter.name), item)
    by_bayes_factor = list(best.values())
    by_gain = sorted(by_bayes_factor, key=lambda s: -s.gain)
    top = list(dict.fromkeys([*by_bayes_factor[:count], *by_gain[: max(count // 2, 1)]]))
    if top:
        least = top[0].log_bayes_factor - SHORTLIST_LOG_BAYES_RANGE
        top += [s for s in ranked if s.log_bayes_factor > least and s not in top][: max(count // 2, 1)]
    return top


def undetectable_effects(tests: Sequence[ScoreTest]) -> list[str]:
    """Effects that these manoeuvres would show at no location, however large."""
    snr: dict[str, float] = {}
    for item in tests:
        name = item.candidate.effect.name
        snr[name] = max(snr.get(name, 0.0), min(item.max_snr, MAX_TYPICAL_SIZES * item.typical_snr))
    return sorted(name for name, value in snr.items() if value < MIN_SNR)
