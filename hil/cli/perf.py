"""``brakebench perf NAME``: how fast and how right we are, beside a peer or a limit measured in the same run."""

import argparse
import importlib
import json
from dataclasses import asdict

from hil.cli.options import add_json, positive
from hil.cli.progress import Progress
from hil.errors import BrakebenchError

MEASUREMENTS = ("rt", "plant", "ecu", "codec", "loop", "decode", "explain", "coverage", "live", "campaign")
"""Each is a module of hil.validation.perf with ``measure() -> list[Row]``."""


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("perf")
    parser.add_argument("name", choices=MEASUREMENTS, help="what to measure")
    parser.add_argument("--beside", metavar="FOLDER", help="loop: compare with another checkout of the project instead")
    parser.add_argument(
        "--count", type=positive, metavar="N", help="campaign: stops of each measurement (default: 200)"
    )
    parser.add_argument("--tiny", type=positive, metavar="N", help="campaign: instead, N tiny tasks through Dask")
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure and print the rows."""
    module = importlib.import_module(f"hil.validation.perf.{args.name}")
    if args.beside is not None and args.name != "loop":
        raise BrakebenchError(f"--beside goes with perf loop, not with perf {args.name}")
    if args.name != "campaign" and (args.count or args.tiny):
        raise BrakebenchError(f"--count and --tiny go with perf campaign, not with perf {args.name}")
    with Progress().part(0, f"perf {args.name}") as progress:
        if args.beside is not None:
            rows = module.beside(args.beside)
        elif args.tiny:
            rows = module.tiny(args.tiny, progress)
        elif args.count:
            rows = module.measure(progress, args.count)
        else:
            rows = module.measure(progress)
    if args.json:
        print(json.dumps({"rows": [asdict(row) for row in rows]}, indent=2))
        return 0
    width, spread = max(len(row.name) for row in rows), any(row.ours_95 for row in rows)
    both = f"{'ours, 95 %':>14} {'other, 95 %':>14} " if spread else ""
    print(f"{'':{width}}  {'ours':>12} {'other':>12} {both}{'unit':8} {'ratio':>8}  other is")
    for row in rows:
        both = f"{_interval(row.ours_95):>14} {_interval(row.other_95):>14} " if spread else ""
        print(
            f"{row.name:{width}}  {row.ours:12.4g} {row.other:12.4g} {both}{row.unit:8} {row.ratio:8.2f}"
            f"  {row.other_is}"
        )
    return 0


def _interval(of: tuple[float, float] | None) -> str:
    return "" if of is None else f"{of[0]:.2f} to {of[1]:.2f}"
