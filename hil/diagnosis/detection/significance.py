"""Significance: whether a cause gains more than noise, model discrepancy and the form of accepted causes explain, and
whether its value is away from zero.

Takes fitted hypotheses and the `hil.diagnosis.detection.threshold.DetectionThreshold`; says which are significant, and
takes out what is not needed at the end (`eliminate_backward`).
"""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.candidates import CandidateSet
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.detection.profile_fit import FittedHypothesis, at_bound, corrected, criterion, log_bayes_factor
from hil.diagnosis.detection.result import Progress, causes_in
from hil.diagnosis.detection.threshold import (
    FORM_ERROR,
    FORM_ERROR_SAME_POINT,
    INDISTINGUISHABLE,
    STRUCTURE_MISMATCH,
    DetectionThreshold,
    chi2_quantile,
)
from hil.diagnosis.estimation.aliases import resolve_aliases
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model import Model, Tracks
from hil.diagnosis.estimation.model_discrepancy import UNLISTED, corrected_gain, variance_inflation, with_uncertainty
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.estimation.uncertainty import standard_deviations
from hil.diagnosis.noise.model import Noise, SampleMasks, whiten
from hil.diagnosis.vehicle.priors import NuisanceKind
from plant.effects.effect import Effect

# --- what divides a gain in these logs


def nuisance_variance_inflation(fitter: Fitter, z: Floats, effective_parameters: float) -> float:
    """Divisor of a gain by how far the nuisance parameters ``z`` lie outside their tolerance (Birge ratio)."""
    return with_uncertainty(fitter.birge_ratio(z, effective_parameters))


def structure_mismatch(inflation: float) -> bool:
    """Whether the measured car has another structure than the model, by `nuisance_variance_inflation`."""
    return inflation > STRUCTURE_MISMATCH


def local_inflation(largest_other_gain: float, threshold: DetectionThreshold) -> float:
    """How much more than noise the largest other candidate gains given a cause, at least 1.

    Were the cause all there is, this would be what the largest of so many tests reaches by noise every second time. The
    inflation of the threshold, by the bulk of the candidates, applies anyway.
    """
    expected = chi2_quantile(threshold.number_of_tests, 0.5)
    return max(largest_other_gain / expected / threshold.inflation, 1.0)


class LocalDiscrepancy:
    """Divisors of the gains at one step of the selection; what other candidates gain is remembered by model."""

    def __init__(self, candidates: CandidateSet, effective_parameters: float) -> None:
        self._candidates, self._effective_parameters = candidates, effective_parameters
        self._known: dict[Model, float] = {}

    def factor(
        self, fitter: Fitter, one: FittedHypothesis, best: FittedHypothesis, threshold: DetectionThreshold
    ) -> float:
        """By the nuisance parameters of ``one``; where these say that the structure differs, at most what other
        candidates gain given the ``best``."""
        inflation = nuisance_variance_inflation(fitter, one.model.z, self._effective_parameters)
        if not structure_mismatch(inflation):
            return inflation
        if best.model not in self._known:
            others = self._candidates.scores_given(fitter, best.model, best.noise)
            largest = max((item.gain for item in others), default=0.0)
            self._known[best.model] = local_inflation(largest, threshold)
        return min(inflation, self._known[best.model])


# --- what the form of accepted causes leaves


@dataclass(frozen=True, eq=False)
class _Form:
    """What is known to a share of it alone: ``explained`` of chi-squared, energies of its signature
    (`signature_energies`), where it acts, and which share of its amplitude may be wrong there."""

    injection_points: frozenset[str]
    explained: float
    energies: Floats
    share: float

    def leaves(self, effect: Effect, energies: Callable[[], Floats]) -> float:
        """In chi-squared, for an effect with a signature of these ``energies``."""
        if self.injection_points.intersection(effect.injection_points):
            return self.share**2 * self.explained
        return FORM_ERROR**2 * self.explained * signature_overlap(self.energies, energies())


class FormErrorAllowance:
    """What the accepted causes of a model, and the curves that a reference shows, may leave for a further cause: a
    share of the chi-squared they explain.

    At their own injection points a share of all of it; a curve's is 1, for a change there that gains no more than the
    curve does is what the reference shows as strongly. Elsewhere as far as both act together: if their equations err by
    a share f in every channel of every segment, a signature with energies e there takes at most
    f^2 (sum sqrt(e P))^2 / sum e off chi-squared, P being the energies of the causes (Cauchy and Schwarz).
    """

    def __init__(self, explained: float, fitter: Fitter, model: Model, noise: Noise, jacobian: Tracks) -> None:
        self._jacobian, self._masks, self._noise = jacobian, fitter.masks, noise
        self._known: dict[str, float] = {}
        self._forms = _curves_of_the_reference(fitter, model, noise)
        if model.terms:
            points = frozenset(point for term in model.terms for point in term.candidate.effect.injection_points)
            values = np.array(model.values())
            own = {name: (of @ values)[:, None] for name, of in fitter.term_jacobian(model).items()}
            energies = signature_energies(own, self._masks, noise)
            self._forms.append(_Form(points, explained, energies, FORM_ERROR_SAME_POINT))

    def of(self, candidate: Candidate) -> float:
        """In chi-squared, for a candidate; remembered."""
        if candidate.name not in self._known:
            at = list(candidate.columns)
            own = {name: values[:, at].sum(axis=1, keepdims=True) for name, values in self._jacobian.items()}
            self._known[candidate.name] = self.of_signature(candidate.effect, own)
        return self._known[candidate.name]

    def of_signature(self, effect: Effect, signature: Tracks) -> float:
        """In chi-squared, for an effect with this signature, (samples, 1)."""
        energies = cache(lambda: signature_energies(signature, self._masks, self._noise))
        return sum(one.leaves(effect, energies) for one in self._forms)


def _curves_of_the_reference(fitter: Fitter, model: Model, noise: Noise) -> list[_Form]:
    """Nonparametric terms that a reference shows (`hil.diagnosis.detection.reference_fit`).

    Such a term stands for an equation that nobody has: in other manoeuvres it acts otherwise. What it explains, before
    and since, is what the other nuisance parameters do not.
    """
    curves = defaultdict(list)
    for k, nuisance in enumerate(fitter.nuisances):
        if nuisance.kind is NuisanceKind.LEARNED_CURVE and fitter.base.change is not None:
            curves[nuisance.name.removeprefix(f"{UNLISTED}.").split("(")[0]].append(k)
    if not curves:
        return []
    forms, columns = [], fitter.nuisance_jacobian_at(model)
    information = fitter.nuisance_information(noise)
    for point, own in curves.items():
        z = model.z[own]
        rest = [k for k in range(len(information)) if k not in own]
        cross = information[np.ix_(rest, own)] @ z
        others = information[np.ix_(rest, rest)] + np.eye(len(rest))
        explained = float(z @ information[np.ix_(own, own)] @ z - cross @ np.linalg.solve(others, cross))
        signature = {name: (values[:, own] @ z)[:, None] for name, values in columns.items()}
        energies = signature_energies(signature, fitter.masks, noise)
        forms.append(_Form(frozenset({point}), max(explained, 0.0), energies, 1.0))
    return forms


def signature_energies(signature: Tracks, masks: SampleMasks, noise: Noise) -> Floats:
    """Squares of a whitened signature, (samples, 1), summed by channel and segment."""
    whitened, _ = whiten({name: values.astype(np.float64) for name, values in signature.items()}, masks, noise)
    segments = np.asarray(masks.segment_id, np.int64)
    count = int(segments.max()) + 1
    return np.concatenate([np.bincount(segments, whitened[name][:, 0] ** 2, count) for name in masks.names])


def signature_overlap(one: Floats, other: Floats) -> float:
    """How far two signatures lie in the same channels and segments, by their energies there: 0 to 1."""
    together = float(np.sqrt(one * other).sum()) ** 2
    return together / max(float(one.sum() * other.sum()), 1e-300)


# --- tests of one hypothesis


def with_gain(hypothesis: FittedHypothesis, reference: float, discrepancy_factor: float) -> FittedHypothesis:
    """With its gain against the cost ``reference``: divided by both discrepancies, less its penalty."""
    gain = corrected(hypothesis, reference - hypothesis.cost)
    return replace(
        hypothesis, gain=gain / discrepancy_factor - hypothesis.total_penalty, discrepancy_factor=discrepancy_factor
    )


def is_significant(hypothesis: FittedHypothesis, least: float, fitter: Fitter, effective_parameters: float) -> bool:
    """Whether a cause gains ``least`` and is more probable than none.

    At its bound it explains more than it can be: in a car of another structure it stands for the structure.
    """
    inflation = nuisance_variance_inflation(fitter, hypothesis.model.z, effective_parameters)
    bounded = at_bound(hypothesis.term) and structure_mismatch(inflation)
    return hypothesis.gain >= least and log_bayes_factor(hypothesis) > 0.0 and not bounded


def is_significant_given(
    hypothesis: FittedHypothesis, better: FittedHypothesis, least: float, fitter: Fitter, effective_parameters: float,
    relinearise: bool,
) -> bool:  # fmt: skip
    """Whether a significant cause stays so when a better one, which is not significant, is let in as an error."""
    if criterion(hypothesis) - criterion(better) < INDISTINGUISHABLE:
        return True
    start = fitter.at(better.model.z, (*better.model.terms, hypothesis.term), better.noise)
    both = fitter.fit(start, better.noise, 2, relinearise)
    inflation = nuisance_variance_inflation(fitter, both.z, effective_parameters)
    gain = corrected(hypothesis, better.cost - both.cost)
    return gain >= least * _at_most_as_accepted(hypothesis, inflation)


def _at_most_as_accepted(hypothesis: FittedHypothesis, inflation: float) -> float:
    """Divisor of a gain where the structure differs: not more than when the hypothesis was accepted."""
    return min(inflation, hypothesis.discrepancy_factor) if structure_mismatch(inflation) else inflation


# --- backward elimination


@dataclass(frozen=True, eq=False)
class Elimination:
    """What is left: the model, the hypotheses for each of its terms, and a remark on each term taken out."""

    model: Model
    hypotheses: Sequence[list[FittedHypothesis]]
    remarks: tuple[str, ...] = ()


def eliminate_backward(
    fitter: Fitter, model: Model, noise: Noise, hypotheses: Sequence[list[FittedHypothesis]],
    threshold: DetectionThreshold, effective_parameters: float, progress: Progress,
) -> Elimination:  # fmt: skip
    """Take out each cause in turn, the last first; what is not missed, or may as well be zero, stays out."""
    left, needed = list(hypotheses), threshold.amplitude
    remarks: list[str] = []
    for k in reversed(range(len(model.terms))):
        term = model.terms[k]
        if isinstance(term.candidate, BasisFunction):
            continue
        discrepancy, lasting = variance_inflation(term.candidate), term.onset is None
        form_sd = term.candidate.form_sd if lasting else 0.0
        sd = float(standard_deviations(fitter, model, noise)[k]) * float(np.sqrt(discrepancy))
        distance = abs(term.value) / float(np.hypot(sd, form_sd))
        if distance >= needed and causes_in(model) == 1:
            return Elimination(model, tuple(left), tuple(remarks))
        rest = tuple(other for j, other in enumerate(model.terms) if j != k)
        without = fitter.fit(fitter.at(model.z, rest, noise), noise, 5)
        inflation = nuisance_variance_inflation(fitter, model.z, effective_parameters)
        least = threshold.gain * _at_most_as_accepted(left[k][0], inflation)
        gain = corrected_gain(term.candidate, without.cost - model.cost, term.value, lasting)
        if distance < needed or gain < least:
            why = f"{distance:.1f} standard deviations from zero, {needed:.1f} needed"
            why = "the other causes explain as much" if distance >= needed else why
            remarks.append(f"{term.candidate.name} = {term.value:.3g} is not named: {why}")
            progress(remarks[-1])
            model = without
            del left[k]
    if model.terms:
        model = resolve_aliases(model, fitter.nuisances, fitter.base)
    return Elimination(model, tuple(left), tuple(remarks))
