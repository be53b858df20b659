"""The interface of a sensor model: parameters of sensors and car, noise parameters, and a log-likelihood."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from hil.diagnosis.data.log import Floats


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model.

    Attributes
    ----------
    typical : value where nothing is wrong, mostly 0; of a noise parameter, its typical size.
    low, high : bounds.
    step : change that matters; the optimiser works in multiples of it.
    log : the parameter is positive and searched in its logarithm.
    prior : standard deviation before data, of that logarithm or of the value about ``typical``; 0 for a flat prior.
    """

    typical: float
    low: float
    high: float
    step: float
    log: bool = False
    prior: float = 0.0


class SensorModel(ABC):
    """A model that can be fitted to the cells of a `Motion`.

    Attributes
    ----------
    noise, parameters : name -> what is known before data.
    resolution : parameter -> half the width of its cells, where the likelihood has an edge at every cell.
    """

    noise: Mapping[str, Parameter]
    parameters: Mapping[str, Parameter]
    resolution: Mapping[str, float] = MappingProxyType({})

    @abstractmethod
    def log_likelihood(self, parameters: Mapping[str, float], noise: Mapping[str, float]) -> Floats:
        """(cells,) log-likelihood of every cell; parameters that are not given are 0."""
