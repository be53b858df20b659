"""``brakebench plant``: the vehicle alone, on a bus."""

import argparse
import sys

from hil.cli.options import add_node_options, add_seed


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("plant", help="run the vehicle alone on a bus, until Ctrl-C")
    add_node_options(parser)
    add_seed(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the vehicle until it is told to stop; it drives the scenario once, when a controller is there."""
    from dbc.frame import Node
    from hil.bench.hold import awaiting_bench, notice
    from hil.bench.node_process import NODE_PERIOD_NS, PLANT, serve
    from hil.bus.channel import resolve
    from hil.scenario.scenario import load_scenario
    from plant.model import compile_model
    from plant.node import PlantNode

    scenario = load_scenario(args.scenario)

    def make() -> Node:
        compile_model()
        node = PlantNode(scenario.plant, scenario.manoeuvre, args.seed, NODE_PERIOD_NS, **scenario.effects.for_node())
        return node if args.ready_fd is not None else awaiting_bench(node, scenario)

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    words = notice(scenario, "plant", resolve(args.bus)) if args.ready_fd is None else ""
    if words:
        say(f"plant: {words}")
    serve(PLANT, make, args.bus, ready_fd=args.ready_fd, realtime=args.realtime, say=say)
    return 0
