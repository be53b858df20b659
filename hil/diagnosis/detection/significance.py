"""What is beyond doubt: a gain beyond noise and the model's own error, and a value that is away from nothing."""

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.nonparametric import Piece
from hil.diagnosis.detection.profile_fit import Contender, at_its_end, odds, worth
from hil.diagnosis.detection.result import TIED, Diagnosis, Say, causes_in
from hil.diagnosis.detection.score_test import threshold
from hil.diagnosis.estimation.aliases import restated
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model_discrepancy import shared_out, variance_of
from hil.diagnosis.isolation.intervals import deviations

_FORM_DIFFERS = 4.0
"""Strain beyond which the car of the logs is of another form than the model's, as one of a page is: numbers that nobody
stated went far. Drives of the independent car: 0.6 to 1.3 (docs/decisions/0073)."""
_SURE = 0.05
"""Chance that noise takes any of all values so far from nothing as is asked of one, in its own deviations, which know
how far manoeuvres disagree: a second question beside what a cause explains (decision 0078)."""


def strained(fitter: Fitter, z: Floats, told: float) -> float:
    """What a gain is divided by where the vehicle's numbers ``z``, of which the data tell ``told``, lie far off."""
    return shared_out(fitter.strain(z, told))


def form_differs(strain: float) -> bool:
    """Whether the car of the logs is another than the model's, by what its numbers are ``strained``."""
    return strain > _FORM_DIFFERS


def erring(most_left: float, found: Diagnosis) -> float:
    """How much more than noise a model explains falsely, by the ``most_left`` for any other cause beside one.

    Were that one all there is, this would be what the largest of so many looks at noise reaches every second time. The
    inflation by the bulk is asked for anyway.
    """
    return max(most_left / float(chi2.isf(0.5 / found.looks, 1)) / found.inflation, 1.0)


def with_gain(contender: Contender, reference: float, error: float) -> Contender:
    """With its gain against ``reference``, shared out over the model's own error and that here, less its price."""
    gained = (reference - contender.cost) / variance_of(contender.term.candidate)
    return replace(contender, gained=gained / error - contender.paid, error=error)


def beyond_doubt(contender: Contender, least: float, fitter: Fitter, told: float) -> bool:
    """Whether a cause gains the ``least`` that is asked and is likelier than none.

    As far off as it may be it explains more than it can be: in a car of another form that is the form.
    """
    ended = at_its_end(contender.term) and form_differs(strained(fitter, contender.model.z, told))
    return contender.gained >= least and worth(contender) > 0.0 and not ended


def stands_beside(
    clear: Contender, better: Contender, least: float, fitter: Fitter, told: float, relinearise: bool
) -> bool:
    """Whether a cause that is beyond doubt is so even when a better one, which is not, is let in as an error."""
    if odds(clear) - odds(better) < TIED:
        return True
    joint = fitter.at(better.model.z, (*better.model.terms, clear.term), better.noise)
    both = fitter.fit(joint, better.noise, 2, relinearise)
    return (better.cost - both.cost) / variance_of(clear.term.candidate) >= least * _no_more(
        clear, strained(fitter, both.z, told)
    )


def _no_more(contender: Contender, strain: float) -> float:
    """What a gain is divided by where numbers are strained: no more than when the contender was accepted."""
    return min(strain, contender.error) if form_differs(strain) else strain


def backward(found: Diagnosis, bare: Fitter, told: float, say: Say) -> None:
    """Take out each cause in turn; what is not missed, or may as well be nothing, stays out.

    ``bare`` is the fitter of the model without any.
    """
    fitter, asked = found.fitter, float(np.sqrt(threshold(found.looks, _SURE)))
    for k in reversed(range(len(found.final.terms))):
        model, term = found.final, found.final.terms[k]
        if isinstance(term.candidate, Piece):
            continue
        error = variance_of(term.candidate)
        away = abs(term.value) / (float(deviations(found)[k]) * float(np.sqrt(error)))
        sure = away >= asked
        if sure and causes_in(model) == 1:
            return
        rest = tuple(other for j, other in enumerate(model.terms) if j != k)
        without = fitter.fit(fitter.at(model.z, rest, found.noise), found.noise, 5)
        asked_of_gain = found.least_gain * error * _no_more(found.contenders[k][0], strained(fitter, model.z, told))
        if not sure or without.cost - model.cost < asked_of_gain:
            why = "not needed beside the others" if sure else f"{away:.1f} deviations from nothing, asked {asked:.1f}"
            found.remarks.append(f"{term.candidate.name} = {term.value:.3g} is not told: {why}")
            say(found.remarks[-1])
            found.final = without
            del found.contenders[k]
    if found.final.terms:
        found.final = restated(found.final, fitter.nuisances, fitter.base)
        return
    found.final, found.noise, found.fitter = found.base, found.first_noise, bare
    bare.rig.quieten(bare.world(found.base.z, found.base.terms))
