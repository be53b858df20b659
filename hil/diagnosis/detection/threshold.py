"""What is asked of a cause in these logs: by how many looks noise had, how much most absent candidates seem to explain,
and what a model whose numbers lie far off gets wrong."""

from collections.abc import Callable, Sequence

import numpy as np

from hil.diagnosis.detection.candidates import CandidateSet
from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.score_test import ScoreTest, detection_threshold, inflation_factor, scores_given_best
from hil.diagnosis.detection.significance import local_inflation, nuisance_variance_inflation, structure_mismatch
from hil.diagnosis.estimation.gauss_newton import Fitter, Model
from hil.diagnosis.estimation.information import InformationBlocks

_INFLATED = 1.5
"""How much more than noise lets them candidates explain beside the best by one step, beyond which it is looked at again
beside the best as fitted."""


class DetectionThreshold:
    """Of the causes of a diagnosis, at the level ``alpha``; it notes looks, inflation and least gain there.

    What is to come shows through others, too: of all inflations, as seen beside more and more causes, the least counts.
    """

    def __init__(self, found: Diagnosis, field: CandidateSet, alpha: float) -> None:
        self._found, self._field, self._alpha = found, field, alpha
        found.number_of_tests, found.inflation = effective_number_of_tests(found.scores), np.inf

    def update_inflation(self, fitter: Fitter, listed: list[ScoreTest], sums: InformationBlocks, model: Model) -> None:
        """Look at what all seem to explain beside the causes of a model and the best one more, by one step."""
        held = fitter.at_bounds(model.z)
        self._seen(inflation_factor(scores_given_best(listed, sums, model.z, held, len(model.terms))))

    def update_inflation_at_fit(self, fitter: Fitter, fitted: list[FittedHypothesis]) -> None:
        """Where much is asked, look beside the best as fitted, which lets numbers go back that it had bent."""
        if self._found.inflation > _INFLATED:
            best = min(fitted, key=criterion)
            self._seen(inflation_factor(self._field.scores_given(fitter, best.model, best.noise)))

    def _seen(self, seen: float) -> None:
        found = self._found
        found.inflation = min(found.inflation, seen)
        found.detection_threshold = detection_threshold(found.number_of_tests, self._alpha) * found.inflation


def local_discrepancy_factors(
    field: CandidateSet, told: float, found: Diagnosis
) -> Callable[[Fitter, FittedHypothesis, FittedHypothesis], float]:
    """What the gain of a contender is divided by for what the model gets wrong here, seen beside the best one."""
    known: dict[Model, float] = {}

    def error(fitter: Fitter, one: FittedHypothesis, best: FittedHypothesis) -> float:
        strain = nuisance_variance_inflation(fitter, one.model.z, told)
        if not structure_mismatch(strain):
            return strain
        if best.model not in known:
            others = field.scores_given(fitter, best.model, best.noise)
            known[best.model] = local_inflation(max((item.gain for item in others), default=0.0), found)
        return min(strain, known[best.model])

    return error


def effective_number_of_tests(found: Sequence[ScoreTest]) -> int:
    """How many looks: candidates that can show at all, places of one effect counted as one and a half."""
    names = {(s.candidate.effect.name, s.candidate.parameter.name) for s in found if s.max_snr > 1.0}
    return max(1, round(1.5 * len(names)))
