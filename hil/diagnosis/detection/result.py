"""Settings of a diagnosis, and its result."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.data.masks import Mask
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.detection.profile_fit import FittedHypothesis
from hil.diagnosis.detection.score_test import ScoreTest
from hil.diagnosis.detection.threshold import FALSE_ALARM_PROBABILITY, MAX_CAUSES
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import InformationBlocks
from hil.diagnosis.estimation.model import Model
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.progress import Progress as Progress
from hil.diagnosis.vehicle.spec import Vehicle


@dataclass(frozen=True)
class Settings:
    """What may be switched off, so that tests can show that it matters.

    Attributes
    ----------
    noise_model : estimate slow noise, offsets and latency jitter; else white noise as first guessed.
    relinearise : renew Jacobians and refit from the nominal vehicle.
    dictionary : test nonparametric terms.
    alpha : false-alarm probability of one set of logs.  most_causes : at most accepted.
    """

    noise_model: bool = True
    relinearise: bool = True
    dictionary: bool = True
    alpha: float = FALSE_ALARM_PROBABILITY
    most_causes: int = MAX_CAUSES


def causes_in(model: Model) -> int:
    """Number of causes of a model; the basis functions of a nonparametric term are one."""
    nonparametric = {
        term.candidate.name.rsplit(".", 1)[0] for term in model.terms if isinstance(term.candidate, BasisFunction)
    }
    return sum(not isinstance(term.candidate, BasisFunction) for term in model.terms) + len(nonparametric)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Result of the selection.

    Attributes
    ----------
    nominal : model of the nominal vehicle.  base : nuisance parameters alone, with ``first_noise``.
    final : with the accepted causes, fitted by ``fitter`` with ``noise``.
    hypotheses : for each term of ``final`` all that were fitted in its place, best first.
    scores, information : score tests at ``base``, and the information blocks they are from.
    undetectable_effects : names of effects that these manoeuvres or this vehicle set cannot show.
    detection_threshold : gain in chi-squared that a cause needed.
    reference : recordings, the first ones, that the others are compared with; 0 where the vehicle set is all there is.
    """

    dataset: Dataset
    vehicle: Vehicle
    fitter: Fitter
    noise: Noise
    first_noise: Noise
    nominal: Model
    base: Model
    final: Model
    hypotheses: Sequence[list[FittedHypothesis]]
    scores: list[ScoreTest]
    undetectable_effects: list[str]
    information: InformationBlocks
    detection_threshold: float
    remarks: tuple[str, ...]
    reference: int = 0

    @property
    def reference_segments(self) -> int:
        """How many segments, the first ones, are of the reference."""
        return sum(recording < self.reference for recording, _ in self.dataset.segments)

    @property
    def compared_samples(self) -> Mask:
        """(samples,) true where a sample is not of the reference."""
        return np.asarray(self.fitter.masks.segment_id) >= self.reference_segments

    @property
    def selections(self) -> list[list[FittedHypothesis]]:
        """The hypotheses of each step; the basis functions of a nonparametric term were accepted in one."""
        return selections(self.hypotheses)


def selections(hypotheses: Sequence[list[FittedHypothesis]]) -> list[list[FittedHypothesis]]:
    """Lists of hypotheses by term as lists by step."""
    return list({id(listed): listed for listed in hypotheses}.values())
