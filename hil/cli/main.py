"""The command ``brakebench``: one subcommand a file."""

import argparse
import importlib
import sys
from collections.abc import Sequence
from importlib.metadata import version

from hil.errors import BrakebenchError

COMMANDS = ("run", "ecu", "plant", "record", "decode", "convert")
"""Subcommands in the order of the help; each is a module of this package."""


def build_parser() -> argparse.ArgumentParser:
    """Parser of the whole command line."""
    parser = argparse.ArgumentParser(
        prog="brakebench",
        description="CAN-bus brake ECU emulator and hardware-in-the-loop bench.",
        epilog="Exit codes: 0 ok, 1 an expectation failed, 2 wrong use or input, 3 the bench broke.",
    )
    parser.add_argument("--version", action="version", version=f"brakebench {version('brakebench')}")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name in COMMANDS:
        importlib.import_module(f"hil.cli.{name}").add_parser(subparsers)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    args = build_parser().parse_args(arguments)
    try:
        code: int = args.run(args)
    except BrakebenchError as error:
        print(f"brakebench: {error}", file=sys.stderr)
        return error.exit_code
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output has left
        return 0
    return code


if __name__ == "__main__":
    sys.exit(main())
