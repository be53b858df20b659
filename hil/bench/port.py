"""Between a node and its buses."""

from collections.abc import Callable, Iterable, Sequence
from types import TracebackType
from typing import Self

from dbc.contract import contract
from dbc.diagnostic_ids import ANSWERS, FRAME_BYTES
from dbc.frame import BusName, Frame, Node, Received
from hil.bus.bus import Bus
from hil.bus.channel import bench_channel
from hil.bus.listen import Key, refuse_others
from hil.bus.open import open_bus
from hil.bus.transmit import ListeningBus, open_for_role

Owned = dict[tuple[BusName, int], int]


def owned_by(senders: Iterable[str]) -> Owned:
    """Lengths of the frames that DBC nodes may send, by bus and identifier; the controller answers testers, too."""
    plays = tuple(senders)
    owned = {(bus, spec.can_id): spec.length for bus in BusName for spec in contract(bus).sent_by(*plays)}
    if "ECU" in plays:
        owned |= {(BusName.VEHICLE, can_id): FRAME_BYTES for can_id in ANSWERS}
    return owned


def check_owned(frames: Sequence[Frame], owned: Owned) -> None:
    """Refuse (ValueError) a frame whose identifier or length a role does not own: a mistake of the node."""
    for frame in frames:
        if frame.extended or owned.get((frame.bus, frame.can_id)) != len(frame.data):
            raise ValueError(
                f"{frame.bus} bus: frame 0x{frame.can_id:X} with {len(frame.data)} bytes is not this role's to send; "
                "its identifiers and lengths are those of its senders in the DBC"
            )


def names_of(owned: Owned) -> dict[Key, str]:
    """Identifiers with message and sender for people, as `hil.bus.listen.refuse_others` takes them."""
    return {(bus, can_id, False): f"0x{can_id:X} {_name(bus, can_id)}" for bus, can_id in owned}


def _name(bus: BusName, can_id: int) -> str:
    spec = contract(bus).by_id.get(can_id)
    return "of a controller's diagnostics" if spec is None else f"{spec.name} of {spec.sender}"


class OwnedNode:
    """A node that may send what its role owns in the DBC, and nothing else; faults act behind it."""

    def __init__(self, node: Node, senders: Iterable[str]) -> None:
        self._node = node
        self._owned = owned_by(senders)

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Step the node; ValueError where it sends what is not its own: a mistake of the node."""
        frames = self._node.step(now_ns, inbox)
        check_owned(frames, self._owned)
        return frames


class Port:
    """Joins a node to the vehicle bus and the bench bus.

    Parameters
    ----------
    vehicle, bench : the two buses, open; the port closes them.
    """

    def __init__(self, vehicle: "Bus | ListeningBus", bench: Bus) -> None:
        self._buses: dict[BusName, Bus | ListeningBus] = {BusName.VEHICLE: vehicle, BusName.BENCH: bench}

    @classmethod
    def open(cls, vehicle_spec: str, transmit: bool = False) -> Self:
        """Join a vehicle bus and the bench bus that belongs to it; hardware is sent to with ``transmit`` only."""
        vehicle = open_for_role(vehicle_spec, BusName.VEHICLE, transmit)
        try:
            bench = open_bus(bench_channel(vehicle_spec), BusName.BENCH)
        except BaseException:
            vehicle.close()
            raise
        return cls(vehicle, bench)

    @property
    def listening(self) -> ListeningBus | None:
        """The vehicle bus where nothing is sent to it."""
        vehicle = self._buses[BusName.VEHICLE]
        return vehicle if isinstance(vehicle, ListeningBus) else None

    def refuse_others(self, owned: Owned, stopped: Callable[[], bool], who: str, instead: str) -> None:
        """Listen before the first frame, as `hil.bus.listen.refuse_others`, for who sends what is ours."""
        refuse_others(tuple(self._buses.values()), names_of(owned), stopped, who, instead)

    def receive(self) -> list[Received]:
        """Everything that arrived since the last call: the vehicle bus first, each bus in its order."""
        return self._buses[BusName.VEHICLE].receive(0.0) + self._buses[BusName.BENCH].receive(0.0)

    def send(self, frames: Sequence[Frame]) -> None:
        """Send the frames of one tick."""
        for bus, out in self._buses.items():
            mine = [frame for frame in frames if frame.bus is bus]
            if mine:
                out.send(mine)

    def close(self) -> None:
        """Leave both buses."""
        for bus in self._buses.values():
            bus.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
