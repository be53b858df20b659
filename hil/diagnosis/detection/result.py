"""What a diagnosis may be told, and all that it found."""

from collections.abc import Callable
from dataclasses import dataclass, field

from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.detection.profile_fit import FittedHypothesis
from hil.diagnosis.detection.score_test import ScoreTest
from hil.diagnosis.estimation.gauss_newton import Fitter, Model
from hil.diagnosis.estimation.information import InformationBlocks
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.vehicle.spec import Vehicle

Progress = Callable[[str], None]
"""Told of the progress, a line each."""
FALSE_ALARM_PROBABILITY = 1e-3
"""Chance of a false alarm in one set of logs if the model's own error were normal. One in a hundred may be borne; the
rest is kept for tails heavier than that (decision 0077)."""
MOST_CAUSES = 3
INDISTINGUISHABLE = 9.2
"""Twice the log of the odds, 100 to 1, within which causes are not told apart."""


@dataclass(frozen=True)
class Settings:
    """What may be switched off, so that the tests can show that it matters."""

    noise_model: bool = True
    relinearise: bool = True
    dictionary: bool = True
    alpha: float = FALSE_ALARM_PROBABILITY
    most_causes: int = MOST_CAUSES


def causes_in(model: Model) -> int:
    """How many causes a model has; the pieces of a law in no list are one."""
    laws = {term.candidate.name.rsplit(".", 1)[0] for term in model.terms if isinstance(term.candidate, BasisFunction)}
    return sum(not isinstance(term.candidate, BasisFunction) for term in model.terms) + len(laws)


@dataclass(eq=False)
class Diagnosis:
    """Everything the diagnosis found.

    ``base`` explains with nuisances alone (``screened`` and ``sums`` are taken there). ``final`` explains with the
    accepted causes, which take ``explained`` off chi-squared; ``contenders`` has, for each term of ``final``, all that
    were fitted in its place, best first.
    """

    dataset: Dataset
    vehicle: Vehicle
    fitter: Fitter
    noise: Noise
    first_noise: Noise
    nominal: Model
    base: Model
    final: Model
    hypotheses: list[list[FittedHypothesis]] = field(default_factory=list)
    scores: list[ScoreTest] = field(default_factory=list)
    undetectable_effects: list[str] = field(default_factory=list)
    information: InformationBlocks | None = None
    number_of_tests: int = 0
    inflation: float = 1.0
    detection_threshold: float = 0.0
    explained: float = 0.0
    remarks: list[str] = field(default_factory=list)

    @property
    def selections(self) -> list[list[FittedHypothesis]]:
        """The contenders for each cause; the terms of a law in no list were accepted in one race."""
        return list({id(listed): listed for listed in self.hypotheses}.values())
