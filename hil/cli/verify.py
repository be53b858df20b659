"""``brakebench verify plant``: the vehicle model held against what is not ours."""

import argparse

from hil.cli.options import add_json, out_folder


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("verify")
    parser.add_argument("what", choices=("plant",), help="what to verify")
    parser.add_argument("--out", type=out_folder, metavar="DIR", help="write report.html and a figure for each topic")
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Verify; 1 when a number is beyond its limit."""
    from hil.validation.verify.plant import main

    return main(args)
