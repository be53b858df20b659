"""What the stamps of a log tell of its cycle, and of how long frames waited for the bus."""

import numpy as np

from hil.diagnosis.data.log import Floats

_REGULAR = 0.98
"""Share of the stamps within half a cycle of where a cycle has them, for a log to have one."""


def clock_origin_s(t_s: Floats) -> float:
    """Stamp of the first row had its frame waited as long as most do: what is demanded acts by the cycle.

    Of the first stamp itself every demand of the log would be early or late by what that one frame waited.
    """
    if len(t_s) < 3:
        return float(t_s[0])
    between = np.diff(t_s)
    cycles = np.concatenate(([0.0], np.cumsum(np.round(between / np.median(between)))))
    period = float(np.polyfit(cycles, t_s, 1)[0])
    late = t_s - t_s[0] - period * cycles
    usual = float(np.median(late))
    regular = np.mean(np.abs(late - usual) < 0.5 * period) > _REGULAR
    return float(t_s[0]) + (usual if regular else 0.0)


def timestamp_jitter_s(t_s: Floats) -> float:
    """How irregular the stamps of frames are, s: what one waits for the bus less what the one before did.

    All nodes wait alike and by themselves, so this is also how much later than its stamp a value of another node was
    taken, now and then. Gaps are no waiting.
    """
    between = np.diff(t_s)
    if not len(between):
        return 0.0
    apart = between - np.median(between)
    return float(np.sqrt(np.mean(apart[np.abs(apart) < 0.5 * np.median(between)] ** 2)))
