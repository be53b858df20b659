"""Gateway and rest-bus as processes: real buses, a tick of a millisecond, until a signal stops them."""

import contextlib
import os
import select
import sys
from collections.abc import Callable, Iterator, Mapping

from dbc.frame import BusName, Frame, LinkEvent, Received
from hil.bus.bus import Bus
from hil.bus.channel import resolve
from hil.bus.listen import refuse_others
from hil.bus.transmit import ListeningBus, open_for_role
from hil.gateway.error import GatewayError
from hil.gateway.gateway import OurSide, TheirSide
from hil.gateway.map import GatewayMap
from hil.gateway.restbus import RestBus
from hil.rt.clock import WallClock
from hil.rt.loop import Loop
from hil.rt.process import StopSignal
from hil.rt.realtime import request_punctuality

PERIOD_NS = 1_000_000
"""Of the ticks: cycle times of a database are whole milliseconds."""
_MOST_LINE = 4096  # letters of a line on standard input

_TOO = "{}: somebody else sends it, too"

Say = Callable[[str], None]


def serve_gateway(
    gateway_map: GatewayMap,
    ours: str,
    theirs: str,
    realtime: bool,
    say: Say,
    transmit: bool = False,
    force: bool = False,
) -> None:
    """Run a gateway between two buses until SIGTERM or Ctrl-C.

    Parameters
    ----------
    transmit : send on buses with hardware; else these are only listened to.
    force : send although somebody already sends the same messages.

    Raises
    ------
    GatewayError : both are one bus.
    hil.bus.bus.BusError : one cannot be opened, or somebody already sends what the gateway would send.
    """
    ours, theirs = resolve(ours), resolve(theirs)
    if ours == theirs:
        raise GatewayError(f"gateway: our bus and theirs are both {ours}; expected two")
    stop = StopSignal()
    with contextlib.ExitStack() as stack:
        with stop.at_once():
            our_bus = stack.enter_context(_open(ours, transmit, say))
            their_bus = stack.enter_context(_open(theirs, transmit, say))
        their_side, our_side = TheirSide(gateway_map, say), OurSide(gateway_map, say)
        if not force:
            _refuse_others(our_bus, our_side.names, stop, "this gateway")
            _refuse_others(their_bus, their_side.names, stop, "this gateway")
            our_bus.receive(0.0)  # it has aged meanwhile
        loop = _loop(realtime, say)
        say(f"{gateway_map.path.name}: ours on {ours}, theirs on {theirs}")
        others = set[str]()
        for tick in loop.ticks():
            from_ours, from_theirs = _received(our_bus, say), _received(their_bus, say)
            their_bus.send(their_side.step(tick.now_ns, from_ours))
            our_bus.send(our_side.step(tick.now_ns, from_theirs))
            heard = _named(our_bus, from_ours, our_side.names) | _named(their_bus, from_theirs, their_side.names)
            for name in heard - others:
                others.add(name)
                say(_TOO.format(name))
            if stop.asked:
                break
        say(
            f"{_sent(their_side.sent, their_bus)} on {theirs}, {_sent(our_side.sent, our_bus)} on {ours}; "
            f"{our_side.rejected} of theirs "
            f"rejected; {loop.overruns} ticks of {PERIOD_NS / 1e6:g} ms skipped"
        )


def serve_restbus(
    restbus: RestBus, spec: str, realtime: bool, say: Say, transmit: bool = False, force: bool = False
) -> None:
    """Run a rest-bus until SIGTERM or Ctrl-C; lines on standard input are edits. The rest as of `serve_gateway`."""
    spec = resolve(spec)
    stop = StopSignal()
    with contextlib.ExitStack() as stack:
        with stop.at_once():
            bus = stack.enter_context(_open(spec, transmit, say))
        if not force:
            _refuse_others(bus, restbus.names, stop, "this rest-bus")
        lines = Lines(sys.stdin.fileno()) if sys.stdin is not None else None
        loop = _loop(realtime, say)
        others = set[str]()
        say(f"on {spec}; a line MESSAGE.SIGNAL=VALUE, MESSAGE=off or MESSAGE=on edits it")
        for tick in loop.ticks():
            for line in lines.read() if lines is not None else ():
                try:
                    say(restbus.edit(line))
                except GatewayError as error:
                    say(str(error))
            received = _received(bus, say)
            bus.send(restbus.step(tick.now_ns, received))
            for name in _named(bus, received, restbus.names) - others:
                others.add(name)
                say(_TOO.format(name))
            if stop.asked:
                break
        say(f"{_sent(restbus.sent, bus)} on {spec}; {loop.overruns} ticks of {PERIOD_NS / 1e6:g} ms skipped")


def _open(spec: str, transmit: bool, say: Say) -> Bus | ListeningBus:
    bus = open_for_role(spec, BusName.VEHICLE, transmit)
    if isinstance(bus, ListeningBus):
        say(bus.words)
    return bus


def _sent(count: int, bus: Bus | ListeningBus) -> str:
    return f"{count} frames sent" if not isinstance(bus, ListeningBus) else f"0 frames sent, {count} held back"


def _refuse_others(bus: Bus | ListeningBus, names: Mapping[tuple[int, bool], str], stop: StopSignal, who: str) -> None:
    if not isinstance(bus, ListeningBus):
        ours = {
            (BusName.VEHICLE, can_id, extended): f"0x{can_id:X} {name}" for (can_id, extended), name in names.items()
        }
        refuse_others([bus], ours, lambda: stop.asked, who, "send nevertheless with --force")


def _loop(realtime: bool, say: Say) -> Loop:
    request_punctuality(realtime, say)
    return Loop(WallClock(), PERIOD_NS)


def _named(bus: Bus | ListeningBus, received: list[Received], names: Mapping[tuple[int, bool], str]) -> set[str]:
    """Messages of ours, by identifier and extended, that somebody else has sent; none where we only listen."""
    if isinstance(bus, ListeningBus):
        return set()
    return {names[i.can_id, i.extended] for i in received if isinstance(i, Frame) and (i.can_id, i.extended) in names}


def _received(bus: Bus | ListeningBus, say: Say) -> list[Received]:
    heard = bus.receive(0.0)
    for item in heard:
        if isinstance(item, LinkEvent):
            say(f"{bus.name}: {item.state.value} ({item.number}) {item.detail}".rstrip())
    return heard


class Lines:
    """Lines of a file descriptor as they come, without waiting; not from a terminal in whose background we are."""

    def __init__(self, fileno: int) -> None:
        self._fileno: int | None = fileno
        self._rest = b""

    def read(self) -> Iterator[str]:
        """Whole lines that have come."""
        if self._fileno is None or not select.select([self._fileno], [], [], 0.0)[0]:
            return
        if os.isatty(self._fileno) and os.tcgetpgrp(self._fileno) != os.getpgrp():
            return
        came = os.read(self._fileno, _MOST_LINE)
        if not came:
            self._fileno = None
        *lines, self._rest = (self._rest + came).split(b"\n")
        self._rest = self._rest[:_MOST_LINE]
        if not came and self._rest:
            lines, self._rest = [*lines, self._rest], b""
        for line in lines:
            text = line.decode(errors="replace").strip()
            if text:
                yield text
