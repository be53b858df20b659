"""Goodness of fit: how far the final model is from every channel, beside its noise and what the channel does.

Takes a diagnosis; gives a `ChannelFit` for each channel, and where the model does not describe the car at all. A white
innovation with the size of the noise is a model that leaves nothing; a coloured one stands with where it is worst.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.noise.model import whiten
from hil.diagnosis.result.residual_patterns import UNITS, WORDS
from hil.diagnosis.result.statistics import root_mean_square, squares_by_segment

_LAGS = 20
"""Lags of the test of whiteness, in samples."""
_MOST_UNEXPLAINED = {"wheel.mean": 0.1, "gps": 0.1, "ax": 0.3}
"""Free-run error beyond which the model does not describe the car, as a share of what the channel does: the change of
the speed since the segment's start, the deceleration. Cars that it describes: 0.005 to 0.03 and 0.05 to 0.15."""
_LEAST_OVER_NOISE = 5.0
"""Times the noise of a sample that such an error is at least."""


@dataclass(frozen=True)
class ChannelFit:
    """One channel beside the final model.

    Attributes
    ----------
    noise : standard deviation of its white noise, in ``unit``, as the logs show it.
    error : root mean square of the free-run residual.  error_as_stated : the same of the vehicle as its set states it.
    unexplained : ``error`` over the root mean square of what the channel does: along the road, the change since the
        start of the segment, else its value.
    autocorrelation : of the innovations from sample to sample, 0 if the noise model describes what is left.
    whiteness_p : probability of so much autocorrelation by chance, over `_LAGS` samples (Ljung and Box 1978,
        Biometrika 65, 297).
    worst_log, worst_s, worst_error : the segment with the largest error: its log, from when to when, and the error.
    """

    track: str
    channel: str
    unit: str
    noise: float
    error: float
    error_as_stated: float
    unexplained: float
    autocorrelation: float
    whiteness_p: float
    worst_log: str
    worst_s: tuple[float, float]
    worst_error: float

    def as_json(self) -> dict[str, Any]:
        """As printed."""
        return {
            "channel": self.channel, "unit": self.unit, "noise": self.noise, "error": self.error,
            "error_as_stated": self.error_as_stated, "unexplained": self.unexplained,
            "autocorrelation": self.autocorrelation, "whiteness_p": self.whiteness_p,
            "worst_log": self.worst_log, "worst_from_s": self.worst_s[0], "worst_to_s": self.worst_s[1],
            "worst_error": self.worst_error, "described": self.described,
        }  # fmt: skip

    @property
    def described(self) -> bool:
        """Whether the model describes the channel, as stated or as fitted.

        A fit weighs innovations: what drifts slowly in free run may be farther off than it was.
        """
        limit, least = _MOST_UNEXPLAINED.get(self.track, np.inf), min(self.error, self.error_as_stated)
        unexplained = self.unexplained * least / self.error if self.error else 0.0
        return unexplained <= limit or least <= _LEAST_OVER_NOISE * self.noise


def goodness_of_fit(diagnosis: Diagnosis) -> list[ChannelFit]:
    """Of every compared channel."""
    fitter, model, noise = diagnosis.fitter, diagnosis.final, diagnosis.noise
    masks, measured = fitter.masks, fitter.tracks(fitter.simulator.measured())
    innovations, _ = whiten(model.residual, masks, noise)
    places = _segment_places(diagnosis)
    fits = []
    for name in masks.names:
        known, residual = (masks.present[name] > 0.5) & diagnosis.compared_samples, model.residual[name][:, 0]
        squares = squares_by_segment(residual, known, masks.segment_id)
        by_segment = np.sqrt(squares[:, 0] / np.maximum(squares[:, 1], 1.0))
        worst = int(np.argmax(np.where(squares[:, 1] > 0.0, by_segment, 0.0)))
        does = measured[name][:, 0] - (_at_segment_start(measured[name][:, 0], known, masks.segment_id))
        if name not in ("wheel.mean", "gps"):
            does = measured[name][:, 0]
        stated = squares_by_segment(diagnosis.nominal.residual[name][:, 0], known, masks.segment_id)
        error, size = root_mean_square(squares), float(np.sqrt(np.mean(does[known] ** 2)))
        rho, p = whiteness(innovations[name][known, 0])
        log, since_s, until_s = places[worst]
        fits.append(
            ChannelFit(
                name, WORDS[name], UNITS[name.split(".")[0]], noise.tracks[name].a, error,
                root_mean_square(stated), error / max(size, 1e-12), rho, p, log, (since_s, until_s),
                float(by_segment[worst]),
            )
        )  # fmt: skip
    return fits


def whiteness(innovations: Floats) -> tuple[float, float]:
    """Autocorrelation (samples,) from sample to sample, and the p-value of the test of Ljung and Box.

    Few samples, and such as are all the same, say nothing.
    """
    count = len(innovations)
    if count <= 2 * _LAGS or np.ptp(innovations) == 0.0:
        return 0.0, 1.0
    centred = innovations - innovations.mean()
    power = float(centred @ centred)
    rho = np.array([float(centred[lag:] @ centred[:-lag]) / power for lag in range(1, _LAGS + 1)])
    statistic = count * (count + 2.0) * float(np.sum(rho**2 / (count - np.arange(1, _LAGS + 1))))
    return float(rho[0]), float(chi2.sf(statistic, _LAGS))


def _at_segment_start(values: Floats, known: Floats, segment_id: Floats) -> Floats:
    """The first known value of each sample's segment, (samples,)."""
    segments = np.asarray(segment_id, np.int64)
    first = np.zeros(int(segments.max()) + 1)
    at = np.flatnonzero(known)[::-1]
    first[segments[at]] = values[at]
    return np.asarray(first[segments])


def _segment_places(diagnosis: Diagnosis) -> list[tuple[str, float, float]]:
    """Log, start and end (s in it) of each segment."""
    places = []
    for number, segment in diagnosis.dataset.segments:
        recording = diagnosis.dataset.recordings[number]
        start_s = float(recording.log.t_s[0])
        places.append((recording.log.name, start_s + 0.01 * segment.first, start_s + 0.01 * segment.last))
    return places
