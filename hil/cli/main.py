"""The command ``brakebench``: one subcommand a file."""

import argparse
import importlib
import sys
from collections.abc import Sequence
from importlib.metadata import version

from hil.errors import BrakebenchError

COMMANDS = (
    "run",
    "compare",
    "scenarios",
    "ecu",
    "plant",
    "record",
    "replay",
    "decode",
    "convert",
    "diff",
    "plot",
    "identify",
    "verify",
    "reproduce",
    "doctor",
    "perf",
    "hide",
    "explain",
    "trials",
    "effects",
    "sensitivities",
)
"""Subcommands in the order of the help; each is a module of this package."""


def build_parser(commands: Sequence[str] = COMMANDS) -> argparse.ArgumentParser:
    """Parser of the command line, with some or all commands."""
    parser = argparse.ArgumentParser(
        prog="brakebench",
        description="CAN-bus brake ECU emulator and hardware-in-the-loop bench.",
        epilog="Exit codes: 0 ok, 1 an expectation failed, 2 wrong use or input, 3 the bench broke.",
    )
    parser.add_argument("--version", action="version", version=f"brakebench {version('brakebench')}")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name in commands:
        importlib.import_module(f"hil.cli.{name}").add_parser(subparsers)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    named = [word for word in words[:1] if word in COMMANDS]  # importing one command is faster than all
    args = build_parser(named or COMMANDS).parse_args(words)
    try:
        code: int = args.run(args)
    except BrakebenchError as error:
        print(f"brakebench: {_visible(str(error))}", file=sys.stderr)
        return error.exit_code
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output has left
        return 0
    return code


def _visible(text: str) -> str:
    """A message that is safe on a terminal: names of files and the like may hold control characters."""
    from hil.log.account import printable

    return "\n".join(printable(line) for line in text.split("\n"))


if __name__ == "__main__":
    sys.exit(main())
