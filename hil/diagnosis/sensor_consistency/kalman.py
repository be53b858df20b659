"""One Kalman filter for every linear model here: innovations and log-likelihood, robust against single bad samples."""

from dataclasses import dataclass

import numpy as np

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.log import Floats

_CLIP = 4.0


@dataclass(frozen=True, eq=False)
class Linear:
    """x' = F x + w, cov w = Q;  y = H x + e, var e = ``white``.

    Attributes
    ----------
    transition, noise, start : (n, n) F, Q and the covariance at the start of a log.
    observe : (m, n) or (samples, m, n) H.
    white : (m,) variance of each channel's own noise.
    """

    transition: Floats
    noise: Floats
    start: Floats
    observe: Floats
    white: Floats


def _filter(
    y: Floats, known: Floats, fresh: Floats, transition: Floats, noise: Floats, start: Floats, observe: Floats,
    white: Floats, clip: float, innovation: Floats, score: Floats,
) -> None:  # fmt: skip
    samples, channels = y.shape
    n = transition.shape[0]
    x, moved = np.zeros(n), np.zeros(n)
    cov, half = np.zeros((n, n)), np.zeros((n, n))
    h = np.zeros(n)
    for t in range(samples):
        if fresh[t] > 0.5:
            for i in range(n):
                x[i] = 0.0
                for j in range(n):
                    cov[i, j] = start[i, j]
        else:
            for i in range(n):
                moved[i] = 0.0
                for k in range(n):
                    moved[i] += transition[i, k] * x[k]
                for j in range(n):
                    total = 0.0
                    for k in range(n):
                        if transition[i, k] != 0.0:
                            total += transition[i, k] * cov[k, j]
                    half[i, j] = total
            for i in range(n):
                x[i] = moved[i]
                for j in range(i + 1):
                    total = noise[i, j]
                    for k in range(n):
                        if transition[j, k] != 0.0:
                            total += half[i, k] * transition[j, k]
                    cov[i, j] = total
                    cov[j, i] = total
        for m in range(channels):
            innovation[t, m] = 0.0
            if known[t, m] < 0.5:
                continue
            at = t if observe.shape[0] > 1 else 0
            expected, variance = 0.0, white[m]
            for i in range(n):
                expected += observe[at, m, i] * x[i]
                h[i] = 0.0
                for j in range(n):
                    h[i] += cov[i, j] * observe[at, m, j]
            for i in range(n):
                variance += observe[at, m, i] * h[i]
            error = y[t, m] - expected
            normal = abs(error) / np.sqrt(variance)
            if normal > clip:  # a bad sample counts less: as noisy as it looks
                variance *= (normal / clip) ** 2
            innovation[t, m] = error / np.sqrt(variance)
            score[t] += -0.5 * (innovation[t, m] ** 2 + np.log(variance))
            for i in range(n):
                gain = h[i] / variance
                x[i] += gain * error
                for j in range(n):
                    cov[i, j] -= gain * h[j]


_run = compiled(_filter)


def innovations(y: Floats, known: Floats, fresh: Floats, model: Linear) -> tuple[Floats, Floats]:
    """Innovations (samples, channels) of unit variance, and the log-likelihood of each sample.

    Parameters
    ----------
    y, known : (samples, channels); what is not known is passed over.  fresh : (samples,) 1 where a log begins.
    """
    observe = model.observe if model.observe.ndim == 3 else model.observe[None]
    innovation, score = np.zeros_like(y), np.zeros(len(y))
    _run(
        np.nan_to_num(y), known, fresh, model.transition, model.noise, model.start, np.ascontiguousarray(observe),
        model.white, _CLIP, innovation, score,
    )  # fmt: skip
    return innovation, score
