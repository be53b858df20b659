"""``brakebench compare``: one scenario in virtual and in real time, and the difference as a report."""

import argparse
import sys
from dataclasses import replace

from hil.cli.options import add_bus, add_json, add_realtime, add_scenario, add_seed, add_transmit


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "compare",
        description="Run a scenario in virtual and in real time; report signals, stopping distance and latencies.",
    )
    add_scenario(parser)
    add_bus(parser)
    parser.add_argument("--out", metavar="DIR", help="folder for both runs, figure and report (default: runs/...)")
    add_seed(parser)
    add_realtime(parser)
    add_transmit(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run twice and compare."""
    from hil.bench.compare import compare_scenario
    from hil.report.pictures import can_draw, no_pictures
    from hil.report.text import print_text

    comparison = compare_scenario(
        args.scenario,
        args.bus,
        out=args.out,
        seed=args.seed,
        realtime=args.realtime,
        transmit=args.transmit,
        command_line=" ".join(sys.argv[1:]),
        say=lambda line: print(line, file=sys.stderr, flush=True),
    )
    if args.json:
        print(comparison.json_text())
        return comparison.exit_code
    print_text(replace(comparison.report, sections=()), sys.stdout, brief=True)  # the tables are on the page
    for name in ("figure", "page"):
        if comparison.facts[name] is not None:
            print(f"{name:8} {comparison.facts[name]}")
    if not can_draw():
        print(f"figure   {no_pictures()}")
    return comparison.exit_code
