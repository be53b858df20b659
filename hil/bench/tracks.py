"""What the bench keeps of each message, of each node's ticks and of what a node takes, since the manoeuvre began."""

from dbc.contract import MessageSpec
from dbc.e2e import COUNTER_MODULUS, check_value

SILENT_CYCLES = 4
"""Time-out of a message in cycles: the controller, brake and motors react after 40 ms without a 10 ms message."""
_BURST = 6.0  # frames of one message ahead of its cycle: a late sender that catches up is not two senders
_FASTER = 1.1  # than its cycle time a sender may be: clocks differ
_EACH = 2  # of so many reports one is looked at: a counter of 15 values never comes round in that time
_MOST_LOST = 2  # as of `dbc.e2e.Checker`


class Track:
    """One message as heard since the manoeuvre began.

    Attributes
    ----------
    spec, node : the message, and the node that sends it as people call it.
    timeout_ns : time without it after which its receivers react, ns.
    first_ns, last_ns, count : its frames; -1 before the first.
    gaps : when it was silent for longer than its time-out.
    missing : frames lost by the counters.
    jumps : sound frames with a counter out of sequence, at full rate.
    """

    __slots__ = (
        "_ahead", "_counter", "_cycle_ns", "_drain", "_length", "_protected", "count", "first_ns", "gaps", "jumps",
        "last_ns", "missing", "node", "spec", "timeout_ns",
    )  # fmt: skip

    def __init__(self, spec: MessageSpec, node: str) -> None:
        self.spec, self.node = spec, node
        self.timeout_ns = SILENT_CYCLES * spec.cycle_ns
        self.last_ns = -1
        self._cycle_ns = spec.cycle_ns
        self._drain = _FASTER / spec.cycle_ns
        self._length = spec.length
        self._protected = spec.data_id is not None
        self._ahead = 0.0
        self._counter = -1
        self.gaps: list[tuple[int, int]] = []
        self.begin()

    def begin(self) -> None:
        """Count from now on."""
        self.first_ns = -1
        self.count = self.jumps = self.missing = 0
        self.gaps = []

    def hear(self, now_ns: int, data: bytes) -> bool:
        """Take one frame; True where it comes more often than its cycle allows."""
        last_ns, self.last_ns = self.last_ns, now_ns
        since_ns = now_ns - last_ns
        if self.first_ns < 0:
            self.first_ns = now_ns
        self.count += 1
        if self._protected:
            counter = data[1] & 0x0F if len(data) == self._length else COUNTER_MODULUS
            if counter == self._counter + 1:  # the way of nearly every frame
                self._counter = counter
            else:
                self._follow(counter, since_ns, data)
        if since_ns > self.timeout_ns and last_ns >= 0:
            self.gaps.append((last_ns, now_ns))
        ahead = self._ahead - since_ns * self._drain
        self._ahead = ahead = ahead + 1.0 if ahead > 0.0 else 1.0
        if ahead < _BURST:
            return False
        self._ahead = 0.0
        return True

    def _follow(self, counter: int, since_ns: int, data: bytes) -> None:
        """Take a counter that is not the one before plus one."""
        step = (counter - self._counter) % COUNTER_MODULUS
        if self._counter >= 0 and not 0 < step <= _MOST_LOST + 1:
            if counter >= COUNTER_MODULUS or data[0] != check_value(self.spec.data_id or 0, data):
                return
            self.jumps += since_ns < 2 * self._cycle_ns  # else it is what was lost in a gap
        elif self._counter >= 0:
            self.missing += step - 1
        if counter < COUNTER_MODULUS:
            self._counter = counter

    @property
    def missed(self) -> tuple[int, int]:
        """Cycles in which nothing was sent, and all cycles, between its first and its last frame."""
        cycles = round((self.last_ns - self.first_ns) / self._cycle_ns) + 1 if self.count else 0
        return max(0, cycles - self.count - self.missing), cycles


class Ticks:
    """Ticks of a node by its own word: ECU_TIMING or PLANT_TIMING."""

    def __init__(self, spec: MessageSpec) -> None:
        self._spec = spec
        self._first = self._last = b""

    def begin(self) -> None:
        """Count from now on."""
        self._first = self._last

    def hear(self, data: bytes) -> None:
        """Take one report."""
        if len(data) == self._spec.length:
            self._first = self._first or data
            self._last = data

    @property
    def skipped(self) -> tuple[int, int]:
        """Ticks skipped, and all ticks; zeros where nothing was said."""
        if not self._last:
            return 0, 0
        ends = [self._spec.decode(data) for data in (self._first, self._last)]
        ticks, overruns = (ends[1][i] - ends[0][i] if None not in (ends[0][i], ends[1][i]) else 0 for i in (0, 2))
        return max(0, overruns), max(0, ticks)


class Intake:
    """What a node takes of what is sent to it, by its own word: ECU_RECEPTION or PLANT_RECEPTION."""

    def __init__(self, spec: MessageSpec, tracks: dict[int, Track]) -> None:
        by_name = {track.spec.name: track for track in tracks.values()}
        names = [field.signal.removeprefix("COUNTER_") for field in spec.fields]
        self.tracks = [by_name[name] for name in names if name in by_name]
        self._spec = spec
        self._reports = 0
        self._totals = [0, 0]
        self._before = [0, 0]
        self.begin()

    def begin(self) -> None:
        """Count from now on."""
        self._before = self._totals
        self._unchanged = [(0, 0, 0)] * len(self.tracks)  # reports without a change, from when, frames sent until then
        self._counters: list[int | None] = [None] * len(self.tracks)
        self.missed: dict[str, tuple[int, int]] = {}

    def hear(self, data: bytes, at_ns: int) -> None:
        """Take one report."""
        self._reports += 1
        if self._reports % _EACH or len(data) != self._spec.length:
            return
        *counters, lost, corrupt = self._spec.decode(data)
        self._totals = [lost or 0, corrupt or 0]
        for i, (track, counter) in enumerate(zip(self.tracks, counters, strict=True)):
            reports, from_ns, sent = self._unchanged[i]
            if counter != self._counters[i] or not reports:
                self._unchanged[i] = (1, at_ns, track.count)
            else:
                self._unchanged[i] = (reports + 1, from_ns, sent)
                if reports * _EACH > SILENT_CYCLES and track.count - sent > SILENT_CYCLES:
                    self.missed[track.spec.name] = (from_ns, at_ns)
        self._counters = counters

    @property
    def lost(self) -> tuple[int, int]:
        """Frames lost and corrupt since the manoeuvre began."""
        lost, corrupt = (max(0, now - before) for now, before in zip(self._totals, self._before, strict=True))
        return lost, corrupt
