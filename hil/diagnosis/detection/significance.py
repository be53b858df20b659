"""What is beyond doubt: a gain beyond noise and the model's own error, and a value that is away from nothing."""

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.detection.profile_fit import FittedHypothesis, at_bound, criterion, log_bayes_factor
from hil.diagnosis.detection.result import INDISTINGUISHABLE, Diagnosis, Progress, causes_in
from hil.diagnosis.detection.score_test import detection_threshold
from hil.diagnosis.estimation.aliases import resolve_aliases
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model_discrepancy import variance_inflation, with_uncertainty
from hil.diagnosis.isolation.intervals import standard_deviations

_FORM_DIFFERS = 4.0
"""Strain beyond which the car of the logs is of another form than the model's, as one of a page is: numbers that nobody
stated went far. Drives of the independent car: 0.6 to 1.3 (docs/decisions/0073)."""
AMPLITUDE_ALPHA = 0.05
"""Chance that noise takes any of all values so far from nothing as is asked of one, in its own deviations, which know
how far manoeuvres disagree: a second question beside what a cause explains (decision 0078)."""


def nuisance_variance_inflation(fitter: Fitter, z: Floats, told: float) -> float:
    """What a gain is divided by where the vehicle's numbers ``z``, of which the data tell ``told``, lie far off."""
    return with_uncertainty(fitter.birge_ratio(z, told))


def structure_mismatch(strain: float) -> bool:
    """Whether the car of the logs is another than the model's, by what its numbers are ``nuisance_variance_inflation``."""
    return strain > _FORM_DIFFERS


def local_inflation(most_left: float, found: Diagnosis) -> float:
    """How much more than noise a model explains falsely, by the ``most_left`` for any other cause beside one.

    Were that one all there is, this would be what the largest of so many looks at noise reaches every second time. The
    inflation by the bulk is asked for anyway.
    """
    return max(most_left / float(chi2.isf(0.5 / found.number_of_tests, 1)) / found.inflation, 1.0)


def with_gain(contender: FittedHypothesis, reference: float, error: float) -> FittedHypothesis:
    """With its gain against ``reference``, shared out over the model's own error and that here, less its price."""
    gained = (reference - contender.cost) / variance_inflation(contender.term.candidate)
    return replace(contender, gain=gained / error - contender.total_penalty, discrepancy_factor=error)


def is_significant(contender: FittedHypothesis, least: float, fitter: Fitter, told: float) -> bool:
    """Whether a cause gains the ``least`` that is asked and is likelier than none.

    As far off as it may be it explains more than it can be: in a car of another form that is the form.
    """
    ended = at_bound(contender.term) and structure_mismatch(
        nuisance_variance_inflation(fitter, contender.model.z, told)
    )
    return contender.gain >= least and log_bayes_factor(contender) > 0.0 and not ended


def is_significant_given(
    clear: FittedHypothesis, better: FittedHypothesis, least: float, fitter: Fitter, told: float, relinearise: bool
) -> bool:
    """Whether a cause that is beyond doubt is so even when a better one, which is not, is let in as an error."""
    if criterion(clear) - criterion(better) < INDISTINGUISHABLE:
        return True
    joint = fitter.at(better.model.z, (*better.model.terms, clear.term), better.noise)
    both = fitter.fit(joint, better.noise, 2, relinearise)
    return (better.cost - both.cost) / variance_inflation(clear.term.candidate) >= least * _no_more(
        clear, nuisance_variance_inflation(fitter, both.z, told)
    )


def _no_more(contender: FittedHypothesis, strain: float) -> float:
    """What a gain is divided by where numbers are strained: no more than when the contender was accepted."""
    return min(strain, contender.discrepancy_factor) if structure_mismatch(strain) else strain


def eliminate_backward(found: Diagnosis, bare: Fitter, told: float, say: Progress) -> None:
    """Take out each cause in turn; what is not missed, or may as well be nothing, stays out.

    ``bare`` is the fitter of the model without any.
    """
    fitter, asked = found.fitter, float(np.sqrt(detection_threshold(found.number_of_tests, AMPLITUDE_ALPHA)))
    for k in reversed(range(len(found.final.terms))):
        model, term = found.final, found.final.terms[k]
        if isinstance(term.candidate, BasisFunction):
            continue
        error = variance_inflation(term.candidate)
        away = abs(term.value) / (float(standard_deviations(found)[k]) * float(np.sqrt(error)))
        sure = away >= asked
        if sure and causes_in(model) == 1:
            return
        rest = tuple(other for j, other in enumerate(model.terms) if j != k)
        without = fitter.fit(fitter.at(model.z, rest, found.noise), found.noise, 5)
        asked_of_gain = (
            found.detection_threshold
            * error
            * _no_more(found.hypotheses[k][0], nuisance_variance_inflation(fitter, model.z, told))
        )
        if not sure or without.cost - model.cost < asked_of_gain:
            why = "not needed beside the others" if sure else f"{away:.1f} deviations from nothing, asked {asked:.1f}"
            found.remarks.append(f"{term.candidate.name} = {term.value:.3g} is not told: {why}")
            say(found.remarks[-1])
            found.final = without
            del found.hypotheses[k]
    if found.final.terms:
        found.final = resolve_aliases(found.final, fitter.nuisances, fitter.base)
        return
    found.final, found.noise, found.fitter = found.base, found.first_noise, bare.denoised(found.base)
