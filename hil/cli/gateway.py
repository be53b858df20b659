"""``brakebench gateway``: our messages as another car's, and theirs as ours, between two buses."""

import argparse
import sys
from pathlib import Path

from hil.cli.options import add_bus, add_force, add_realtime, add_transmit


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("gateway")
    parser.add_argument("map", type=Path, metavar="MAP.toml", help="database and signals, see docs/gateway.md")
    add_bus(parser)
    parser.add_argument("--to", required=True, metavar="BUS", help="the other car's bus, named as --bus")
    add_transmit(parser)
    add_force(parser)
    add_realtime(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the gateway until it is told to stop."""
    from hil.gateway.map import load_map
    from hil.gateway.serve import serve_gateway

    def say(text: str) -> None:
        print(f"gateway: {text}", file=sys.stderr, flush=True)

    serve_gateway(load_map(args.map), args.bus, args.to, args.realtime, say, args.transmit, args.force)
    return 0
