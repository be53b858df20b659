"""Signals shifted in time, linear between samples."""

import numpy as np

from plant.effects.sensing.kind import Memory
from plant.layout import Vector

KEPT_S = 2.0


def delayed(time_s: Vector, values: Vector, delay_s: Vector, memory: Memory) -> Vector:
    """Values of ``delay_s`` ago, held at the first sample before there are any."""
    past_s, past = memory.get("past", (time_s[:0], values[:0]))
    times, samples = np.concatenate([past_s, time_s]), np.concatenate([past, values])
    kept = times >= times[-1] - KEPT_S
    memory["past"] = (times[kept], samples[kept])
    return np.column_stack([np.interp(time_s - delay_s, times, column) for column in samples.T])


def advanced(time_s: Vector, values: Vector, delay_s: Vector) -> Vector:
    """Inverse of `delayed` on arrays: values of ``delay_s`` later."""
    return np.column_stack([np.interp(time_s + delay_s, time_s, column) for column in values.T])
