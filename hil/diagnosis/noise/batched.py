"""Likelihoods of many noises at once, over lanes that the processor takes together.

The filters are those of `hil.diagnosis.noise.innovations`; what differs from lane to lane are the parameters of the noise,
and (lanes,) log-likelihoods come back. Innovations and their variances, (samples, lanes), are noted for the curvature.
"""

import numpy as np

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.log import Floats
from hil.diagnosis.noise.innovations import DIFFUSE_VARIANCE, HUBER

_TOGETHER = 4  # samples whose variances are multiplied before one logarithm is taken


def _channel_likelihoods(
    y: Floats, fresh: Floats, known: Floats, white: Floats, keep: Floats, colour: Floats, off: Floats, size: Floats
) -> Floats:  # fmt: skip
    lanes = len(keep)
    state, variance = np.zeros(lanes), colour.copy()
    product, likelihood = np.ones(lanes), np.zeros(lanes)
    for t in range(len(y)):
        if fresh[t] > 0.5:
            state[:] = 0.0
            variance[:] = colour
        else:
            for k in range(lanes):
                state[k] *= keep[k]
                variance[k] = keep[k] * keep[k] * variance[k] + (1.0 - keep[k] * keep[k]) * colour[k]
        if known[t] > 0.5:
            for k in range(lanes):
                total = variance[k] + white[t, k]
                gain = variance[k] / total
                innovation = y[t] - state[k]
                off[t, k], size[t, k] = innovation, total
                state[k] += gain * innovation
                variance[k] -= gain * variance[k]
                square = innovation * innovation / total
                far = 2.0 * HUBER * np.sqrt(square) - HUBER * HUBER
                likelihood[k] -= 0.5 * (far if square > HUBER * HUBER else square)
                product[k] *= total
        if t % _TOGETHER == 0:
            for k in range(lanes):
                likelihood[k] -= 0.5 * np.log(product[k])
                product[k] = 1.0
    return likelihood - 0.5 * np.log(product)


def _longitudinal_likelihoods(
    y: Floats, fresh: Floats, restart: Floats, rolling: Floats, known: Floats, white: Floats, share: Floats,
    step_s: float, keep: Floats, colour: Floats, sensor: Floats, off: Floats, size: Floats,
) -> Floats:  # fmt: skip
    count, lanes = keep.shape
    states = 1 + count
    x, cov, h = np.zeros((states, lanes)), np.zeros((states, states, lanes)), np.zeros((states, lanes))
    inverse, innovation = np.zeros(lanes), np.zeros(lanes)
    product, likelihood = np.ones(lanes), np.zeros(lanes)
    for t in range(len(y)):
        if fresh[t] > 0.5:
            x[:] = 0.0
            cov[:] = 0.0
            cov[0, 0] = DIFFUSE_VARIANCE
            for i in range(count):
                cov[1 + i, 1 + i] = colour[i]
        else:
            step = step_s * rolling[t]
            for k in range(lanes):
                x[0, k] += step * (x[1, k] + x[2, k])
            for j in range(states):
                for k in range(lanes):
                    cov[0, j, k] += step * (cov[1, j, k] + cov[2, j, k])
            for k in range(lanes):
                cov[0, 0, k] += step * (cov[0, 1, k] + cov[0, 2, k])
            for j in range(count):
                for k in range(lanes):
                    x[1 + j, k] *= keep[j, k]
                    cov[0, 1 + j, k] *= keep[j, k]
                    cov[1 + j, 0, k] = cov[0, 1 + j, k]
                for i in range(count):
                    for k in range(lanes):
                        cov[1 + i, 1 + j, k] *= keep[i, k] * keep[j, k]
                for k in range(lanes):
                    cov[1 + j, 1 + j, k] += (1.0 - keep[j, k] * keep[j, k]) * colour[j, k]
            if restart[t] > 0.5:
                x[0] = 0.0
                cov[0] = 0.0
                cov[:, 0] = 0.0
                cov[0, 0] = DIFFUSE_VARIANCE
        for m in range(3):
            if known[t, m] < 0.5:
                continue
            first, second = (1, 3) if m == 1 else (0, 4 if m == 0 else count)
            one = rolling[t] if m == 1 else 1.0
            other = share[t] if m == 0 else (1.0 if m == 1 or count > 4 else 0.0)
            for i in range(states):
                for k in range(lanes):
                    h[i, k] = one * cov[i, first, k] + other * cov[i, second, k]
            for k in range(lanes):
                total = white[t, m] + sensor[m, k] + one * h[first, k] + other * h[second, k]
                inverse[k] = 1.0 / total
                apart = y[t, m] - one * x[first, k] - other * x[second, k]
                off[t, m, k], size[t, m, k] = apart, total
                innovation[k] = apart * inverse[k]
                square = apart * innovation[k]
                far = 2.0 * HUBER * np.sqrt(square) - HUBER * HUBER
                likelihood[k] -= 0.5 * (far if square > HUBER * HUBER else square)
                product[k] *= total
            for i in range(states):
                for k in range(lanes):
                    x[i, k] += h[i, k] * innovation[k]
                for j in range(states):
                    for k in range(lanes):
                        cov[i, j, k] -= h[i, k] * h[j, k] * inverse[k]
        if t % _TOGETHER == 0:
            for k in range(lanes):
                likelihood[k] -= 0.5 * np.log(product[k])
                product[k] = 1.0
    return likelihood - 0.5 * np.log(product)


def _information_of(off: Floats, size: Floats, limit: float) -> Floats:
    lanes = off.shape[1] - 1
    found, turned, grown = np.zeros((lanes, lanes)), np.zeros(lanes), np.zeros(lanes)
    for t in range(len(off)):
        inverse = 1.0 / size[t, 0]
        far = abs(off[t, 0]) * np.sqrt(inverse)
        weight = inverse * (limit / far if far > limit else 1.0)
        half = 0.5 * inverse * inverse
        for k in range(lanes):
            turned[k], grown[k] = off[t, 1 + k] - off[t, 0], size[t, 1 + k] - size[t, 0]
        for i in range(lanes):
            for k in range(lanes):
                found[i, k] += weight * turned[i] * turned[k] + half * grown[i] * grown[k]
    return found


channel_likelihoods = compiled(_channel_likelihoods)
"""One track (samples,), ``known`` (samples,) where it is compared, ``white`` (samples, lanes) variance, ``keep`` and
``colour`` (lanes,): what is left of the coloured noise from sample to sample, and its variance. Innovations go into
``off`` (samples, lanes), their variances into ``size``, where the track is compared."""
longitudinal_likelihoods = compiled(_longitudinal_likelihoods)
"""The moving car: ``y``, ``known`` and the ``white`` variance that all lanes share are (samples, 3 tracks); ``keep``
and ``colour`` are (disturbances, lanes), ``sensor`` (3 tracks, lanes) is white variance of their own; ``off`` and
``size`` are (samples, 3 tracks, lanes)."""

information_matrix = compiled(_information_of)
"""Products, (lanes, lanes), of what innovations and their variances (samples, 1 + lanes) change from the first lane to
the others; innovations beyond ``limit`` standard deviations count less, as in the likelihood."""
