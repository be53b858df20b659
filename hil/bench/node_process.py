"""One node as one process: joins its buses, runs at a fixed rate until told to stop."""

import contextlib
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from dbc.bench_messages import EcuTiming, PlantTiming
from dbc.contract import contract
from dbc.exchange import Transmitter
from dbc.frame import BusName, Frame, Node
from hil.bench.port import Owned, OwnedNode, Port, owned_by
from hil.bus.channel import resolve
from hil.faults.line import FaultyNode
from hil.rt.clock import WallClock
from hil.rt.loop import Loop, run_node
from hil.rt.process import StopSignal, end_with_parent, say_ready
from hil.rt.realtime import GRANTED, NOT_GRANTED, request_punctuality

NODE_PERIOD_NS = 10_000_000


@runtime_checkable
class Leaving(Protocol):
    """A node that has something to say before it goes."""

    def farewell(self, now_ns: int) -> list[Frame]:
        """Return the frames of the safe state, as the last ones of the node."""
        ...


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
    sends: Owned | None = None,
    transmit: bool = False,
    force: bool = False,
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
    sends : what it sends, where that is less than all of ``senders``.
    transmit : send on a bus with hardware; else that is only listened to.
    force : send although somebody already sends the same messages.

    A node that somebody starts by hand listens before it sends. One with a method ``farewell`` has the last word, a
    period after its last tick, however it ends; only a kill leaves the other side to its own time-outs.

    Raises
    ------
    hil.bus.bus.BusError : the bus cannot be opened, or somebody already plays the role.
    """
    if ready_fd is not None:
        end_with_parent()
    stop = StopSignal()
    bus = resolve(bus)
    plays = tuple(role.senders if senders is None else senders)
    with contextlib.ExitStack() as stack:
        with stop.at_once():
            made = make_node()
            node = FaultyNode(OwnedNode(made, plays), plays, real=True)
            port = stack.enter_context(Port.open(bus, transmit))
            silent = port.listening
            if silent is not None:
                say(f"{role.name}: {silent.words}")
            elif ready_fd is None and not force:  # a bench has listened for all whom it starts
                owned = owned_by(plays) if sends is None else sends
                port.refuse_others(owned, lambda: stop.asked, f"this {role.name}", "send nevertheless with --force")
            say(f"{role.name}: on {bus}, every {NODE_PERIOD_NS / 1e6:g} ms")
            request_punctuality(realtime, lambda text: say(f"{role.name}: {text}"))
            say_ready(ready_fd)
        health = Transmitter()
        reports = any(spec.type is role.timing for spec in contract(BusName.BENCH).sent_by(*plays))
        loop = Loop(WallClock(), NODE_PERIOD_NS, role.phase_ns)
        now_ns = 0
        try:
            for tick in run_node(node, port, loop):
                now_ns = tick.now_ns
                if reports:
                    timing = role.timing(tick.number & 0xFFFFFF, tick.lateness_ns * 1e-9, loop.overruns)
                    port.send(health.frames(now_ns, [timing]))
                if stop.asked:
                    break
        finally:
            if isinstance(made, Leaving):
                clock = WallClock()
                clock.sleep_until(clock.now_ns() + NODE_PERIOD_NS)  # not sooner than its cycle allows
                port.send(made.farewell(now_ns + NODE_PERIOD_NS))
        if silent is not None:
            say(f"{role.name}: nothing was sent on {bus}; {silent.withheld} frames would have been")


def grants_in(words: Iterable[str]) -> str:
    """What nodes were granted by their own words, in one line: what all of them have, then what is missing and why."""
    said = re.findall(rf"^\w+: (.+): ({GRANTED}|{NOT_GRANTED}), (.+)$", "\n".join(words), re.MULTILINE)
    missing = {what: why for what, how, why in said if how == NOT_GRANTED}
    have = [what for what in dict.fromkeys(what for what, _, _ in said) if what not in missing]
    parts = [f"{', '.join(have)}: {GRANTED}"] if have else []
    return "; ".join([*parts, *(f"{what}: {NOT_GRANTED}, {why}" for what, why in missing.items())])
