"""What is known of a cause's value: noise, what the model errs in its own way, the form of the cause's equation."""

import numpy as np

from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.significance import standard_deviations
from hil.diagnosis.detection.threshold import DEVIATION_BY_FORM
from hil.diagnosis.estimation.aliases import alias_of
from hil.diagnosis.estimation.model_discrepancy import variance_inflation
from hil.diagnosis.estimation.terms import Candidate

_TWO_SIDED_95 = 1.96


def half_width(candidate: Candidate, value: float, deviation: float) -> float:
    """Half of a 95 % interval, of a value whose standard deviation by noise is ``deviation``."""
    return _TWO_SIDED_95 * float(
        np.sqrt(variance_inflation(candidate) * deviation**2 + (DEVIATION_BY_FORM * value) ** 2)
    )


def intervals(found: Diagnosis) -> list[tuple[float, float]]:
    """95 % interval of each cause's value, within what the value may be.

    What is a number of the vehicle is known no better than that number.
    """
    model, fitter = found.final, found.fitter
    if not model.terms:
        return []
    world, nuisances = fitter.base.with_nuisances(fitter.nuisances, model.z), fitter.nuisances
    bounds = []
    for term, deviation in zip(model.terms, standard_deviations(fitter, model, found.noise), strict=True):
        half = half_width(term.candidate, term.value, float(deviation))
        same = alias_of(term, nuisances, world)
        if same is not None:
            half = max(half, _TWO_SIDED_95 * same.deviation(nuisances))
        parameter = term.candidate.parameter
        low, high = np.clip((term.value - half, term.value + half), parameter.low, parameter.high)
        bounds.append((float(low), float(high)))
    return bounds
