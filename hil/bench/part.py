"""A plant that plays a part of the car: the rest is on the bus, real or somebody else's."""

from collections.abc import Callable, Iterable, Sequence

from dbc.contract import contract
from dbc.frame import BusName, Frame, Node, Received
from hil.bench.port import Owned, owned_by
from hil.errors import BrakebenchError
from plant.external_nodes import FRAMES_OF
from plant.node import SENDERS

SENSORS = "SENSORS"
"""The node that goes with the car's body: who plays it tells the bench the truth."""
_TRUTH = "PLANT"
_SILENT_NS = 1_000_000_000  # ten cycles of the slowest message, before somebody is told


class PartError(BrakebenchError):
    """A part of the car that cannot be played."""


class Part:
    """What is played, and what is read instead.

    Parameters
    ----------
    play : nodes of brake.dbc, in any case; empty: all.
    leave : messages of those nodes that somebody else sends, such as BODY_MOTION of a real IMU.

    Attributes
    ----------
    nodes : of brake.dbc.
    senders : nodes of both databases, for `hil.bench.node_process.serve`.
    left : names of the messages left to others.
    reads : names of the messages that enter the model, by the node that sends them.

    Raises
    ------
    PartError : unknown node or message, or a message whose node the model would have to read.
    """

    def __init__(self, play: Iterable[str] = (), leave: Iterable[str] = ()) -> None:
        chosen = {name.strip().upper() for name in play} or set(SENDERS)
        if not chosen <= SENDERS:
            unknown = ", ".join(sorted(chosen - SENDERS))
            raise PartError(f"--play: {unknown}: no node of the car; expected some of {', '.join(sorted(SENDERS))}")
        self.nodes = frozenset(chosen)
        self.senders = (*sorted(chosen), *((_TRUTH,) if SENSORS in chosen else ()))
        free = {spec.name: spec.can_id for spec in contract(BusName.VEHICLE).sent_by(*chosen - FRAMES_OF.keys())}
        self.left = tuple(dict.fromkeys(name.strip().upper() for name in leave))
        for name in self.left:
            if name not in free:
                raise PartError(
                    f"--leave: {name}: expected a played message that the model does not read back, some of "
                    f"{', '.join(free) or 'none'}; what it reads is left by its node, with --play"
                )
        self._left_ids = frozenset(free[name] for name in self.left)
        self.reads = {
            node: tuple(spec.name for spec in contract(BusName.VEHICLE).sent_by(node))
            for node in FRAMES_OF
            if node not in chosen
        }

    @property
    def whole(self) -> bool:
        """Whether all of the car is played."""
        return self.nodes == SENDERS and not self.left

    def owned(self) -> Owned:
        """Lengths of the frames that this part sends, by bus and identifier."""
        left = {(BusName.VEHICLE, can_id) for can_id in self._left_ids}
        return {key: length for key, length in owned_by(self.senders).items() if key not in left}

    def sent(self, frames: Sequence[Frame]) -> list[Frame]:
        """The frames that are this part's to send."""
        if self.whole:
            return list(frames)
        tells = SENSORS in self.nodes
        return [f for f in frames if (f.can_id not in self._left_ids if f.bus is BusName.VEHICLE else tells)]

    def __str__(self) -> str:
        """For people."""
        text = f"plays {', '.join(sorted(self.nodes))}"
        text += f" without {', '.join(self.left)}" if self.left else ""
        reads = "; ".join(f"{', '.join(names)} of {node}" for node, names in self.reads.items())
        return text + (f"; reads {reads} from the bus" if reads else "")


class PartOfPlant:
    """The plant node behind a part.

    Parameters
    ----------
    say : takes, for people, what of the rest has not come, and when it comes.
    """

    def __init__(self, node: Node, part: Part, say: Callable[[str], None] = lambda _: None) -> None:
        self._node = node
        self._part = part
        self._say = say
        names = [name for names in part.reads.values() for name in names]
        self._awaited = {
            spec.can_id: spec.name for spec in contract(BusName.VEHICLE).by_id.values() if spec.name in names
        }
        self._last_ns: dict[int, int] = {}
        self._silent: set[int] = set()

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Step the node; send what is the part's."""
        if self._awaited:
            self._look(now_ns, inbox)
        return self._part.sent(self._node.step(now_ns, inbox))

    def _look(self, now_ns: int, inbox: Sequence[Received]) -> None:
        for item in inbox:
            if isinstance(item, Frame) and item.bus is BusName.VEHICLE and item.can_id in self._awaited:
                self._last_ns[item.can_id] = now_ns
        for can_id, name in self._awaited.items():
            silent = now_ns - self._last_ns.setdefault(can_id, now_ns) > _SILENT_NS
            if silent != (can_id in self._silent):
                (self._silent.add if silent else self._silent.discard)(can_id)
                self._say(f"{name} does not come: start what sends it" if silent else f"{name} comes")
