"""``brakebench inject``: a fault of the library, by hand, on a bench that runs."""

import argparse
import math
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from hil.cli.columns import listing, say, terminal_width
from hil.cli.options import add_bus, seed
from hil.errors import BrakebenchError

if TYPE_CHECKING:
    from dbc.contract import Message
    from hil.faults.fault import Injection

_LISTEN_S = 1.0  # nodes tell of themselves on the bench bus a hundred times a second


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("inject")
    parser.add_argument("fault", nargs="?", metavar="NAME", help="the fault; left out: list all of them")
    parser.add_argument("--on", metavar="TARGET", help="MESSAGE, MESSAGE.SIGNAL, node, ALL, or wheels (fl,rr; front)")
    parser.add_argument("--for", dest="for_s", type=float, metavar="S", help="how long (default: for good)")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter of the fault, SI")
    parser.add_argument("--seed", type=seed, default=1, help="seed of what is random (default: 1)")
    parser.add_argument("--clear", action="store_true", help="end the fault instead")
    add_bus(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Arm or end one fault; one of the car that ends is waited for."""
    from hil.faults.catalogue import FAULTS, fault_named

    if args.fault is None:
        say(listing([(one.name, one.takes.value, one.text) for one in FAULTS], terminal_width()))
        return 0
    kind = fault_named(args.fault)
    values = dict(_pair(text) for text in args.set) | ({} if args.for_s is None else {"for_s": args.for_s})
    on = "all" if args.on is None and "all" in kind.usual else args.on
    if on is None and len(kind.usual) > 1:
        raise BrakebenchError(f"inject {kind.name}: --on: expected {kind.takes.value}, such as {kind.usual[0]}")
    injection = kind.on(on, at_s=0.0, seed=args.seed, values=values)
    _inject(injection, args.bus, args.clear)
    return 0


def _pair(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not (name and equals) or not math.isfinite(number):
        raise BrakebenchError(f"--set {text!r}: expected NAME=NUMBER, such as share=0.1")
    return name, number


def _inject(injection: "Injection", bus: str, clear: bool) -> None:
    from dbc.exchange import Transmitter
    from dbc.frame import BusName
    from hil.bus.channel import bench_channel
    from hil.bus.open import open_bus
    from hil.faults.fault import Side
    from hil.faults.physical import events_of
    from hil.faults.wire import start_messages, stop_messages
    from hil.rt.clock import WallClock

    if injection.kind.side is Side.HOST:
        raise BrakebenchError(f"inject {injection.kind.name}: only inside the vcan laboratory, see docs/faults.md")
    planned: list[tuple[float, list[Message]]] = []
    if injection.kind.side is Side.PLANT:
        events = events_of(injection)
        chosen = [replace(events[0], at_s=0.0, active=False)] if clear else events
        planned += [(e.at_s, list(e.messages)) for e in chosen]
    else:
        planned.append((0.0, stop_messages(injection) if clear else start_messages(injection)))
    transmitter, clock = Transmitter(), WallClock()
    with open_bus(bench_channel(bus), BusName.BENCH) as bench:
        if not bench.receive(_LISTEN_S):
            raise BrakebenchError(f"inject: nobody is on {bench.name}; start a bench first, or name its --bus")
        begin_ns = clock.now_ns()
        try:
            for at_s, messages in planned:
                while clock.now_ns() < begin_ns + round(at_s * 1e9):
                    clock.sleep_until(min(begin_ns + round(at_s * 1e9), clock.now_ns() + 50_000_000))
                    bench.receive(0.0)
                bench.send(transmitter.frames(0, messages))
        finally:
            if len(planned) > 1:  # whatever ends us, the car is whole again
                bench.send(transmitter.frames(0, planned[-1][1]))
    print(f"{'ended' if clear else 'armed'}: {injection}", file=sys.stderr)
