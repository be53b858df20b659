"""One node as one process: joins its buses, runs at a fixed rate until told to stop."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from dbc.bench_messages import EcuTiming, PlantTiming
from dbc.exchange import Transmitter
from dbc.frame import Node
from hil.port import Port
from hil.process import StopSignal, say_ready
from hil.rt.clock import WallClock
from hil.rt.loop import Loop, run_node

NODE_PERIOD_NS = 10_000_000


@dataclass(frozen=True, slots=True)
class Role:
    """A place on the buses.

    Attributes
    ----------
    name : as on the command line.
    senders : nodes of the DBC that it plays.
    phase_ns : offset of its ticks, so that each node reads what the other has just sent.
    timing : message that reports its ticks.
    """

    name: str
    senders: tuple[str, ...]
    phase_ns: int
    timing: type[EcuTiming] | type[PlantTiming]


ECU = Role("ecu", ("ECU",), 5_000_000, EcuTiming)
PLANT = Role("plant", ("EHB", "IWM", "BATTERY", "SENSORS", "DRIVER", "PLANT"), 0, PlantTiming)


def serve(
    role: Role,
    make_node: Callable[[], Node],
    bus: str,
    *,
    ready_fd: int | None = None,
    on_joined: Callable[[], None] = lambda: None,
    senders: Iterable[str] | None = None,
) -> None:
    """Run a node on a bus until SIGTERM or Ctrl-C.

    Parameters
    ----------
    make_node : builds the node (and compiles what it needs) before the bus is joined.
    bus : the vehicle bus, as on the command line.
    ready_fd : where to say that the node is about to tick.
    on_joined : called once the buses are joined.
    senders : DBC nodes to play, all of the role's by default.
    """
    stop = StopSignal()
    node = make_node()
    with Port.open(bus, role.senders if senders is None else senders) as port:
        on_joined()
        say_ready(ready_fd)
        health = Transmitter()
        loop = Loop(WallClock(), NODE_PERIOD_NS, role.phase_ns)
        for tick in run_node(node, port, loop):
            timing = role.timing(tick.number & 0xFFFFFF, tick.lateness_ns * 1e-9, loop.overruns)
            port.send(health.frames(tick.now_ns, [timing]))
            if stop.asked:
                return
