"""Values between samples: straight lines, or cubic convolution."""

import numpy as np

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.log import Floats


@compiled
def cubic(values: Floats, k: int, place: float) -> float:
    """Column ``k`` of ``values`` at a fractional sample, by cubic convolution; at the ends what is there."""
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
def shifted(values: Floats, late: float, out: Floats) -> None:
    """Columns of ``values`` (samples, columns) so many samples ``late``, into ``out``.

    Through the two samples on each side (Keys 1981, IEEE Trans. ASSP 29, 1153, a = -1/2): a wheel that swings on its
    tyre passes four samples of 10 ms a period, of which straight lines lose up to a third.
    """
    for t in range(out.shape[0]):
        for k in range(values.shape[1]):
            out[t, k] = cubic(values, k, t - late)


@compiled
def shifted_linear(values: Floats, every: int, late: float, out: Floats) -> None:
    """As `shifted`, on straight lines, at one of ``every`` samples."""
    last = values.shape[0] - 1
    for t in range(out.shape[0]):
        place = min(max(every * t - late, 0.0), float(last))
        i = int(place)
        following = min(i + 1, last)
        for k in range(values.shape[1]):
            out[t, k] = values[i, k] + (place - i) * (values[following, k] - values[i, k])


@compiled
def upsampled(values: Floats, bend: Floats, out: Floats) -> None:
    """Columns of ``values`` (rows, columns) at as many points a row as ``out`` has: between rows on a parabola that is
    off the straight line by ``bend`` in the middle."""
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
    """One column (samples,) at fractional numbers of samples, (rows,)."""
    out = np.empty(len(at))
    _at(np.ascontiguousarray(values, np.float64)[:, None], np.asarray(at, np.float64), out)
    return out
