"""What the bench keeps of each message, of each node's ticks and of what a node takes, since the manoeuvre began."""

from dbc.contract import MessageSpec
from dbc.e2e import COUNTER_MODULUS, check_value

SILENT_CYCLES = 4
"""Time-out of a message in cycles: the controller, brake and motors react after 40 ms without a 10 ms message."""
_BURST = 6.0  # frames of one message ahead of its cycle: a late sender that catches up is not two senders
_FASTER = 1.1  # than its cycle time a sender may be: clocks differ
_MOST_LOST = 2  # as of `dbc.e2e.Checker`


class Track:
    """One message as heard since the manoeuvre began."""

    __slots__ = ("ahead", "corrupt", "count", "counter", "first_ns", "gaps", "jumps", "last_ns", "missing", "spec")

    def __init__(self, spec: MessageSpec) -> None:
        self.spec = spec
        self.last_ns = -1
        self.first_ns = -1
        self.count = self.jumps = self.corrupt = self.missing = 0
        self.ahead = 0.0
        self.counter = -1
        self.gaps: list[tuple[int, int]] = []

    def begin(self) -> None:
        """Count from now on."""
        self.first_ns = -1
        self.count = self.jumps = self.missing = 0
        self.gaps = []

    @property
    def timeout_ns(self) -> int:
        """Time without it after which its receivers react, ns."""
        return SILENT_CYCLES * self.spec.cycle_ns

    def hear(self, now_ns: int, data: bytes) -> bool:
        """Take one frame; True where it comes more often than its cycle allows."""
        since_ns = now_ns - self.last_ns
        if self.last_ns >= 0 and since_ns > self.timeout_ns:
            self.gaps.append((self.last_ns, now_ns))
        if self.spec.data_id is not None:
            self._follow(since_ns, data)
        self.ahead = max(0.0, self.ahead - since_ns * _FASTER / self.spec.cycle_ns) + 1.0
        self.last_ns = now_ns
        self.first_ns = now_ns if self.first_ns < 0 else self.first_ns
        self.count += 1
        if self.ahead < _BURST:
            return False
        self.ahead = 0.0
        return True

    def _follow(self, since_ns: int, data: bytes) -> None:
        counter = data[1] & 0x0F if len(data) == self.spec.length else COUNTER_MODULUS
        step = (counter - self.counter) % COUNTER_MODULUS
        if self.counter >= 0 and not 0 < step <= _MOST_LOST + 1:
            sound = counter < COUNTER_MODULUS and data[0] == check_value(self.spec.data_id or 0, data)
            if not sound:
                self.corrupt += 1
                return
            self.jumps += since_ns < 2 * self.spec.cycle_ns  # else it is what was lost in a gap
        elif self.counter >= 0:
            self.missing += step - 1
        self.counter = counter if counter < COUNTER_MODULUS else self.counter

    @property
    def missed(self) -> tuple[int, int]:
        """Cycles in which nothing was sent, and all cycles, between its first and its last frame."""
        cycles = round((self.last_ns - self.first_ns) / self.spec.cycle_ns) + 1 if self.count else 0
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
        if len(data) != self._spec.length:
            return
        *counters, lost, corrupt = self._spec.decode(data)
        self._totals = [lost or 0, corrupt or 0]
        for i, (track, counter) in enumerate(zip(self.tracks, counters, strict=True)):
            reports, from_ns, sent = self._unchanged[i]
            if counter != self._counters[i] or not reports:
                self._unchanged[i] = (1, at_ns, track.count)
            else:
                self._unchanged[i] = (reports + 1, from_ns, sent)
                if reports > SILENT_CYCLES and track.count - sent > SILENT_CYCLES:
                    self.missed[track.spec.name] = (from_ns, at_ns)
        self._counters = counters

    @property
    def lost(self) -> tuple[int, int]:
        """Frames lost and corrupt since the manoeuvre began."""
        lost, corrupt = (max(0, now - before) for now, before in zip(self._totals, self._before, strict=True))
        return lost, corrupt
