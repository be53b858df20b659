"""``brakebench plant``: the vehicle alone, on a bus."""

import argparse
import sys

from hil.cli.options import add_node_options, add_seed


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("plant")
    add_node_options(parser)
    add_seed(parser)
    parser.add_argument(
        "--play",
        action="append",
        default=[],
        metavar="NODES",
        help="play these nodes of brake.dbc alone, such as sensors,iwm,battery: what the others send enters the model; "
        "see docs/partial-plant.md (default: all)",
    )
    parser.add_argument(
        "--leave",
        action="append",
        default=[],
        metavar="MESSAGES",
        help="messages of those nodes that somebody else sends, such as BODY_MOTION of a real IMU",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the vehicle until it is told to stop; it drives the scenario once, when a controller is there."""
    from dbc.frame import Node
    from hil.bench.hold import awaiting_bench, notice
    from hil.bench.node_process import NODE_PERIOD_NS, PLANT, serve
    from hil.bench.part import Part, PartOfPlant
    from hil.bus.channel import resolve
    from hil.scenario.scenario import load_scenario
    from plant.model import compile_model
    from plant.node import PlantNode

    scenario = load_scenario(args.scenario)

    part = Part(_named(args.play), _named(args.leave))

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    def make() -> Node:
        compile_model()
        whole = PlantNode(
            scenario.plant, scenario.manoeuvre, args.seed, NODE_PERIOD_NS, part.nodes, **scenario.effects.for_node()
        )
        node = whole if part.whole else PartOfPlant(whole, part, lambda text: say(f"plant: {text}"))
        return node if args.ready_fd is not None else awaiting_bench(node, scenario)

    if not part.whole:
        say(f"plant: {part}")
    words = notice(scenario, "plant", resolve(args.bus)) if args.ready_fd is None else ""
    if words:
        say(f"plant: {words}")
    serve(
        PLANT, make, args.bus, ready_fd=args.ready_fd, realtime=args.realtime, say=say, senders=part.senders,
        sends=part.owned(), transmit=args.transmit, force=args.force,
    )  # fmt: skip
    return 0


def _named(options: list[str]) -> list[str]:
    return [name for option in options for name in option.split(",") if name.strip()]
