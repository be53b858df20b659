"""Supervises everybody on the two buses while the manoeuvre runs: silence, missed cycles, other senders, lost demands.

By the stamps and counters of what the bench hears; what a message's cycle time and time-out are says the DBC.

| seen | verdict |
|---|---|
| a message stops and does not come back | broken |
| a message stops for longer than its time-out while the others of its node go on | failed |
| all messages of a node stop for longer than the time-out, and come back | inconclusive |
| a node skips more than `MOST_MISSED` of its ticks | inconclusive |
| a message comes more often than its cycle allows, or with two sequences of counters | inconclusive |
| a receiver does not take what is sent, or more than `MOST_MISSED` of it is lost or corrupt | inconclusive |
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from dbc.bench_messages import EcuReception, EcuTiming, PlantReception, PlantTiming
from dbc.contract import MessageSpec, contract, spec_of
from dbc.frame import BusName, LinkEvent, Received
from hil.bench.tracks import SILENT_CYCLES, Intake, Ticks, Track
from hil.errors import Verdict

MOST_MISSED = 0.01
"""Share of ticks skipped, or of frames lost, that a judgement bears; a choice: one tick in a hundred."""
_FEW = 3  # that never count, however short the run: one stall below the time-out
_JUMPS = 5  # counters out of sequence at full rate before they count as another sender's

_ECU, _PLANT = "ECU", "plant"
_TIMINGS = {spec_of(EcuTiming): _ECU, spec_of(PlantTiming): _PLANT}
_RECEPTIONS = {spec_of(EcuReception): _ECU, spec_of(PlantReception): _PLANT}
_NODE_TIMEOUT_NS = SILENT_CYCLES * 10_000_000  # every node sends something every 10 ms
_FAULT_COMMANDS = frozenset(
    spec.can_id for spec in contract(BusName.BENCH).sent_by("BENCH") if spec.name.startswith("FAULT_")
)
Key = tuple[BusName, int]


class Finding(NamedTuple):
    """Something that speaks against *passed*."""

    verdict: Verdict
    text: str


class Watch:
    """Listens to both buses.

    Parameters
    ----------
    say : takes what is found while the run goes on, one line at a time.
    """

    def __init__(self, say: Callable[[str], None] = lambda _: None) -> None:
        self._say = say
        self._vehicle, self._bench = (
            {
                i: Track(spec, _node_of(spec))
                for i, spec in contract(bus).by_id.items()
                if spec.cycle_ns and spec.sender != "BENCH"
            }
            for bus in (BusName.VEHICLE, BusName.BENCH)
        )
        self._ticks = {spec.can_id: Ticks(spec) for spec in _TIMINGS}
        self._intakes = {spec.can_id: Intake(spec, self._vehicle) for spec in _RECEPTIONS}
        self._last_ns: dict[str, int] = {}  # by node
        self._stalls: dict[str, list[tuple[int, int]]] = {_ECU: [], _PLANT: []}
        self._silent: set[str] = set()
        self._others: dict[Track, int] = {}
        self._start_ns: int | None = None
        self._newest_ns = 0
        self._excused: set[Key] = set()
        self._all_excused = False

    def excuse(self, keys: Iterable[Key] | None = None) -> None:
        """Judge these messages (bus, id) no longer, or (None) nothing at all: the test itself disturbs them."""
        self._all_excused |= keys is None
        self._excused.update(keys or ())

    def begin(self) -> None:
        """The manoeuvre begins: judge from now on."""
        self._start_ns = self._newest_ns
        for track in (*self._vehicle.values(), *self._bench.values()):
            track.begin()
        for ticks in self._ticks.values():
            ticks.begin()
        for intake in self._intakes.values():
            intake.begin()
        self._others.clear()

    def hear(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """Take what came until the tick ``now_ns``; frames without a stamp came at it."""
        for item in inbox:
            if isinstance(item, LinkEvent):
                continue
            bus, can_id, data, stamp_ns, extended = item
            tracks = self._vehicle if bus is BusName.VEHICLE else self._bench
            track = tracks.get(can_id)
            if track is None or extended:
                if bus is BusName.BENCH and can_id in _FAULT_COMMANDS and not extended:
                    self.excuse()  # somebody injects faults by hand
                continue
            at_ns = stamp_ns or now_ns
            if at_ns > self._newest_ns:
                self._newest_ns = at_ns
            if track.hear(at_ns, data):
                self._another(track)
            if at_ns != self._last_ns.get(track.node):
                self._follow(track.node, at_ns)
            if tracks is self._bench:
                if can_id in self._ticks:
                    self._ticks[can_id].hear(data)
                elif can_id in self._intakes:
                    self._intakes[can_id].hear(data, at_ns)
        for node, last_ns in self._last_ns.items():
            if self._newest_ns - last_ns > _NODE_TIMEOUT_NS and node not in self._silent:
                self._silent.add(node)
                if self._start_ns is not None:
                    self._tell(f"the {node} is silent since {self._s(last_ns)}")

    def _follow(self, node: str, at_ns: int) -> None:
        """Take a node's sign of life."""
        last_ns = self._last_ns.get(node, at_ns)
        if at_ns - last_ns > _NODE_TIMEOUT_NS:
            self._stalls[node].append((last_ns, at_ns))
        self._last_ns[node] = max(last_ns, at_ns)
        self._silent.discard(node)

    def _another(self, track: Track) -> None:
        if track not in self._others:
            self._tell(f"{_named(track.spec)} comes more often than its cycle allows: somebody else sends it too")
        self._others[track] = self._others.get(track, 0) + 1

    def _tell(self, text: str) -> None:
        if not self._all_excused:
            self._say(f"watch: {text}")

    def _s(self, time_ns: int) -> str:
        return f"{(time_ns - (self._start_ns or 0)) * 1e-9:.3f} s"

    @property
    def others(self) -> list[str]:
        """Messages that somebody else sends too, as far as their cycle times tell."""
        return [_named(track.spec) for track in self._others]

    @property
    def skipped(self) -> tuple[int, int]:
        """Ticks that the nodes skipped and all their ticks since the manoeuvre began, by their own word."""
        skipped, ticks = zip(*(one.skipped for one in self._ticks.values()), strict=True)
        return sum(skipped), sum(ticks)

    def findings(self) -> list[Finding]:
        """What was found since the manoeuvre began, the worst first; nothing where it did not begin."""
        if self._start_ns is None or self._all_excused:
            return []
        found = [*self._silences(), *self._gaps(), *self._skipped(), *self._senders(), *self._reception()]
        return sorted(found, key=lambda finding: -finding.verdict.rank)

    def _judged(self) -> Iterator[Track]:
        for track in (*self._vehicle.values(), *self._bench.values()):
            if track.last_ns >= 0 and (track.spec.bus, track.spec.can_id) not in self._excused:
                yield track

    def _silences(self) -> Iterator[Finding]:
        """Who stopped for good; one finding for what one node stopped at a time."""
        ended: dict[str, list[Track]] = {}
        for track in self._judged():
            if self._newest_ns - track.last_ns > track.timeout_ns:
                ended.setdefault(track.node, []).append(track)
        for node, tracks in ended.items():
            tracks.sort(key=lambda track: track.last_ns)
            listed = ", ".join(f"{track.spec.name} at {self._s(track.last_ns)}" for track in tracks[:3])
            more = f" and {len(tracks) - 3} more" if len(tracks) > 3 else ""
            yield Finding(Verdict.BROKEN, f"messages of the {node} stopped; the last ones: {listed}{more}")

    def _gaps(self) -> Iterator[Finding]:
        """Silence that ended: of whole nodes, and of single messages while their node went on."""
        for node, stalls in self._stalls.items():
            judged = [stall for stall in stalls if stall[1] > (self._start_ns or 0) and not self._excuses(node)]
            if judged:
                (a, b), more = judged[0], f", {len(judged)} times in all" if len(judged) > 1 else ""
                yield Finding(Verdict.INCONCLUSIVE, f"the {node} was silent from {self._s(a)} to {self._s(b)}{more}")
        for track in self._judged():
            stalls = self._stalls[track.node]
            alone = [gap for gap in track.gaps if not any(a < gap[1] and gap[0] < b for a, b in stalls)]
            if alone:
                (a, b), timeout = alone[0], f"time-out {track.timeout_ns * 1e-6:g} ms"
                where = f"from {self._s(a)} to {self._s(b)}"
                yield Finding(
                    Verdict.FAILED, f"{_named(track.spec)} was silent {where} while its node went on, {timeout}"
                )

    def _excuses(self, node: str) -> bool:
        """Whether some message of a node is disturbed by the test."""
        specs = (track.spec for track in (*self._vehicle.values(), *self._bench.values()))
        return any((spec.bus, spec.can_id) in self._excused for spec in specs if _node_of(spec) == node)

    def _skipped(self) -> Iterator[Finding]:
        """Nodes that skipped ticks, by their own word, or else by the worst of their messages."""
        worst: dict[str, tuple[int, int, str]] = {}
        for track in self._judged():
            node, (missed, cycles) = track.node, track.missed
            if missed >= worst.get(node, (0, 0, ""))[0]:
                worst[node] = (missed, cycles, f"cycles of {track.spec.name}")
        for spec, node in _TIMINGS.items():
            skipped, ticks = self._ticks[spec.can_id].skipped
            if ticks:
                worst[node] = (skipped, ticks, "ticks")
        for node, (missed, cycles, of) in worst.items():
            if missed > max(_FEW, MOST_MISSED * cycles):
                yield Finding(
                    Verdict.INCONCLUSIVE, f"the {node} skipped {missed} of {cycles} {of}; {MOST_MISSED:.0%} is allowed"
                )

    def _senders(self) -> Iterator[Finding]:
        for track in self._judged():
            if track in self._others:
                why = "came more often than its cycle allows"
            elif track.jumps >= _JUMPS:
                why = f"came {track.jumps} times with a counter out of sequence"
            else:
                continue
            yield Finding(Verdict.INCONCLUSIVE, f"{_named(track.spec)} {why}: somebody else sends it too")

    def _reception(self) -> Iterator[Finding]:
        if self._excused:  # what is lost by intent cannot be told from what is not
            return
        for spec, node in _RECEPTIONS.items():
            intake = self._intakes[spec.can_id]
            for name, (a, b) in intake.missed.items():
                where = f"from {self._s(a)} to {self._s(b)}"
                yield Finding(Verdict.INCONCLUSIVE, f"{name} was sent, but the {node} took none of it {where}")
            sent = sum(track.count for track in intake.tracks)
            for number, what in zip(intake.lost, ("lost", "corrupt"), strict=True):
                if number > max(_FEW, MOST_MISSED * sent):
                    why = f"{number} of {sent} frames to the {node} were {what}; {MOST_MISSED:.0%} is allowed"
                    yield Finding(Verdict.INCONCLUSIVE, why)


def _node_of(spec: MessageSpec) -> str:
    return _ECU if spec.sender == "ECU" else _PLANT


def _named(spec: MessageSpec) -> str:
    return f"{spec.name} (0x{spec.can_id:X} on the {spec.bus} bus)"
