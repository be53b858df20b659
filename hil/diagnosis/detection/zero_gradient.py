"""Causes behind a limit: a little of them does nothing, which no sensitivity shows; they are replayed at full size."""

from dataclasses import replace

from hil.diagnosis.detection.score_test import ScoreTest, replayed_score
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Term
from hil.diagnosis.noise.model import Noise

_SILENT = 0.1
_ROUNDS, _GOLDEN = 8, 0.618


def has_zero_gradient(item: ScoreTest) -> bool:
    """Whether a small step of the candidate changes nothing."""
    return item.max_snr < _SILENT and item.candidate.parameter.typical != 0.0


def line_search(fitter: Fitter, model: Model, noise: Noise, item: ScoreTest) -> ScoreTest:
    """A silent candidate at the size that explains most; its value is 0 where none explains anything.

    The cost is flat up to the limit, falls and rises again: golden section (Kiefer 1953), farther off where two sizes
    do as much. What its largest and its usual size change in the cost, for better or worse, is how far they
    stand out.
    """
    parameter = item.candidate.parameter
    known = fitter.cost(model.residual, model.z, noise)

    def change(size: float) -> float:
        return fitter.at(model.z, (*model.terms, Term(item.candidate, size)), noise).cost - known

    near, far = 0.0, parameter.high if parameter.typical > 0.0 else parameter.low
    if not (most := change(far)):
        return item
    tried = {far: most}
    inner, outer = far - _GOLDEN * far, _GOLDEN * far
    for _ in range(_ROUNDS):
        for size in (inner, outer):
            if size not in tried:
                tried[size] = change(size)
        if tried[outer] <= tried[inner]:
            near, inner, outer = inner, outer, inner + _GOLDEN * (far - inner)
        else:
            far, inner, outer = outer, outer - _GOLDEN * (outer - near), inner
    item = replace(item, max_snr=abs(most) ** 0.5, typical_snr=abs(change(parameter.typical)) ** 0.5)
    best = min(tried, key=lambda size: tried[size])
    return replayed_score(item, best, -tried[best]) if tried[best] < 0.0 else item
