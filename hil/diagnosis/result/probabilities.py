"""Posterior probabilities of the effects that compete in one step of the selection: together 1 at most.

A hypothesis that was fitted weighs by its criterion. A rival that was not fitted, but imitates the cause
(`hil.diagnosis.isolation.groups`), weighs as much of the cause's weight as its likelihood ratio says: exp(-d'^2 / 2)
for d' standard deviations left between them. Rivals that imitate together are one hypothesis and share its weight.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from hil.diagnosis.detection.profile_fit import FittedHypothesis
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.isolation.groups import IsolabilityGroup
from hil.diagnosis.result.cross_validation import probabilities


def by_effect(hypotheses: Sequence[FittedHypothesis]) -> dict[str, float]:
    """Probability of each effect among the fitted hypotheses of one step, all locations and parameters together."""
    shares: dict[str, float] = {}
    for one, share in zip(hypotheses, probabilities(hypotheses), strict=True):
        name = one.term.candidate.effect.name
        shares[name] = shares.get(name, 0.0) + share
    return shares


def with_imitations(
    fitted: Mapping[str, float], cause: str, group: IsolabilityGroup, candidates: Sequence[Candidate]
) -> dict[str, float]:
    """Probability of each effect of the step in which ``cause`` was accepted, its isolability group included."""
    ratios: dict[str, float] = {}
    alone = dict(group.pairs)
    for index in group.indices:
        shared = _ratio(group.separation) / len(group.members) if index in group.members else 0.0
        ratio = max(shared, _ratio(alone[index]) if index in alone else 0.0)
        name = candidates[index].effect.name
        ratios[name] = max(ratios.get(name, 0.0), ratio)
    weights = dict(fitted)
    for name, ratio in ratios.items():
        weights[name] = max(weights.get(name, 0.0), ratio * fitted.get(cause, 1.0))
    total = sum(weights.values())
    return {name: weight / total for name, weight in weights.items()}


def _ratio(separation: float) -> float:
    return float(np.exp(-0.5 * separation**2))
