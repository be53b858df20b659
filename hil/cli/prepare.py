"""``brakebench prepare``: a channel map and a vehicle set drafted from a stranger's logs, guesses marked as such."""

import argparse
import json
from pathlib import Path

from hil.cli.options import add_json


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "prepare",
        description="Chooses a signal for each channel by name, unit, range and data, with unit and sign, and says "
        "beside each guess what was measured, what the data cannot tell and what to check. Writes CHANNELS.toml and "
        "SET.toml; what only the car's sheet knows stays open, and explain refuses the set until it is filled in.",
    )
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="CAN log, CSV, Parquet, MF4 or .mat table")
    parser.add_argument("--dbc", type=Path, metavar="FILE", help="the car's DBC, for CAN logs")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", default=Path(), help="folder for both files (default: this one)"
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draft, write, print."""
    from dbc.database import parse_database
    from hil.cli.columns import say
    from hil.diagnosis.draft.drafting import draft
    from hil.diagnosis.draft.files import lines_for_people, refuse_existing, write_draft
    from hil.diagnosis.draft.signals import read_signals

    refuse_existing(args.out)
    database = None if args.dbc is None else parse_database(args.dbc.read_bytes(), str(args.dbc))
    found = draft(read_signals(args.logs, database))
    paths = write_draft(found, args.out)
    if args.json:
        say([json.dumps(found.as_json() | {"map": str(paths[0]), "vehicle": str(paths[1])}, allow_nan=False)])
    else:
        say(lines_for_people(found, paths, args.dbc))
    return 0
