"""Between a node and its buses."""

from collections.abc import Iterable, Sequence
from types import TracebackType
from typing import Self

from dbc.contract import contract
from dbc.diagnostic_ids import ANSWERS, FRAME_BYTES
from dbc.frame import BusName, Frame, Node, Received
from hil.bus.bus import Bus
from hil.bus.channel import bench_channel
from hil.bus.open import open_bus

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

    def __init__(self, vehicle: Bus, bench: Bus) -> None:
        self._buses = {BusName.VEHICLE: vehicle, BusName.BENCH: bench}

    @classmethod
    def open(cls, vehicle_spec: str) -> Self:
        """Join a vehicle bus and the bench bus that belongs to it."""
        vehicle = open_bus(vehicle_spec, BusName.VEHICLE)
        try:
            bench = open_bus(bench_channel(vehicle_spec), BusName.BENCH)
        except BaseException:
            vehicle.close()
            raise
        return cls(vehicle, bench)

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
