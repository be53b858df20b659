"""The command ``brakebench``: one subcommand a file."""

import argparse
import difflib
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

if sys.version_info < (3, 11):  # noqa: UP036  a clone is started without pip, which would refuse
    sys.exit(f"brakebench needs Python 3.11 or newer; this is {sys.version.split()[0]} ({sys.executable})")

from hil.errors import INTERRUPTED_EXIT_CODE, BrakebenchError
from hil.extras import EXTRA_OF, missing

COMMANDS = {
    "run": "run a scenario: ECU and plant as two processes on one CAN bus",
    "compare": "run a scenario in virtual and in real time and report the difference",
    "scenarios": "list the scenarios that come with brakebench",
    "ecu": "run the controller alone on a bus, until Ctrl-C",
    "plant": "run the vehicle alone on a bus, until Ctrl-C",
    "gateway": "translate between our bus and one with another car's database",
    "restbus": "send the messages of a database's nodes, edited live",
    "share": "open an adapter once and share it on a loopback",
    "tunnel": "join a loopback with one on another machine",
    "record": "append every frame on a bus to a candump file, or write what surrounds a condition",
    "watch": "show a running bus on a page of this machine, and command a bench from it",
    "inject": "arm a fault on a running bench, or list the faults",
    "diag": "ask an ECU by UDS: trouble codes, data, routines",
    "replay": "send a recorded log back on a bus",
    "latency": "timing on the wire: stimulus to response, and jitter of every cyclic message",
    "decode": "what a log holds, and its signals as tables",
    "convert": "convert a log to another format",
    "diff": "which signals of two logs differ",
    "plot": "signals of a log over time, as a picture or a page",
    "bus-analysis": "bus load and worst-case response of each message of a database",
    "identify": "identify a model from measured records",
    "verify": "hold the vehicle model against closed forms and others' code",
    "reproduce": "regenerate the paper's numbers and figures",
    "doctor": "what this machine can do for the bench, with the command for what is missing",
    "perf": "measure beside a peer or a limit, as ratios of one run",
    "hide": "write measured-like logs with something hidden in them",
    "prepare": "draft the channel map and the vehicle set that explain needs, from another car's logs",
    "explain": "measured logs against the simulation: what is wrong, why, and what an extension gains",
    "calibrate": "fit a vehicle set to reference logs, with uncertainties and held-out error",
    "trials": "blind trials of explain: hide, explain, open the answer, score",
    "effects": "list the effects that scenarios can switch on",
    "sensitivities": "every effect's signature in every channel of a manoeuvre, against the noise",
    "faults": "every fault at many instants of a stop, beside the stop without it, against the budgets",
    "campaign": "thousands of runs over parameters, effects, faults and seeds; sensitivities and worst cases",
    "fmu": "plant or controller as an FMU (FMI 3.0) for other simulators",
    "completion": "a script that completes the command line in bash, zsh or fish",
}
"""Subcommands in the order of the help, what each does in a line; each is a module of this package."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are safe on a terminal, whatever was typed."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and exit."""
        self.print_usage(sys.stderr)
        self.exit(2, f"{self.prog}: error: {_safe(message)}\n")


def build_parser(commands: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Parser of the command line with the commands named; with none, a list of all, which imports none of them."""
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
        added = subparsers.choices[name]
        added.description = added.description or f"{COMMANDS[name][0].upper()}{COMMANDS[name][1:]}."
    for name in () if commands else COMMANDS:
        subparsers.add_parser(name, help=COMMANDS[name])
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
    _take_all_letters()
    with _interrupts() as came:
        try:
            args = build_parser(_named(words)).parse_args(words)
            code: int = args.run(args)
            if came:  # a library swallowed the interrupt
                return INTERRUPTED_EXIT_CODE
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
            return INTERRUPTED_EXIT_CODE if came else _complain(_told(error), BrakebenchError.exit_code)
        except ModuleNotFoundError as error:
            if came or (error.name or "").partition(".")[0] not in EXTRA_OF:
                raise
            return _complain(f"{words[0]} {missing((error.name or '').partition('.')[0])}", BrakebenchError.exit_code)
        except Exception:
            if came:  # a library may turn the interrupt into an error of its own
                return INTERRUPTED_EXIT_CODE
            raise
    return code


def _named(words: Sequence[str]) -> list[str]:
    """Command of a command line, as a list; importing one is far faster than all."""
    word = next(iter(words), "-")
    if word.startswith("-"):
        return []
    if word not in COMMANDS:
        near = difflib.get_close_matches(word, COMMANDS, 1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise BrakebenchError(f"no command {word!r}; {hint}`brakebench --help` lists all")
    return [word]


def _told(error: OSError) -> str:
    """What the system says, with the file first."""
    return f"{os.fsdecode(error.filename)}: {error.strerror}" if error.filename and error.strerror else str(error)


def _complain(error: Exception | str, code: int) -> int:
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
