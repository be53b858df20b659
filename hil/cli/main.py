"""The command ``brakebench``: one subcommand a file."""

import argparse
import importlib
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from hil.errors import INTERRUPTED_EXIT_CODE, BrakebenchError

COMMANDS = (
    "run",
    "compare",
    "scenarios",
    "ecu",
    "plant",
    "gateway",
    "restbus",
    "share",
    "tunnel",
    "record",
    "watch",
    "inject",
    "diag",
    "replay",
    "latency",
    "decode",
    "convert",
    "diff",
    "plot",
    "bus-analysis",
    "identify",
    "verify",
    "reproduce",
    "doctor",
    "perf",
    "hide",
    "prepare",
    "explain",
    "calibrate",
    "trials",
    "effects",
    "sensitivities",
    "faults",
    "campaign",
    "fmu",
)
"""Subcommands in the order of the help; each is a module of this package."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are safe on a terminal, whatever was typed."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and exit."""
        self.print_usage(sys.stderr)
        self.exit(2, f"{self.prog}: error: {_safe(message)}\n")


def build_parser(commands: Sequence[str] = COMMANDS) -> argparse.ArgumentParser:
    """Parser of the command line, with some or all commands."""
    parser = Parser(
        prog="brakebench",
        description="CAN-bus brake ECU emulator and hardware-in-the-loop bench.",
        epilog="Exit codes: 0 passed, 1 failed, 2 wrong use or input, 3 broken, 4 inconclusive, 5 incomplete, "
        "130 interrupted.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show program's version number and exit")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name in commands:
        importlib.import_module(f"hil.cli.{name.replace('-', '_')}").add_parser(subparsers)
    return parser


class _Version(argparse.Action):
    """Prints the version; what finds it out takes a tenth of the time of a short command to load."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print and leave."""
        from importlib.metadata import version

        print(f"brakebench {version('brakebench')}")
        parser.exit()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    named = [word for word in words[:1] if word in COMMANDS]  # importing one command is faster than all
    _take_all_letters()
    with _interrupts() as came:
        try:
            args = build_parser(named or COMMANDS).parse_args(words)
            code: int = args.run(args)
            if sys.stdout is not None:
                sys.stdout.flush()
        except BrakebenchError as error:
            return INTERRUPTED_EXIT_CODE if came else _complain(error, error.exit_code)
        except KeyboardInterrupt:
            return INTERRUPTED_EXIT_CODE
        except BrokenPipeError:  # the reader of our output has left
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            return 0
        except OSError as error:
            return INTERRUPTED_EXIT_CODE if came else _complain(error, BrakebenchError.exit_code)
        except Exception:
            if came:  # a library may turn the interrupt into an error of its own
                return INTERRUPTED_EXIT_CODE
            raise
    return code


def _complain(error: Exception, code: int) -> int:
    print(f"brakebench: {_safe(str(error))}", file=sys.stderr)
    return code


def _safe(text: str) -> str:
    from hil.log.account import printable  # numpy comes with it

    return "\n".join(printable(line) for line in text.splitlines())


def _take_all_letters() -> None:
    """Have letters that the output's encoding does not know appear escaped, instead of an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


@contextmanager
def _interrupts() -> Iterator[list[int]]:
    """Yield a list that holds the interrupts (Ctrl-C) that came; each raises KeyboardInterrupt, as ever."""
    came: list[int] = []

    def interrupted(number: int, _: FrameType | None) -> None:
        came.append(number)
        raise KeyboardInterrupt

    ours = threading.current_thread() is threading.main_thread()
    ours = ours and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:
        signal.signal(signal.SIGINT, interrupted)
    try:
        yield came
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)


if __name__ == "__main__":
    sys.exit(main())
