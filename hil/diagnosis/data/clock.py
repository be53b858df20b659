"""Time stamps of a log: the start of its cycle, and the jitter of frames that wait for the bus."""

import numpy as np

from hil.diagnosis.data.log import Floats

_REGULAR = 0.98
"""Share of the stamps that lie within half a period of a regular cycle, from which on a log is cyclic."""


def clock_origin_s(t_s: Floats) -> float:
    """Start of a log's cycle, s: its first stamp corrected to the median delay of all frames; ``t_s`` (n,), s.

    Demands act by the cycle. Counted from the first stamp itself, all would be early or late by that frame's delay.
    """
    if len(t_s) < 3:
        return float(t_s[0])
    steps = np.diff(t_s)
    cycles = np.concatenate(([0.0], np.cumsum(np.round(steps / np.median(steps)))))
    period = float(np.polyfit(cycles, t_s, 1)[0])
    delay = t_s - t_s[0] - period * cycles
    typical = float(np.median(delay))
    regular = np.mean(np.abs(delay - typical) < 0.5 * period) > _REGULAR
    return float(t_s[0]) + (typical if regular else 0.0)


def timestamp_jitter_s(t_s: Floats) -> float:
    """Rms difference in delay between consecutive frames, s, without gaps; ``t_s`` (n,), s.

    All nodes wait for the bus alike and independently, so it is also the difference in delay between two nodes' frames.
    """
    steps = np.diff(t_s)
    if not len(steps):
        return 0.0
    deviation = steps - np.median(steps)
    return float(np.sqrt(np.mean(deviation[np.abs(deviation) < 0.5 * np.median(steps)] ** 2)))
