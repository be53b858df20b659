"""Between a node and its buses: armed faults act on what it hears and sends, in virtual and in real time."""

from collections.abc import Iterable, Sequence
from typing import Protocol

from dbc.frame import Frame, Node, Received
from hil.faults.act import Act
from hil.faults.catalogue import BY_NUMBER
from hil.faults.fault import Injection
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
        self.acts[injection.key] = make(injection, now_ns, self._real)

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


class Source(Protocol):
    """What is listened to."""

    def receive(self, timeout_s: float) -> list[Received]:
        """Return what arrived since the last call."""
        ...


class FaultyListener:
    """A bus that is only listened to, by a process that faults befall: the recorder's bench bus."""

    def __init__(self, bus: Source, nodes: Iterable[str]) -> None:
        self._bus = bus
        self._line = FaultLine(nodes, real=True)

    def receive(self, timeout_s: float) -> list[Received]:
        """What arrived; commands among it act at once."""
        heard = self._bus.receive(timeout_s)
        self._line.take(0, heard)
        for key in list(self._line.acts):
            self._line.acts.pop(key).hear(0, [])
        return heard
