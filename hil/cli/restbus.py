"""``brakebench restbus``: the messages of nodes of any database that are not there."""

import argparse
import sys
from pathlib import Path

from hil.cli.options import add_bus, add_force, add_realtime, add_transmit


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("restbus")
    parser.add_argument("database", type=Path, metavar="FILE.dbc")
    parser.add_argument("--node", nargs="+", required=True, metavar="NAME", help="nodes whose messages are sent")
    parser.add_argument(
        "--settings", type=Path, metavar="FILE.toml", help="cycle times, counters, check values, start values"
    )
    add_bus(parser)
    add_transmit(parser)
    add_force(parser)
    add_realtime(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Send until it is told to stop."""
    from hil.gateway.database import load
    from hil.gateway.restbus import RestBus, sendings, unprotected
    from hil.gateway.serve import serve_restbus

    def say(text: str) -> None:
        print(f"restbus: {text}", file=sys.stderr, flush=True)

    database = load(args.database)
    chosen = sendings(database, args.node, args.settings)
    for one in chosen:
        how = f"every {one.cycle_ns / 1e6:g} ms" if one.cycle_ns else "only when it is edited: no cycle time"
        say(f"{one.message.name} {how}")
    for name in unprotected(chosen):
        say(f"{name} keeps its start value; is it a counter or check value, state it in --settings")
    if database.left_out:
        say(f"left out, as they are no frames of classical CAN: {', '.join(database.left_out)}")
    serve_restbus(RestBus(chosen), args.bus, args.realtime, say, args.transmit, args.force)
    return 0
