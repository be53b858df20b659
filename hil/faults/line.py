"""Between a node and its buses: armed faults act on what it hears and sends, in virtual and in real time."""

from collections.abc import Iterable, Sequence
from typing import Protocol

from dbc.frame import Frame, Node, Received
from hil.faults.act import Act
from hil.faults.catalogue import BY_NUMBER
from hil.faults.fault import FaultError, Injection
from hil.faults.wire import Commands


class Asker(Protocol):
    """Who may arm faults in virtual time."""

    @property
    def injects(self) -> bool:
        """Whether it has armed a fault, or is about to."""
        ...


class FaultLine:
    """The armed faults of one process.

    Parameters
    ----------
    nodes : DBC nodes that the process plays: a fault acts where its target is played.
    real : whether faults of the process are done to this one (killed, stopped, busy).
    """

    def __init__(self, nodes: Iterable[str], real: bool = False) -> None:
        self._nodes = frozenset(nodes)
        self._real = real
        self._commands = Commands()
        self.acts: dict[tuple[int, int, int], Act] = {}

    def take(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """Arm and end what commands of the bench bus say."""
        for start, stop in self._commands.read(inbox):
            if start is not None:
                self.arm(now_ns, start)
            else:
                for key, act in self.acts.items():
                    if stop is None or key == stop:
                        act.stop(now_ns)

    def arm(self, now_ns: int, injection: Injection) -> None:
        """Arm a fault from this tick on where its target is played here; armed again it begins anew."""
        make = BY_NUMBER[injection.kind.number].act
        if make is None or self._nodes.isdisjoint(injection.target.nodes):
            return
        try:
            self.acts[injection.key] = make(injection, now_ns, self._real)
        except FaultError:  # a signal that has no such value: refused where it was asked for
            return

    def step(self, now_ns: int, inbox: list[Received], node: Node) -> list[Frame]:
        """One tick of the node under the armed faults, in the order in which they were armed."""
        acts = list(self.acts.values())
        for act in acts:
            inbox = act.hear(now_ns, inbox)
        runs = [act.runs(now_ns) for act in acts]
        frames = node.step(now_ns, inbox) if all(runs) else []
        for act in acts:
            frames = act.send(now_ns, frames)
        self.acts = {key: act for key, act in self.acts.items() if not act.over(now_ns)}
        return frames


class FaultyNode:
    """A node behind a line of faults; without one it costs a look.

    Parameters
    ----------
    nodes, real : as of `FaultLine`.
    asker : None looks for commands in every inbox; else only where the asker injects.
    """

    def __init__(self, node: Node, nodes: Iterable[str], asker: Asker | None = None, real: bool = False) -> None:
        self._node = node
        self._asker = asker
        self.line = FaultLine(nodes, real)

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Step the node; what it hears and sends meets the armed faults."""
        if self._asker is None or self._asker.injects:
            self.line.take(now_ns, inbox)
            if self.line.acts:
                return self.line.step(now_ns, inbox, self._node)
        return self._node.step(now_ns, inbox)
