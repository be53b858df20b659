"""What an armed fault does at its place, tick by tick: the base of all families."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from dbc.contract import MessageSpec, contract
from dbc.frame import BusName, Frame, Received
from hil.faults.fault import Injection

_NEVER_NS = 1 << 62


class Act:
    """One armed fault at work; a step of its node is `hear`, `runs`, `send`.

    Parameters
    ----------
    injection : which, on what, with which numbers and seed.
    armed_ns : tick at which it was armed.
    real : whether the node is a real process; else virtual equivalents act.
    """

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        self.injection = injection
        self.real = real
        self.seed = injection.seed or 0
        self.begin_ns = armed_ns + round(injection.lead_s * 1e9)
        for_s = injection.number("for_s")
        self.end_ns = self.begin_ns + round(for_s * 1e9) if for_s else _NEVER_NS
        self.left = injection.number("count") or math.inf
        self._on_ns = round(injection.number("on_s") * 1e9)
        self._cycle_ns = self._on_ns + round(injection.number("off_s") * 1e9)

    def acts(self, now_ns: int) -> bool:
        """Whether it acts at a tick: within its time, with frames left, not in a pause."""
        if not self.begin_ns <= now_ns < self.end_ns or not self.left > 0:
            return False
        return not self._cycle_ns or (now_ns - self.begin_ns) % self._cycle_ns < self._on_ns

    def over(self, now_ns: int) -> bool:
        """Whether it will never do anything again."""
        return (now_ns >= self.end_ns or not self.left > 0) and not self.holds

    @property
    def holds(self) -> bool:
        """Whether there is something that outlives its time: frames held back, a counter shifted."""
        return False

    def stop(self, now_ns: int) -> None:
        """End it: what it holds back still goes out."""
        self.end_ns = min(self.end_ns, now_ns)

    def hear(self, now_ns: int, inbox: list[Received]) -> list[Received]:
        """What the node gets of its inbox."""
        return inbox

    def runs(self, now_ns: int) -> bool:
        """Whether the node is stepped."""
        return True

    def send(self, now_ns: int, frames: list[Frame]) -> list[Frame]:
        """What goes on the bus of what the node sends."""
        return frames


class FrameAct(Act, ABC):
    """A fault of single frames of the vehicle bus: a subclass says what becomes of one.

    Each identifier has a random stream of its own, fixed by the seed: what befalls one message does not depend on the
    others.
    """

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._random: dict[int, np.random.Generator] = {}
        names = {p.name for p in injection.kind.parameters}
        self._share = injection.number("share") if "share" in names else 1.0

    def random(self, can_id: int) -> np.random.Generator:
        """Random stream of an identifier."""
        if can_id not in self._random:
            self._random[can_id] = np.random.default_rng([self.seed, self.injection.kind.number, can_id])
        return self._random[can_id]

    def send(self, now_ns: int, frames: list[Frame]) -> list[Frame]:
        """Each frame of the target, as the subclass leaves it, in the place of its own."""
        ids, acts = self.injection.target.can_ids, self.acts(now_ns)
        out: list[Frame] = []
        for frame in frames:
            if frame.can_id in ids and frame.bus is BusName.VEHICLE and not frame.extended and _whole(frame):
                out += self._befall(frame, acts and self.left > 0)
            else:
                out.append(frame)
        return out

    def _befall(self, frame: Frame, acts: bool) -> Sequence[Frame]:
        if self._share < 1.0 and self.random(frame.can_id).random() >= self._share:
            acts = False
        if not acts:
            return self.keep(frame)
        self.left -= 1
        return self.alter(frame)

    def keep(self, frame: Frame) -> Sequence[Frame]:
        """Pass a frame that the fault spares; a subclass may remember it."""
        return (frame,)

    @abstractmethod
    def alter(self, frame: Frame) -> Sequence[Frame]:
        """What goes on the bus in the place of a frame."""


def _whole(frame: Frame) -> bool:
    """Whether it is as long as its message: what another fault has cut or made up stays as it is."""
    return len(frame.data) == message_of(frame.can_id).length


def message_of(can_id: int) -> MessageSpec:
    """Contract of a message of the vehicle bus."""
    return contract(BusName.VEHICLE).by_id[can_id]
