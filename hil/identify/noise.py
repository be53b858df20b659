"""What is left after a fit: its size, its colour, and how much less it tells than as many independent samples."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import chi2

Floats = NDArray[np.float64]
_LAGS = 20
_DECAY = 5
_LONGEST = 0.9995


@dataclass(frozen=True)
class Noise:
    """Residual of one channel.

    Attributes
    ----------
    rms : size, in the channel's unit.
    floor : noise of the sensor alone, from third differences (what no smooth model can explain), same unit.
    colour : share of the noise that is coloured, 0 where white noise explains the residual as well.
    memory : correlation of the coloured share from one sample to the next (first order).
    whiteness_p : chance that white noise looks less white than this (Ljung-Box, 20 lags).
    """

    rms: float
    floor: float
    colour: float
    memory: float
    whiteness_p: float

    @property
    def white(self) -> bool:
        """Whether no colour was found at the 1 % level."""
        return self.whiteness_p >= 0.01

    def independent(self, samples: int) -> float:
        """How many independent samples say as much about a slow quantity: n over the summed correlation."""
        inflation = 1.0 - self.colour + self.colour * (1.0 + self.memory) / (1.0 - self.memory)
        return samples / inflation


def measure_noise(residual: Floats, measured: Floats) -> Noise:
    """Size and colour of ``residual`` (n,); ``measured`` (n,) is the channel it is from."""
    n = residual.size
    spread = residual - residual.mean()
    power = float(spread @ spread)
    if power == 0.0:
        return Noise(0.0, difference_noise(measured), 0.0, 0.0, 1.0)
    lags = np.array([float(spread[k:] @ spread[:-k]) / power for k in range(1, _LAGS + 1)])
    q = n * (n + 2) * float(np.sum(lags**2 / (n - np.arange(1, _LAGS + 1))))
    colour, memory = _colour(lags, n)
    return Noise(
        rms=float(np.sqrt(np.mean(residual**2))),
        floor=difference_noise(measured),
        colour=colour,
        memory=memory,
        whiteness_p=float(chi2.sf(q, _LAGS)),
    )


def _colour(lags: Floats, samples: int) -> tuple[float, float]:
    """Coloured share A and memory rho of a correlation A rho^k, from how the first lags (1, 2, ...) decay."""
    if lags[0] < 2.0 / np.sqrt(samples):
        return 0.0, 0.0
    decay = float(np.sum(lags[1 : _DECAY + 1]) / np.sum(lags[:_DECAY]))
    memory = min(max(decay, float(lags[0])), _LONGEST)
    return min(float(lags[0]) / memory, 1.0), memory


def difference_noise(signal: Floats) -> float:
    """Standard deviation of the white part of a smooth signal, from third differences (their weights 1 3 3 1)."""
    return float(np.sqrt(np.mean(np.diff(signal, 3) ** 2) / 20.0))


def coloured(sensitivity: Floats, noise: Noise) -> Floats:
    """R J for the noise's correlation matrix, R_ij = A rho^|i-j| beside a diagonal of ones, without building R.

    Parameters
    ----------
    sensitivity : J, (n, k).
    """
    if noise.colour == 0.0:
        return sensitivity
    ahead = lfilter([1.0], [1.0, -noise.memory], sensitivity, axis=0)
    back = lfilter([1.0], [1.0, -noise.memory], sensitivity[::-1], axis=0)[::-1]
    return np.asarray((1.0 - 2.0 * noise.colour) * sensitivity + noise.colour * (ahead + back))
