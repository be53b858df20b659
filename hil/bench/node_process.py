"""One node as one process: joins its buses, runs at a fixed rate until told to stop."""

import contextlib
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from dbc.bench_messages import EcuTiming, PlantTiming
from dbc.contract import contract
from dbc.exchange import Transmitter
from dbc.frame import BusName, Node
from hil.bench.port import OwnedNode, Port
from hil.bus.channel import resolve
from hil.faults.line import FaultyNode
from hil.rt.clock import WallClock
from hil.rt.loop import Loop, run_node
from hil.rt.process import StopSignal, end_with_parent, say_ready
from hil.rt.realtime import request_realtime, request_timer_slack

NODE_PERIOD_NS = 10_000_000
GRANTED, NOT_GRANTED = "granted", "NOT granted"


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
    realtime: bool = False,
    say: Callable[[str], None] = lambda _: None,
    senders: Iterable[str] | None = None,
) -> None:
    """Run a node on a bus until SIGTERM or Ctrl-C.

    Parameters
    ----------
    make_node : builds the node (and compiles what it needs) before the bus is joined.
    bus : the vehicle bus, as on the command line.
    ready_fd : where to say that the node is about to tick.
    realtime : ask for what makes ticks punctual (`hil.rt.realtime`), and say what was granted.
    say : takes messages for people.
    senders : DBC nodes to play, all of the role's by default; ticks are reported where their sender is one of them.
    """
    if ready_fd is not None:
        end_with_parent()
    stop = StopSignal()
    bus = resolve(bus)
    plays = tuple(role.senders if senders is None else senders)
    with contextlib.ExitStack() as stack:
        with stop.at_once():
            node = FaultyNode(OwnedNode(make_node(), plays), plays, real=True)
            port = stack.enter_context(Port.open(bus))
            say(f"{role.name}: on {bus}, every {NODE_PERIOD_NS / 1e6:g} ms")
            for grant in request_realtime() if realtime else [request_timer_slack()]:
                if realtime or not grant.granted:
                    say(f"{role.name}: {grant.what}: {GRANTED if grant.granted else NOT_GRANTED}, {grant.detail}")
            say_ready(ready_fd)
        health = Transmitter()
        reports = any(spec.type is role.timing for spec in contract(BusName.BENCH).sent_by(*plays))
        loop = Loop(WallClock(), NODE_PERIOD_NS, role.phase_ns)
        for tick in run_node(node, port, loop):
            if reports:
                timing = role.timing(tick.number & 0xFFFFFF, tick.lateness_ns * 1e-9, loop.overruns)
                port.send(health.frames(tick.now_ns, [timing]))
            if stop.asked:
                return


def grants_in(words: Iterable[str]) -> str:
    """What nodes were granted by their own words, in one line: what all of them have, then what is missing and why."""
    said = re.findall(rf"^\w+: (.+): ({GRANTED}|{NOT_GRANTED}), (.+)$", "\n".join(words), re.MULTILINE)
    missing = {what: why for what, how, why in said if how == NOT_GRANTED}
    have = [what for what in dict.fromkeys(what for what, _, _ in said) if what not in missing]
    parts = [f"{', '.join(have)}: {GRANTED}"] if have else []
    return "; ".join([*parts, *(f"{what}: {NOT_GRANTED}, {why}" for what, why in missing.items())])
