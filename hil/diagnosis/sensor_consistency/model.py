"""A model that can be fitted: named numbers of sensors and car, named sizes of noise, and a likelihood."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from hil.diagnosis.data.log import Floats


@dataclass(frozen=True)
class Parameter:
    """One number of the model: usual value, where it may lie, and the step on which it changes something.

    ``log`` numbers are positive and searched in their logarithm; ``prior`` is the standard deviation of that logarithm,
    or of the number itself about its usual value, 0 where nothing is known.
    """

    usual: float
    low: float
    high: float
    step: float
    log: bool = False
    prior: float = 0.0


class SensorModel(ABC):
    """What can be fitted: ``numbers`` are as usual, mostly 0, where nothing is wrong.

    ``resolution`` is what the cells leave of some.
    """

    noise: Mapping[str, Parameter]
    parameters: Mapping[str, Parameter]
    resolution: Mapping[str, float] = MappingProxyType({})

    @abstractmethod
    def score(self, sensor: Mapping[str, float], noise: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Innovations (cells, channels) and log-likelihood of every cell."""
