"""The 10 ms grid: interpolation between samples, a channel of a log on the grid, and means over its rows."""

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.dataset import ROW_S
from hil.diagnosis.data.log import PRESSURE, WHEEL_SPEED, Floats, Log

_GAP_S = 0.25
"""Longest time between two samples that is interpolated over."""
_SPARSE = 1.5
"""Rows per sample from which on a log is sampled more slowly than the demands were sent: a demand is then interpolated
instead of held, and a pressure curves between samples."""
_OSCILLATING = (*WHEEL_SPEED, "ax_mps2", "ay_mps2", "yaw_rate_rad_s")
"""Channels that oscillate with wheel and tyre within a few samples and have no corners: cubic interpolation."""


def resampled(log: Log, name: str, grid_s: Floats, hold: bool = False) -> Floats:
    """A channel of a log at the times ``grid_s`` (rows,), s; NaN where it is missing or over gaps of 0.25 s.

    ``hold`` keeps the last value (zero-order hold), as an actuator does with its demand, unless the log is sparse.
    """
    values = log.channels.get(name)
    if values is None or not np.isfinite(values).any():
        return np.full(len(grid_s), np.nan)
    finite = np.isfinite(values)
    t_s, values = log.t_s[finite], values[finite]
    cycle_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0
    if hold and cycle_s < _SPARSE * ROW_S:
        jitter_s = 0.4 * cycle_s
        at = np.clip(np.searchsorted(t_s, grid_s + jitter_s, side="right") - 1, 0, None)
        return np.asarray(values[at], np.float64)
    if name in _OSCILLATING or (name in PRESSURE and cycle_s >= _SPARSE * ROW_S):
        out = at_samples(values, np.interp(grid_s, t_s, np.arange(len(t_s), dtype=np.float64)))
    else:
        out = np.interp(grid_s, t_s, values)
    following = np.clip(np.searchsorted(t_s, grid_s), 1, max(len(t_s) - 1, 1))
    gap_s = np.diff(t_s)[following - 1] if len(t_s) > 1 else np.full(len(grid_s), np.inf)
    out[gap_s > _GAP_S] = np.nan
    return out


def has_sample(log: Log, name: str, origin_s: float, samples: int, stride: int) -> NDArray[np.bool_]:
    """(samples,) where a channel was measured: interpolation between the samples of a sparse channel is no measurement.

    Sample 0 is at ``origin_s``; a sample is ``stride`` rows of 10 ms.
    """
    values = log.channels.get(name)
    if values is None:
        return np.zeros(samples, bool)
    t_s = log.t_s[np.isfinite(values)]
    if len(t_s) < 2 or float(np.median(np.diff(t_s))) < 1.5 * stride * ROW_S:
        return np.ones(samples, bool)
    at = np.round((t_s - origin_s) / (stride * ROW_S) - 0.25).astype(np.int64)
    measured = np.zeros(samples, bool)
    measured[at[(at >= 0) & (at < samples)]] = True
    return measured


def without_gaps(values: Floats) -> Floats:
    """Values (rows,) with NaN replaced by linear interpolation; zeros where all are NaN."""
    finite = np.isfinite(values)
    if not finite.any():
        return np.zeros(len(values))
    at = np.arange(len(values))
    return np.asarray(np.interp(at, at[finite], values[finite]))


def smoothed(values: Floats) -> Floats:
    """(rows,) value at each row of the straight line fitted to the 0.2 s that follow."""
    n = 20
    padded = np.concatenate((values, np.full(n - 1, values[-1])))
    windows = np.lib.stride_tricks.sliding_window_view(padded, n)
    x = np.arange(n) - (n - 1) / 2.0
    slope = windows @ x / float(x @ x)
    return np.asarray(windows.mean(axis=1) + slope * x[0])


def averaged(values: Floats, stride: int) -> Floats:
    """Means of ``stride`` rows: (rows, columns) to (rows // stride, columns)."""
    out = np.empty((len(values) // stride, values.shape[1]))
    _means(values, stride, out)
    return out


@compiled
def _means(values: Floats, stride: int, out: Floats) -> None:
    for t in range(out.shape[0]):
        for k in range(out.shape[1]):
            total = 0.0
            for j in range(stride):
                total += values[stride * t + j, k]
            out[t, k] = total / stride


@compiled
def cubic(values: Floats, k: int, place: float) -> float:
    """Column ``k`` of ``values`` (samples, columns) at a fractional sample, by cubic convolution; constant beyond the
    ends (Keys 1981, IEEE Trans. ASSP 29, 1153, a = -1/2)."""
    last = values.shape[0] - 1
    place = min(max(place, 0.0), float(last))
    i = min(int(place), max(last - 1, 0))
    s = place - i
    b, c = values[i, k], values[min(i + 1, last), k]
    a = values[i - 1, k] if i > 0 else 2.0 * b - c
    d = values[i + 2, k] if i + 2 <= last else 2.0 * c - b
    curve = 2.0 * a - 5.0 * b + 4.0 * c - d + s * (3.0 * (b - c) + d - a)
    return float(b + 0.5 * s * (c - a + s * curve))


@compiled
def shifted(values: Floats, late: Floats, out: Floats) -> None:
    """Columns of ``values`` (samples, columns), each sample ``late`` (samples,) of them later, into ``out`` of the same
    shape, by `cubic`.

    A wheel that oscillates on its tyre has four samples of 10 ms per period: linear interpolation loses up to a third
    of its amplitude.
    """
    for t in range(out.shape[0]):
        for k in range(values.shape[1]):
            out[t, k] = cubic(values, k, t - late[t])


@compiled
def shifted_linear(values: Floats, every: int, late: Floats, out: Floats) -> None:
    """As `shifted`, by linear interpolation, at every ``every``-th sample."""
    last = values.shape[0] - 1
    for t in range(out.shape[0]):
        place = min(max(every * t - late[t], 0.0), float(last))
        i = int(place)
        following = min(i + 1, last)
        for k in range(values.shape[1]):
            out[t, k] = values[i, k] + (place - i) * (values[following, k] - values[i, k])


@compiled
def upsampled(values: Floats, bend: Floats, out: Floats) -> None:
    """Columns of ``values`` (rows, columns) at ``len(out) / rows`` points per row: between rows on a parabola that is
    off the straight line by ``bend`` (rows, columns) in the middle."""
    points = out.shape[0] // values.shape[0]
    for t in range(values.shape[0]):
        following = min(t + 1, values.shape[0] - 1)
        for j in range(points):
            share = j / points
            for k in range(values.shape[1]):
                straight = values[t, k] + share * (values[following, k] - values[t, k])
                out[points * t + j, k] = straight + 4.0 * share * (1.0 - share) * bend[t, k]


@compiled
def _at(values: Floats, places: Floats, out: Floats) -> None:
    for t in range(out.size):
        out[t] = cubic(values, 0, places[t])


def at_samples(values: Floats, at: Floats) -> Floats:
    """Values (samples,) at fractional sample numbers ``at`` (rows,), by `cubic`."""
    out = np.empty(len(at))
    _at(np.ascontiguousarray(values, np.float64)[:, None], np.asarray(at, np.float64), out)
    return out
