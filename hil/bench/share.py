"""One process has an adapter; everybody else joins a loopback on which it is shared."""

import contextlib
from collections.abc import Callable

from dbc.frame import BusName, Frame, LinkEvent
from hil.bus.bus import JOINABLE, parse_spec, wait
from hil.bus.channel import resolve, shared_channel
from hil.bus.loopback import LoopbackBus
from hil.bus.transmit import ListeningBus, open_for_role
from hil.errors import BrakebenchError
from hil.rt.process import StopSignal, end_with_parent, say_ready
from hil.rt.realtime import request_punctuality

_TURN_S = 0.05  # how often a stop is looked at


class ShareError(BrakebenchError):
    """Nothing to be shared."""


def serve_share(
    spec: str,
    *,
    transmit: bool = False,
    ready_fd: int | None = None,
    realtime: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> None:
    """Pass frames between an adapter and its loopback until SIGTERM or Ctrl-C.

    Frames keep the time at which the adapter heard them; what happens to its link is told on the loopback, too.

    Parameters
    ----------
    spec : the adapter.
    transmit : send what the others send; else the adapter is only listened to.
    ready_fd, realtime, say : as of `hil.bench.node_process.serve`.

    Raises
    ------
    ShareError : a bus that needs no sharing.
    hil.bus.bus.BusError : the adapter cannot be opened.
    """
    if ready_fd is not None:
        end_with_parent()
    stop = StopSignal()
    spec = resolve(spec)
    if parse_spec(spec).kind in JOINABLE:
        raise ShareError(f"share: {spec}: any number of processes may join it as it is")
    channel = shared_channel(spec)
    sent = heard = 0
    with contextlib.ExitStack() as stack:
        with stop.at_once():
            adapter = stack.enter_context(open_for_role(spec, BusName.VEHICLE, transmit))
            loopback = stack.enter_context(LoopbackBus(channel.partition(":")[2], BusName.VEHICLE))
            say(f"share: {adapter.name} is {channel} for all others")
            if isinstance(adapter, ListeningBus):
                say(f"share: {adapter.words}")
            request_punctuality(realtime, lambda text: say(f"share: {text}"))
            say_ready(ready_fd)
        while not stop.asked:
            wait([adapter, loopback], _TURN_S)
            arrived = adapter.receive(0.0)
            loopback.relay(arrived)
            heard += sum(isinstance(item, Frame) for item in arrived)
            leaving = loopback.receive(0.0)
            for name, items in ((adapter.name, arrived), (channel, leaving)):
                for item in items:
                    if isinstance(item, LinkEvent):
                        say(f"share: {name}: {item.state} ({item.number}) {item.detail}".rstrip())
            out = [item for item in leaving if isinstance(item, Frame)]
            if out:
                adapter.send(out)
                sent += len(out)
    withheld = adapter.withheld if isinstance(adapter, ListeningBus) else 0
    say(f"share: {sent - withheld} frames sent on {adapter.name}, {heard} heard, {withheld} held back")
