"""What loggers do to signals: low-pass filters, lateness, coarse steps; and noise that is white or slow."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Vector = NDArray[np.float64]
REST_S = 0.3
"""Without a new edge for so long a wheel is told to be at rest."""


def slow_noise(rng: np.random.Generator, count: int, step_s: float, deviation: float, time_s: float) -> Vector:
    """First-order Gauss-Markov noise, (count,), stationary from the start.

    Parameters
    ----------
    step_s, time_s : between samples; correlation time, s.
    deviation : standard deviation, of the signal's unit.
    """
    pole = np.exp(-step_s / time_s)
    white = rng.normal(0.0, deviation * np.sqrt(1.0 - pole * pole), count)
    first = rng.normal(0.0, deviation)
    return np.asarray(lfilter([1.0], [1.0, -pole], white, zi=np.array([pole * first]))[0])


def low_pass(values: Vector, step_s: float, cutoff_hz: float, damping: float = 0.7) -> Vector:
    """A low-pass filter of second order, (n,), at rest at the first value; poles are exact, zeros at infinity.

    Parameters
    ----------
    values : (n,).  step_s : between them, s.  cutoff_hz : natural frequency.  damping : below 1.
    """
    w = 2.0 * np.pi * cutoff_hz
    decay = np.exp(-damping * w * step_s)
    a1 = -2.0 * decay * np.cos(w * np.sqrt(1.0 - damping * damping) * step_s)
    a2 = decay * decay
    b0 = 1.0 + a1 + a2
    first = float(values[0])
    rest = lfilter([b0], [1.0, a1, a2], values - first)
    return np.asarray(rest + first)


def sampled(t_s: Vector, values: Vector, at_s: Vector) -> Vector:
    """Values at other times, linear between samples, the first and last beyond them."""
    return np.interp(at_s, t_s, values)


def steps(values: Vector, size: float) -> Vector:
    """Values rounded to whole steps."""
    return np.round(values / size) * size + 0.0


def tooth_speeds(
    t_s: Vector, angle_rad: Vector, messages_s: Vector, teeth: int, shift: float = 0.0
) -> tuple[Vector, Vector]:
    """Wheel speeds as a control unit counts them: whole teeth over the time between their edges.

    Each message tells the mean speed between the last edge before it and the last edge before the former message,
    with the time in the middle of both. Without a new edge it tells the former speed, but no more than one tooth
    since the last edge, at its own time; after `REST_S` zero.

    Parameters
    ----------
    t_s, angle_rad : (n,) time and angle of the wheel.  messages_s : (k,) increasing.
    teeth : of the toothed wheel.  shift : of its first edge, 0 to 1 tooth.

    Returns
    -------
    stamps_s, speeds_rad_s : (k,) each.
    """
    pitch = 2.0 * np.pi / teeth
    place = np.maximum.accumulate(angle_rad) / pitch + shift
    edges = np.arange(np.ceil(place[0]), np.floor(place[-1]) + 1.0)
    moving = np.concatenate(([True], np.diff(place) > 1e-12))
    edge_s = np.interp(edges, place[moving], t_s[moving])
    last = np.searchsorted(edge_s, messages_s, side="right") - 1
    stamps, speeds = messages_s.copy(), np.zeros(len(messages_s))
    for k in range(1, len(messages_s)):
        if last[k] > last[k - 1] >= 0:
            stamps[k] = 0.5 * (edge_s[last[k]] + edge_s[last[k - 1]])
            speeds[k] = pitch * (last[k] - last[k - 1]) / (edge_s[last[k]] - edge_s[last[k - 1]])
        elif last[k] >= 0 and messages_s[k] - edge_s[last[k]] < REST_S:
            speeds[k] = min(speeds[k - 1], pitch / (messages_s[k] - edge_s[last[k]]))
    speeds[0] = speeds[1]
    return np.maximum.accumulate(stamps), speeds
