"""Innovations of the noise model: what is left of a track, sample by sample, after all that the past foretells.

The same linear filter goes over residuals and sensitivities, so a fit on its output is the fit of maximum likelihood.
"""

import numpy as np

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.log import Floats

HUBER = 6.0
"""Innovations beyond so many standard deviations count in proportion, not squared (Huber 1964)."""
DIFFUSE_VARIANCE = 1e4  # variance of a start that nothing is known of
Three = tuple[Floats, Floats, Floats]


def _channel_innovations(
    y: Floats, scale: Floats, fresh: Floats, white: Floats, phi: float, colour: float, out: Floats
) -> float:
    columns = y.shape[1]
    state, innovation = np.zeros(columns), np.zeros(columns)
    variance, likelihood = colour, 0.0
    for t in range(y.shape[0]):
        if fresh[t] > 0.5:
            state[:] = 0.0
            variance = colour
        else:
            for k in range(columns):
                state[k] *= phi
            variance = phi * phi * variance + (1.0 - phi * phi) * colour
        if white[t] > 0.0:
            total = variance + white[t]
            gain, size, even = variance / total, 1.0 / np.sqrt(total), 1.0 / scale[t]
            for k in range(columns):
                innovation[k] = y[t, k] * even - state[k]
            for k in range(columns):
                state[k] += gain * innovation[k]
                out[t, k] = innovation[k] * size
            variance -= gain * variance
            far = max(abs(out[t, 0]) - HUBER, 0.0)
            likelihood -= 0.5 * (out[t, 0] * out[t, 0] - far * far + np.log(total))
        else:
            for k in range(columns):
                out[t, k] = 0.0
    return likelihood


def _longitudinal_innovations(
    tracks: Three, scale: Floats, fresh: Floats, restart: Floats, rolling: Floats, white: Floats, share: Floats,
    step_s: float, colours: Floats, outs: Three,
) -> float:  # fmt: skip
    # states: error of the speed; disturbances: force, slope, accelerometer, wheels, and ground speed if it is measured
    columns, count = tracks[0].shape[1], colours.shape[0]
    size = 1 + count
    x, innovation = np.zeros((size, columns)), np.zeros(columns)
    cov = np.zeros((size, size))
    h = np.zeros(size)
    likelihood = 0.0
    move = np.zeros((size, size))
    for t in range(len(fresh)):
        even = 1.0 / scale[t]
        if fresh[t] > 0.5:
            x[:] = 0.0
            cov[:] = 0.0
            for i in range(count):
                cov[1 + i, 1 + i] = colours[i, 1]
            cov[0, 0] = DIFFUSE_VARIANCE
        else:
            step = step_s * rolling[t]
            for k in range(columns):
                x[0, k] += step * (x[1, k] + x[2, k])
            for i in range(count):
                for k in range(columns):
                    x[1 + i, k] *= colours[i, 0]
            for i in range(size):
                for j in range(size):
                    move[i, j] = cov[i, j]
            for j in range(size):
                move[0, j] += step * (cov[1, j] + cov[2, j])
                for i in range(count):
                    move[1 + i, j] *= colours[i, 0]
            for i in range(size):
                cov[i, 0] = move[i, 0] + step * (move[i, 1] + move[i, 2])
                for j in range(count):
                    cov[i, 1 + j] = move[i, 1 + j] * colours[j, 0]
            for i in range(count):
                cov[1 + i, 1 + i] += (1.0 - colours[i, 0] ** 2) * colours[i, 1]
            if restart[t] > 0.5:
                for i in range(size):
                    cov[0, i] = 0.0
                    cov[i, 0] = 0.0
                cov[0, 0] = DIFFUSE_VARIANCE
                for k in range(columns):
                    x[0, k] = 0.0
        for m in range(3):
            y, out = tracks[m], outs[m]
            if white[t, m] <= 0.0:
                for k in range(columns):
                    out[t, k] = 0.0
                continue
            # what is seen: wheels (speed and their own share), acceleration (of a car at rest none), ground speed
            first, second = (1, 3) if m == 1 else (0, 4 if m == 0 else count)
            one = rolling[t] if m == 1 else 1.0
            other = share[t] if m == 0 else (1.0 if m == 1 or count > 4 else 0.0)
            for i in range(size):
                h[i] = one * cov[i, first] + other * cov[i, second]
            total = white[t, m] + one * h[first] + other * h[second]
            for k in range(columns):
                innovation[k] = y[t, k] * even - one * x[first, k] - other * x[second, k]
            for i in range(size):
                gain = h[i] / total
                for k in range(columns):
                    x[i, k] += gain * innovation[k]
            deviation = np.sqrt(total)
            for k in range(columns):
                out[t, k] = innovation[k] / deviation
            for i in range(size):
                for j in range(size):
                    cov[i, j] -= h[i] * h[j] / total
            far = max(abs(out[t, 0]) - HUBER, 0.0)
            likelihood -= 0.5 * (out[t, 0] ** 2 - far * far + np.log(total))
    return likelihood


channel_innovations = compiled(_channel_innovations)
"""White noise and AR(1) on one track: (samples, columns) in, innovations of variance 1 into ``out``; log-likelihood of
the first column, over the ``scale`` of each sample. ``white`` is the variance of each sample, 0 where nothing is
compared; ``fresh`` begins a log."""
longitudinal_innovations = compiled(_longitudinal_innovations)
"""The moving car: three tracks, (samples, columns), of speed, acceleration, ground speed, over their ``scale``.

``colours`` holds rows (factor from sample to sample, variance) of force, slope, accelerometer and wheel disturbance,
the last one weighted by ``share`` (samples,), and, where a ground speed is compared, its own; ``restart`` forgets the
speed's error. Force and slope move the car where it is ``rolling`` (samples,); one held at rest feels neither."""
