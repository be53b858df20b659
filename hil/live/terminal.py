"""The live view on a terminal: listens to both buses and draws; it sends nothing."""

import contextlib
import os
import sys
from collections.abc import Iterator, Mapping

from rich.console import Console, RenderableType
from rich.live import Live

from dbc.frame import BusName
from ecu.law.trouble_codes import CODES
from hil.bus.channel import bench_channel
from hil.bus.open import open_bus
from hil.bus.transmit import open_for_role
from hil.live.feed import Feed
from hil.live.screen import Screen
from hil.log.signals.databases import Databases
from hil.rt.clock import WallClock
from hil.rt.loop import Loop
from hil.rt.process import StopSignal, end_with_parent, say_ready

_TICK_NS = 50_000_000  # the buses' queues are emptied as often
_DRAW_EVERY, _PRINT_EVERY = 5, 20  # ticks: four views a second on a terminal, one elsewhere
_PHASE_NS = 7_500_000  # after all nodes of the bench
_NICENESS = 5  # the nodes of the bench go first where the processor is short
PLAIN_WIDTH = 100  # letters of a line where the output is no terminal
LEAST_WIDTH, LEAST_HEIGHT = 40, 10


def show_view(bus: str, databases: Databases | None, car: Mapping[str, float], ready_fd: int | None = None) -> None:
    """Draw the buses on standard output until Ctrl-C or SIGTERM.

    On a terminal the view takes its screen, and its last state stays behind. Elsewhere a view is printed each second.

    Parameters
    ----------
    bus, databases, car, ready_fd : as of `hil.live.view.serve_view`.

    Raises
    ------
    BrakebenchError : the bus cannot be joined.
    """
    if ready_fd is not None:
        end_with_parent()
    stop = StopSignal()
    with contextlib.suppress(OSError):
        os.nice(_NICENESS)
    with contextlib.ExitStack() as stack:
        with stop.at_once():
            vehicle = stack.enter_context(open_for_role(bus, BusName.VEHICLE, transmit=False))
            bench = stack.enter_context(open_bus(bench_channel(bus), BusName.BENCH))
            say_ready(ready_fd)
        own = databases is None
        feed = Feed(databases or Databases.own(), Databases.own())
        screen = Screen(feed, car if own else None, {c.number: c.name for c in CODES} if own else {}, vehicle.name)
        console = console_of()
        drawing = console.is_terminal and not console.is_dumb_terminal

        def listen() -> None:
            feed.hear([*vehicle.receive(0.0), *bench.receive(0.0)])

        def views() -> Iterator[RenderableType]:
            every = _DRAW_EVERY if drawing else _PRINT_EVERY
            for number, _ in enumerate(Loop(WallClock(), _TICK_NS, _PHASE_NS).ticks(), 1):
                if stop.asked:
                    return
                listen()
                if number % every == 0:
                    yield view()

        def view() -> RenderableType:
            width, height = max(LEAST_WIDTH, console.width), max(LEAST_HEIGHT, console.height)
            return screen.drawn(WallClock().now_ns(), width, height if drawing else None)

        if drawing:
            with Live(console=console, screen=True, auto_refresh=False) as live:
                for one in views():
                    live.update(one, refresh=True)
            listen()
            console.print(view())
        else:
            with contextlib.suppress(BrokenPipeError):
                for one in views():
                    console.print(one)
                    console.print()
                    console.file.flush()


def console_of() -> Console:
    """Console of standard output; of a fixed width where that is no terminal. NO_COLOR is obeyed by the library."""
    live = sys.stdout.isatty()
    return Console(file=sys.stdout, width=None if live else PLAIN_WIDTH, highlight=False, force_jupyter=False)
