"""Monotonic time of what a driver stamps with the time of day, whatever is done to the time of day meanwhile."""

from collections.abc import Callable

from hil.rt.clock import clocks_ns, monotonic_ns, wall_time_ns

_SLACK_NS = 20_000_000  # an adapter may hand a frame over later than the window it came in (USB, a busy driver)
_STEP_NS = 1_000_000  # a smaller change is slewing or reading noise: at most 500 ppm, adjtimex(2)
_FOREIGN_NS = 1_000_000_000  # further outside than this, a stamp counts from somewhere else


class WallStamps:
    """Turns stamps of one driver into monotonic times that never run backwards.

    A frame received between two looks at the clocks came between them. So of the offsets known (today's, and that of
    the driver's last stamp) the one counts that puts a stamp there: a step of the time of day, before or after the
    frame, moves nothing. A stamp that neither puts there is moved to the edge, or to now where it counts from
    somewhere else. What is left is an error no larger than a step that is shorter than the time between two looks.

    Parameters
    ----------
    monotonic, wall : the clocks, ns.
    slack_ns : how much earlier than the last look a frame may have come.
    """

    def __init__(
        self,
        monotonic: Callable[[], int] = monotonic_ns,
        wall: Callable[[], int] = wall_time_ns,
        slack_ns: int = _SLACK_NS,
    ) -> None:
        self._monotonic = monotonic
        self._wall = wall
        self._slack_ns = slack_ns
        self._looked_ns, self._offset_ns = clocks_ns(self._monotonic, self._wall)
        self._used_ns = self._offset_ns
        self._stepped = False
        self._begin_ns = self._last_ns = self._looked_ns

    def look(self, drained: bool = True) -> int:
        """Look at both clocks, after frames were taken from the driver and before `monotonic_of`; monotonic time, ns.

        Parameters
        ----------
        drained : none of the frames taken since the last look had come before that.
        """
        if drained:
            self._begin_ns = self._looked_ns
        self._looked_ns, offset_ns = clocks_ns(self._monotonic, self._wall)
        self._stepped = abs(offset_ns - self._offset_ns) > _STEP_NS
        self._offset_ns = offset_ns
        return self._looked_ns

    def monotonic_of(self, wall_ns: int) -> int:
        """Return the monotonic time of a stamp that came since the last look but one, ns; in order of arrival."""
        earliest_ns, latest_ns = max(self._begin_ns - self._slack_ns, self._last_ns), self._looked_ns
        best_ns, outside_ns = latest_ns, _FOREIGN_NS
        known_ns = (self._offset_ns, self._used_ns)
        for offset_ns in reversed(known_ns) if self._stepped else known_ns:
            time_ns = wall_ns - offset_ns
            here_ns = max(earliest_ns - time_ns, time_ns - latest_ns, 0)
            if here_ns < outside_ns:
                best_ns, outside_ns, self._used_ns = min(max(time_ns, earliest_ns), latest_ns), here_ns, offset_ns
                if not here_ns:
                    break
        self._last_ns = max(self._last_ns, best_ns)
        return self._last_ns
