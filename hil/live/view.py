"""The viewer: listens to both buses, tells the pages what it hears, and carries out what they ask."""

import contextlib
import json
import os
from collections.abc import Callable
from queue import Empty, Full, Queue
from typing import Any

from dbc.frame import BusName
from ecu.law.trouble_codes import CODES
from hil.bus.channel import bench_channel
from hil.bus.open import open_bus
from hil.bus.transmit import open_for_role
from hil.errors import BrakebenchError
from hil.live.controls import Controls, described
from hil.live.feed import Feed
from hil.live.mailbox import Mailbox
from hil.live.server import Server
from hil.log.signals.databases import Databases
from hil.rt.clock import WallClock
from hil.rt.loop import Loop
from hil.rt.process import StopSignal, end_with_parent, say_ready

TICK_NS = 10_000_000  # a stimulus is due as often
_NEWS_EVERY, _STATE_EVERY = 3, 25  # ticks: some 30 and 4 messages a second to each page
_PHASE_NS = 7_500_000  # after all nodes of the bench
_MOST_ASKED = 64  # commands that wait for the next tick
_NICENESS = 5  # the nodes of the bench go first where the processor is short

Asked = tuple[dict[str, Any], Mailbox]


def serve_view(
    bus: str,
    databases: Databases | None,
    car: dict[str, float],
    *,
    port: int = 0,
    ready_fd: int | None = None,
    wait_ns: int = 0,
    say: Callable[[str], None] = lambda _: None,
) -> None:
    """Serve the page until Ctrl-C or SIGTERM.

    Parameters
    ----------
    bus : the vehicle bus, as on the command line; nothing is ever sent on it.
    databases : of the vehicle bus; None for our own.
    car : numbers that the page needs beside the signals: ``wheel_radius_m``, ``torque_constant_nm_a``.
    port : of the page; 0 for any that is free.
    ready_fd : where to say that the page is served.
    wait_ns : how long to wait for somebody to open the page before that, ns.
    say : takes the page's address, and what is odd.

    Raises
    ------
    BrakebenchError : the bus cannot be joined, the port is taken.
    """
    if ready_fd is not None:
        end_with_parent()
    stop = StopSignal()
    with contextlib.suppress(OSError):
        os.nice(_NICENESS)
    with contextlib.ExitStack() as stack:
        with stop.at_once():
            vehicle = stack.enter_context(open_for_role(bus, BusName.VEHICLE, transmit=False, optional=False))
            bench = stack.enter_context(open_bus(bench_channel(bus), BusName.BENCH))
        feed = Feed(databases or Databases.own(), Databases.own())
        controls = Controls()
        asked: Queue[Asked] = Queue(_MOST_ASKED)
        codes = {code.number: [code.name, code.text] for code in CODES} if databases is None else {}
        hello = {
            "kind": "hello",
            "bus": vehicle.name,
            "own": databases is None,
            "car": car,
            "codes": codes,
        } | described()

        def greet() -> str:
            return json.dumps(hello | {"messages": feed.described()})

        def take(text: str, mailbox: Mailbox) -> None:
            try:
                wish = json.loads(text)
                if not isinstance(wish, dict):
                    raise ValueError("no object")
                if wish.get("do") == "hello":  # it has missed what a message is called
                    mailbox.put(greet())
                else:
                    asked.put_nowait((wish, mailbox))
            except (ValueError, RecursionError) as error:
                mailbox.put(_said(f"not a command: {error}", wrong=True))
            except Full:
                mailbox.put(_said("too many commands at once; this one was dropped", wrong=True))

        server = Server(greet, take, port)
        stack.callback(server.close)
        say(server.url)
        with stop.at_once():
            _wait_for_page(server, wait_ns)
            say_ready(ready_fd)
        for tick in Loop(WallClock(), TICK_NS, _PHASE_NS).ticks():
            if stop.asked:
                break
            clock_ns = WallClock().now_ns()
            received = [*vehicle.receive(0.0), *bench.receive(0.0)]
            controls.hear(tick.now_ns, received)
            feed.hear(received)
            _carry_out(tick.now_ns, controls, asked, server)
            frames = controls.frames()
            if frames:
                bench.send(frames)
                feed.hear([frame._replace(time_ns=clock_ns) for frame in frames])  # a bus does not tell us our own
            if tick.number % _NEWS_EVERY == 0 and (news := feed.news()) is not None:
                server.send(news)
            if tick.number % _STATE_EVERY == 0:
                more = {"values": controls.values, "armed": controls.armed, "dropped": server.dropped}
                server.send(feed.state(clock_ns, more))
        server.send(json.dumps({"kind": "end"}))


def _wait_for_page(server: Server, wait_ns: int) -> None:
    clock = WallClock()
    deadline_ns = clock.now_ns() + wait_ns
    while not server.pages and clock.now_ns() < deadline_ns:
        clock.sleep_until(clock.now_ns() + TICK_NS)


def _carry_out(now_ns: int, controls: Controls, asked: "Queue[Asked]", server: Server) -> None:
    """Carry out what waits; all pages are told what was done, only the one that asked what was refused."""
    with contextlib.suppress(Empty):
        while True:
            wish, mailbox = asked.get_nowait()
            try:
                server.send(_said(controls.command(now_ns, wish)))
            except BrakebenchError as error:
                mailbox.put(_said(str(error), wrong=True))


def _said(text: str, wrong: bool = False) -> str:
    return json.dumps({"kind": "said", "text": text, "wrong": wrong})
