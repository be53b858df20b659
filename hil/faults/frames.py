"""Frames that are late, lost, doubled or stale: rows 67 and 68 of the effect catalogue, on every bus."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dbc.frame import BusName, Frame, Node, Received

Id = tuple[BusName, int]


@dataclass(frozen=True, slots=True)
class FrameFaults:
    """What happens to a sender's frames, each share of 0 to 1.

    Attributes
    ----------
    drop : not sent.  duplicate : sent twice.  stale : sent with the bytes of the one before.
    late : held back, for one to ``longest_ticks`` ticks; frames of one identifier never overtake each other.
    can_ids : whose; all of them where empty.
    """

    drop: float = 0.0
    duplicate: float = 0.0
    stale: float = 0.0
    late: float = 0.0
    longest_ticks: int = 2
    can_ids: frozenset[int] = field(default_factory=frozenset)

    def __post_init__(self) -> None:
        for name in ("drop", "duplicate", "stale", "late"):
            share = getattr(self, name)
            if not 0.0 <= share <= 1.0:
                raise ValueError(f"{name}: expected a share from 0 to 1, got {share!r}")
        if self.longest_ticks < 1:
            raise ValueError(f"longest_ticks: expected at least 1, got {self.longest_ticks!r}")


class FrameLine:
    """A sender's way to its bus, with faults; one call is one tick.

    Each identifier has a random stream of its own, fixed by the seed: what befalls one message does not depend on the
    others.
    """

    def __init__(self, faults: FrameFaults, seed: int) -> None:
        self._faults = faults
        self._seed = seed
        self._random: dict[Id, np.random.Generator] = {}
        self._held: dict[Id, deque[tuple[int, Frame]]] = {}
        self._last: dict[Id, bytes] = {}
        self._tick = 0

    def pass_on(self, frames: Sequence[Frame]) -> list[Frame]:
        """Frames that go on the bus at this tick, of those that were sent now and before."""
        self._tick += 1
        out: list[Frame] = []
        for frame in frames:
            if self._faults.can_ids and frame.can_id not in self._faults.can_ids:
                out.append(frame)
                continue
            self._meet(frame)
        for waiting in self._held.values():
            while waiting and waiting[0][0] <= self._tick:
                out.append(waiting.popleft()[1])
        return out

    def _meet(self, frame: Frame) -> None:
        key = frame.bus, frame.can_id
        if key not in self._random:
            self._random[key] = np.random.default_rng([self._seed, frame.can_id, list(BusName).index(frame.bus)])
            self._held[key] = deque()
        drop, duplicate, stale, late, ticks = self._random[key].random(5)
        faults, waiting = self._faults, self._held[key]
        if stale < faults.stale:
            frame = frame._replace(data=self._last.get(key, frame.data))
        self._last[key] = frame.data
        if drop < faults.drop:
            return
        due = self._tick
        if late < faults.late:
            due += 1 + int(ticks * faults.longest_ticks)
        if waiting:
            due = max(due, waiting[-1][0])
        waiting.extend([(due, frame)] * (2 if duplicate < faults.duplicate else 1))


class FaultyNode:
    """A node whose frames meet faults, for runs in virtual time."""

    def __init__(self, node: Node, faults: FrameFaults, seed: int) -> None:
        self._node = node
        self._line = FrameLine(faults, seed)

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Step the node; what it sends meets the faults."""
        return self._line.pass_on(self._node.step(now_ns, inbox))
