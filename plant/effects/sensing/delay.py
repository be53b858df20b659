"""Signals shifted in time, linear between samples."""

import numpy as np

from plant.compiled import exact_entry
from plant.effects.sensing.kind import Memory
from plant.layout import Vector

KEPT_S = 2.0


def delayed(time_s: Vector, values: Vector, delay_s: Vector, memory: Memory) -> Vector:
    """Values of ``delay_s`` ago, held at the first sample before there are any."""
    times, samples = time_s, values
    if "past" in memory:
        past_s, past = memory["past"]
        times, samples = np.concatenate([past_s, time_s]), np.concatenate([past, values])
    kept = int(np.searchsorted(times, times[-1] - KEPT_S))
    memory["past"] = (times[kept:].copy(), samples[kept:].copy())
    return interpolated(times, samples, time_s - delay_s) if delay_s.any() else values


def advanced(time_s: Vector, values: Vector, delay_s: Vector) -> Vector:
    """Inverse of `delayed` on arrays: values of ``delay_s`` later."""
    return interpolated(time_s, values, time_s + delay_s) if delay_s.any() else values


def interpolated(times: Vector, samples: Vector, at: Vector) -> Vector:
    """Each column of ``samples`` (times, signals) at other times, (at, signals), on straight lines; held beyond the
    ends. ``times`` increase."""
    out = np.empty((len(at), samples.shape[1]))
    _interpolate(np.ascontiguousarray(times), np.ascontiguousarray(samples), np.ascontiguousarray(at), out)
    return out


@exact_entry
def _interpolate(times: Vector, samples: Vector, at: Vector, out: Vector) -> None:
    last, i = len(times) - 1, 0
    for t in range(len(at)):
        while i < last and times[i + 1] <= at[t]:
            i += 1
        while i > 0 and times[i] > at[t]:
            i -= 1
        for k in range(samples.shape[1]):
            if i == last or at[t] < times[0]:
                out[t, k] = samples[i, k]
            else:
                slope = (samples[i + 1, k] - samples[i, k]) / (times[i + 1] - times[i])
                out[t, k] = slope * (at[t] - times[i]) + samples[i, k]
