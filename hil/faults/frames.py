"""Frames that are late, lost, doubled or stale: rows 67 and 68 of the effect catalogue, on every bus."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dbc.bench_messages import ManoeuvreState, TruthMotion
from dbc.exchange import Receiver
from dbc.frame import BusName, Frame, Node, Received


@dataclass(frozen=True, slots=True)
class FrameFaults:
    """What happens to frames of the vehicle bus on their way from their sender, each share of 0 to 1.

    Attributes
    ----------
    drop : not sent.  duplicate : sent twice.  stale : sent with the bytes of the one before.
    late : held back, for one to ``longest_ticks`` ticks; frames of one identifier never overtake each other.
    can_ids : whose; all of them where empty.
    from_s, until_s : on the manoeuvre's clock; before its start the time is minus infinity.
    """

    drop: float = 0.0
    duplicate: float = 0.0
    stale: float = 0.0
    late: float = 0.0
    longest_ticks: int = 2
    can_ids: frozenset[int] = field(default_factory=frozenset)
    from_s: float = -math.inf
    until_s: float = math.inf

    def __post_init__(self) -> None:
        for name in ("drop", "duplicate", "stale", "late"):
            share = getattr(self, name)
            if not 0.0 <= share <= 1.0:
                raise ValueError(f"{name}: expected a share from 0 to 1, got {share!r}")
        if self.longest_ticks < 1:
            raise ValueError(f"longest_ticks: expected at least 1, got {self.longest_ticks!r}")


class FrameLine:
    """A sender's way to its bus, with faults; one call is one tick.

    Each identifier has a random stream of its own, fixed by the seed: what befalls one message depends neither on the
    others nor on when the faults begin.
    """

    def __init__(self, faults: FrameFaults, seed: int) -> None:
        self._faults = faults
        self._seed = seed
        self._random: dict[int, np.random.Generator] = {}
        self._held: dict[int, deque[tuple[int, Frame]]] = {}
        self._last: dict[int, bytes] = {}
        self._tick = 0

    def pass_on(self, frames: Sequence[Frame], time_s: float = 0.0) -> list[Frame]:
        """Frames that go on the bus at this tick, of those that were sent now and before; ``time_s`` as of faults."""
        self._tick += 1
        acts = self._faults.from_s <= time_s < self._faults.until_s
        out: list[Frame] = []
        for frame in frames:
            if frame.bus is BusName.VEHICLE and (not self._faults.can_ids or frame.can_id in self._faults.can_ids):
                self._meet(frame, acts)
            else:
                out.append(frame)
        for waiting in self._held.values():
            while waiting and waiting[0][0] <= self._tick:
                out.append(waiting.popleft()[1])
        return out

    def _meet(self, frame: Frame, acts: bool) -> None:
        key = frame.can_id
        if key not in self._random:
            self._random[key] = np.random.default_rng([self._seed, key])
            self._held[key] = deque()
        drop, duplicate, stale, late, ticks = self._random[key].random(5)
        faults, waiting = self._faults, self._held[key]
        if acts and stale < faults.stale:
            frame = frame._replace(data=self._last.get(key, frame.data))
        self._last[key] = frame.data
        if acts and drop < faults.drop:
            return
        due = self._tick
        if acts and late < faults.late:
            due += 1 + int(ticks * faults.longest_ticks)
        if waiting:
            due = max(due, waiting[-1][0])
        waiting.extend([(due, frame)] * (2 if acts and duplicate < faults.duplicate else 1))


class FaultyNode:
    """A node whose frames meet faults, in real and in virtual time."""

    def __init__(self, node: Node, faults: Sequence[FrameFaults], seed: int) -> None:
        self._node = node
        self._lines = [FrameLine(one, seed + 1000 * number) for number, one in enumerate(faults)]
        self._motion = Receiver((TruthMotion,))
        self._start_ns: int | None = None

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Step the node; what it sends meets the faults."""
        frames = self._node.step(now_ns, inbox)
        time_s = self._time_s(now_ns, [*inbox, *frames])
        for line in self._lines:
            frames = line.pass_on(frames, time_s)
        return frames

    def _time_s(self, now_ns: int, heard: Sequence[Received]) -> float:
        """Time since the plant, this node or another one, first said that its manoeuvre runs."""
        if self._start_ns is None:
            self._motion.accept(now_ns, heard)
            motion = self._motion.latest(TruthMotion)
            if motion is None or motion.manoeuvre is ManoeuvreState.HOLDING:
                return -math.inf
            self._start_ns = now_ns
        return (now_ns - self._start_ns) * 1e-9


def on_faulty_line(node: Node, faults: Sequence[FrameFaults], seed: int) -> Node:
    """The node, behind a line with faults where there are any."""
    return FaultyNode(node, faults, seed) if faults else node
