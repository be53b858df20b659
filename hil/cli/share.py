"""``brakebench share``: one adapter for several processes."""

import argparse
import sys

from hil.cli.options import add_bus, add_ready_fd, add_realtime, add_transmit


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "share",
        description="Open an adapter that only one process can open, and share it on a loopback for recorder, nodes "
        "and tools, until Ctrl-C. `brakebench run` does so by itself.",
    )
    add_bus(parser)
    add_transmit(parser)
    add_realtime(parser)
    add_ready_fd(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Share until told to stop."""
    from hil.bench.share import serve_share

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    serve_share(args.bus, transmit=args.transmit, ready_fd=args.ready_fd, realtime=args.realtime, say=say)
    return 0
