"""``brakebench ecu``: the controller alone, on a bus."""

import argparse
import sys

from hil.cli.options import add_node_options, add_seed


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("ecu")
    add_node_options(parser)
    add_seed(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the controller until it is told to stop."""
    from dbc.frame import Node
    from ecu.node import EcuNode
    from hil.bench.hold import notice
    from hil.bench.node_process import ECU, NODE_PERIOD_NS, serve
    from hil.bus.channel import resolve
    from hil.scenario.scenario import load_scenario

    scenario = load_scenario(args.scenario)

    def make() -> Node:
        EcuNode(scenario.ecu, NODE_PERIOD_NS).step(0, [])  # compiles what the first tick would compile
        return EcuNode(scenario.ecu, NODE_PERIOD_NS)

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    words = notice(scenario, "ecu", resolve(args.bus)) if args.ready_fd is None else ""
    if words:
        say(f"ecu: {words}")
    serve(
        ECU,
        make,
        args.bus,
        ready_fd=args.ready_fd,
        realtime=args.realtime,
        say=say,
        transmit=args.transmit,
        force=args.force,
    )
    return 0
