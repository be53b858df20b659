"""The Kalman filter of every sensor model: log-likelihood of each sample, robust against single outliers."""

from dataclasses import dataclass

import numpy as np

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.log import Floats

_OUTLIER_SIGMA = 4.0
"""Innovation, in standard deviations, from which a sample counts less: its variance grows until it lies there."""


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A linear Gaussian model of n states and m channels.

    State: x[t+1] = F x[t] + w[t], w ~ N(0, Q), with x ~ N(0, P0) at the start of a log.
    Measurement: y[t] = H[t] x[t] + e[t], e ~ N(0, diag(r)).

    Attributes
    ----------
    transition : (n, n) F.
    process_noise : (n, n) Q.
    initial_covariance : (n, n) P0.
    observation : (m, n) or (samples, m, n) H.
    measurement_variance : (m,) r.
    """

    transition: Floats
    process_noise: Floats
    initial_covariance: Floats
    observation: Floats
    measurement_variance: Floats


@compiled
def _predict(x: Floats, cov: Floats, transition: Floats, process_noise: Floats, work: Floats) -> None:
    """x = F x, P = F P F' + Q, in place; ``work`` is (n + 1, n)."""
    n = len(x)
    for i in range(n):
        work[n, i] = 0.0
        for k in range(n):
            work[n, i] += transition[i, k] * x[k]
        for j in range(n):
            total = 0.0
            for k in range(n):
                if transition[i, k] != 0.0:
                    total += transition[i, k] * cov[k, j]
            work[i, j] = total
    for i in range(n):
        x[i] = work[n, i]
        for j in range(i + 1):
            total = process_noise[i, j]
            for k in range(n):
                if transition[j, k] != 0.0:
                    total += work[i, k] * transition[j, k]
            cov[i, j] = total
            cov[j, i] = total


@compiled
def _update(
    x: Floats, cov: Floats, observation: Floats, t: int, m: int, y: float, variance: float, outlier_sigma: float,
    work: Floats,
) -> float:  # fmt: skip
    """One channel: S = h P h' + r, K = P h' / S, x = x + K (y - h x), P = P - K h P, in place.

    h is row (``t``, ``m``) of ``observation``, ``variance`` r. Returns the log-likelihood of ``y`` without constants.
    """
    n = len(x)
    expected = 0.0
    for i in range(n):
        expected += observation[t, m, i] * x[i]
        work[0, i] = 0.0
        for j in range(n):
            work[0, i] += cov[i, j] * observation[t, m, j]
    for i in range(n):
        variance += observation[t, m, i] * work[0, i]
    error = y - expected
    sigmas = abs(error) / np.sqrt(variance)
    if sigmas > outlier_sigma:
        variance *= (sigmas / outlier_sigma) ** 2
    innovation = error / np.sqrt(variance)
    for i in range(n):
        gain = work[0, i] / variance
        x[i] += gain * error
        for j in range(n):
            cov[i, j] -= gain * work[0, j]
    return float(-0.5 * (innovation**2 + np.log(variance)))


@compiled
def _filter(
    y: Floats, valid: Floats, log_start: Floats, transition: Floats, process_noise: Floats, initial_covariance: Floats,
    observation: Floats, measurement_variance: Floats, outlier_sigma: float,
) -> Floats:  # fmt: skip
    samples, channels = y.shape
    n = transition.shape[0]
    x, cov, work = np.zeros(n), np.zeros((n, n)), np.zeros((n + 1, n))
    log_likelihood = np.zeros(samples)
    for t in range(samples):
        if log_start[t] > 0.5:
            x[:] = 0.0
            cov[:] = initial_covariance
        else:
            _predict(x, cov, transition, process_noise, work)
        at = t if observation.shape[0] > 1 else 0
        for m in range(channels):
            if valid[t, m] > 0.5:
                log_likelihood[t] += _update(
                    x, cov, observation, at, m, y[t, m], measurement_variance[m], outlier_sigma, work
                )
    return log_likelihood


def log_likelihood(y: Floats, valid: Floats, log_start: Floats, model: StateSpace) -> Floats:
    """(samples,) log-likelihood of each sample given those before it, without constants.

    Parameters
    ----------
    y : (samples, m) measured; channels are independent given the state and are taken in one after the other.
    valid : (samples, m) 1 where a channel counts.
    log_start : (samples,) 1 where a log starts.
    """
    observation = model.observation if model.observation.ndim == 3 else model.observation[None]
    likelihood: Floats = _filter(
        np.nan_to_num(y), valid, log_start, model.transition, model.process_noise, model.initial_covariance,
        np.ascontiguousarray(observation), model.measurement_variance, _OUTLIER_SIGMA,
    )  # fmt: skip
    return likelihood
