"""``brakebench calibrate``: a vehicle set fitted to reference logs of the car."""

import argparse
import json
import sys
from pathlib import Path

from hil.cli.options import add_json
from hil.rt.clock import monotonic_ns


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "calibrate",
        description="Fits the uncertain numbers of a vehicle set to drives of the car as explain does, with no cause "
        "allowed, and writes them with what is left of their tolerances; all other keys stay as they are.",
    )
    parser.add_argument("logs", nargs="+", type=Path, metavar="REF", help="logs of the car, as explain takes them")
    parser.add_argument("--vehicle", type=Path, metavar="SET.toml", required=True, help="the set to start from")
    parser.add_argument("--out", type=Path, metavar="CAR.toml", required=True, help="the fitted set; must not exist")
    parser.add_argument("--dbc", type=Path, metavar="FILE", help="another car's DBC, with --map")
    parser.add_argument("--map", type=Path, metavar="CHANNELS.toml", help="which signal is which channel")
    parser.add_argument(
        "--logs", dest="about", type=Path, metavar="LOGS.toml", help="direction, disc temperature per file"
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Fit, write, print."""
    from hil.cli.columns import say
    from hil.diagnosis.calibration.calibrate import calibrate
    from hil.diagnosis.calibration.write import lines_for_people, write_set
    from hil.errors import BrakebenchError
    from hil.log.atomic_write import check_folder

    if args.out.exists():
        raise BrakebenchError(f"{args.out}: there already: not replaced; give another name, or move it away")
    check_folder(args.out)
    begun_ns = monotonic_ns()

    def progress(text: str) -> None:
        print(f"{(monotonic_ns() - begun_ns) * 1e-9:5.0f} s  {text} ...", file=sys.stderr, flush=True)

    found = calibrate(args.logs, args.vehicle, args.map, args.dbc, args.about, progress)
    write_set(found, args.out, args.vehicle)
    if args.json:
        say([json.dumps(found.as_json() | {"vehicle": str(args.out)}, allow_nan=False)])
    else:
        say(lines_for_people(found, args.out))
    return 0
