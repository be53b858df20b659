"""Nodes in virtual time: stepped in order of their deadlines in one process, frames handed over between them."""

import heapq
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from dbc.frame import Frame, Node, Received

_new = tuple.__new__  # without the Python-made __new__ of a NamedTuple, three times a tick


class Member(NamedTuple):
    """A node and when it ticks: ``phase_ns + k * period_ns``."""

    node: Node
    period_ns: int
    phase_ns: int = 0


class Step(NamedTuple):
    """One tick of one node: when, which, and what it sent."""

    now_ns: int
    member: int
    frames: list[Frame]

    def stamped(self) -> list[Frame]:
        """Its frames with the tick's time, as a recorder wants them; nodes do without."""
        return [Frame(frame.bus, frame.can_id, frame.data, self.now_ns, frame.extended) for frame in self.frames]


def lockstep(members: Sequence[Member]) -> Iterator[Step]:
    """Step the members for ever; the caller ends it by leaving the iteration.

    What a node sends reaches every other member's next tick that is later than its own, never its own inbox: as on a
    bus with a short delay. Members due at the same instant do not see each other's frames of that instant. The same
    members give the same frames, bit for bit.
    """
    inboxes: list[list[Received]] = [[] for _ in members]
    others = [[k for k in range(len(members)) if k != index] for index in range(len(members))]
    due = [(member.phase_ns, index) for index, member in enumerate(members)]
    heapq.heapify(due)
    while due:
        now_ns = due[0][0]
        sent: list[Step] = []
        while due[0][0] == now_ns:
            index = due[0][1]
            node, period_ns, _ = members[index]
            heapq.heapreplace(due, (now_ns + period_ns, index))
            inbox, inboxes[index] = inboxes[index], []
            sent.append(_new(Step, (now_ns, index, node.step(now_ns, inbox))))
        for step in sent:
            frames = step[2]
            for index in others[step[1]]:
                inboxes[index] += frames
            yield step
