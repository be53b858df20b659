"""What is asked of a cause in these logs: by how many looks noise had, how much most absent candidates seem to explain,
and what a model whose numbers lie far off gets wrong."""

from collections.abc import Callable, Sequence

import numpy as np

from hil.diagnosis.detection.candidates import Field
from hil.diagnosis.detection.profile_fit import Contender, odds
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.score_test import Score, beside_best, inflation, threshold
from hil.diagnosis.detection.significance import erring, form_differs, strained
from hil.diagnosis.estimation.gauss_newton import Fitter, Model
from hil.diagnosis.estimation.information import Sums

_INFLATED = 1.5
"""How much more than noise lets them candidates explain beside the best by one step, beyond which it is looked at again
beside the best as fitted."""


class Asked:
    """Of the causes of a diagnosis, at the level ``alpha``; it notes looks, inflation and least gain there.

    What is to come shows through others, too: of all inflations, as seen beside more and more causes, the least counts.
    """

    def __init__(self, found: Diagnosis, field: Field, alpha: float) -> None:
        self._found, self._field, self._alpha = found, field, alpha
        found.looks, found.inflation = _independent(found.screened), np.inf

    def beside(self, fitter: Fitter, listed: list[Score], sums: Sums, model: Model) -> None:
        """Look at what all seem to explain beside the causes of a model and the best one more, by one step."""
        held = fitter.at_their_end(model.z)
        self._seen(inflation(beside_best(listed, sums, model.z, held, len(model.terms))))

    def beside_fitted(self, fitter: Fitter, fitted: list[Contender]) -> None:
        """Where much is asked, look beside the best as fitted, which lets numbers go back that it had bent."""
        if self._found.inflation > _INFLATED:
            best = min(fitted, key=odds)
            self._seen(inflation(self._field.beside(fitter, best.model, best.noise)))

    def _seen(self, seen: float) -> None:
        found = self._found
        found.inflation = min(found.inflation, seen)
        found.least_gain = threshold(found.looks, self._alpha) * found.inflation


def errors(fitter: Fitter, field: Field, told: float, found: Diagnosis) -> Callable[[Contender, Contender], float]:
    """What the gain of a contender is divided by for what the model gets wrong here, seen beside the best one."""
    known: dict[Model, float] = {}

    def error(one: Contender, best: Contender) -> float:
        strain = strained(fitter, one.model.z, told)
        if not form_differs(strain):
            return strain
        if best.model not in known:
            others = field.beside(fitter, best.model, best.noise)
            known[best.model] = erring(max((item.gain for item in others), default=0.0), found)
        return min(strain, known[best.model])

    return error


def _independent(found: Sequence[Score]) -> int:
    """How many looks: candidates that can show at all, places of one effect counted as one and a half."""
    names = {(s.candidate.effect.name, s.candidate.parameter.name) for s in found if s.reach > 1.0}
    return max(1, round(1.5 * len(names)))
