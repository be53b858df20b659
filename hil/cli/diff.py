"""``brakebench diff``: which signals of two logs differ, from when, by how much."""

import argparse
import json
import math
from collections.abc import Iterator
from typing import Any

from dbc.database import Signal
from hil.cli.columns import columns, say, terminal_width, wrapped
from hil.cli.log_options import LOGS, add_databases, add_timezone, check_found, databases, words_of
from hil.cli.log_pages import add_page, check_page, diff_courses, diff_report, differing, write_page
from hil.cli.progress import Progress
from hil.errors import BrakebenchError
from hil.log.choice import Choice, matches
from hil.log.compare.diff import LogDifference, MessageDifference, Tolerance, diff_logs
from hil.log.compare.diff_signals import SignalDifference
from hil.log.samples import log_path
from hil.log.several import Logs
from hil.log.signals.databases import Databases
from hil.log.source import ReadOptions

SHOWN = 10


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "diff",
        description="Compare the signals of two logs, frame by frame: which differ, from when, by how much.",
        epilog="Frames are paired by their stamps, within half a cycle. Tolerance is one raw step, and none for single "
        "bits and named values. Exit codes: 0 equal within the tolerances, 1 they differ, or something of a log was "
        "cut off or rejected, 2 unusable.",
    )
    parser.add_argument("first", metavar="A", type=log_path, help=LOGS)
    parser.add_argument("second", metavar="B", type=log_path, help="the other one")
    add_databases(parser)
    parser.add_argument("--messages", metavar="GLOB,...", action="append", default=[], help="only these messages")
    parser.add_argument(
        "--signals", metavar="GLOB,...", action="append", default=[], help="only these: MESSAGE.SIGNAL or SIGNAL"
    )
    parser.add_argument("--channel", metavar="NAME", action="append", default=[], help="only this channel (repeatable)")
    parser.add_argument(
        "--tolerance",
        metavar="GLOB=VALUE",
        action="append",
        default=[],
        help="of signals whose name matches, in their unit (repeatable; the last one that matches counts)",
    )
    add_timezone(parser)
    add_page(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Compare and say what differs."""
    check_page(args.page, overwrite=False)
    databases_, files = databases(args.dbc)
    choice = Choice(tuple(args.channel), messages=words_of(args.messages), signals=words_of(args.signals))
    tolerance = _tolerance(args.tolerance, databases_)
    options = ReadOptions(timezone=args.timezone)
    with Logs([args.first], options) as first, Logs([args.second], options) as second, Progress() as progress:
        found = diff_logs(first, second, databases_, choice, tolerance, progress.part(0, "comparing"))
        for logs in (first, second):
            if not any(part.frames for part in logs.parts):
                raise BrakebenchError(f"{logs.parts[0].path}: no frame could be read; give a CAN log")
        check_found(choice, len(found.messages) + len(found.only_first) + len(found.only_second), first, second)
        if not (found.messages or found.only_first or found.only_second):
            raise BrakebenchError(
                f"{args.first} and {args.second}: nothing to compare: no frame of them is of a chosen message of the "
                "databases; give the database of these logs with --dbc"
            )
        whole = [first.whole, second.whole]
        if args.page is not None:
            courses = diff_courses(found, first, second, databases_, choice, progress)
            read = [*files, *(part.path for logs in (first, second) for part in logs.parts)]
            names = str(args.first), str(args.second)
            write_page(diff_report(found, names, courses, all(whole)), args.page, False, read)
    if args.json:
        say([json.dumps(_values(found, args, whole), allow_nan=False)])
    else:
        say(_lines(found, args, whole, terminal_width()))
    return 0 if found.equal and all(whole) else 1


def _tolerance(words: list[str], of: Databases) -> Tolerance:
    names = [(message.name, signal.name) for message in of.messages() for signal in message.signals] if words else []
    given: list[tuple[str, float]] = []
    for word in words:
        pattern, _, text = word.rpartition("=")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not pattern or not value >= 0:
            raise BrakebenchError(f"--tolerance {word}: expected a name and a number, as WHEELS.*=0.5")
        if not any(matches(*name, pattern) for name in names):
            raise BrakebenchError(f"--tolerance {word}: no signal of the database is called {pattern!r}")
        given.append((pattern, value))

    def tolerance(name: str, signal: Signal) -> float | None:
        for pattern, value in reversed(given):
            if matches(name.rpartition(".")[0], signal.name, pattern):
                return value
        return None

    return tolerance


def _lines(found: LogDifference, args: argparse.Namespace, whole: list[bool], width: int) -> Iterator[str]:
    different = differing(found)
    clock = "by their stamps" if found.same_clock else "from the first frame of each on (they do not overlap in time)"
    text = (
        f"A {args.first} and B {args.second}, {clock}: {len(found.signals)} signals of {len(found.messages)} messages "
        f"compared, {len(different)} {'differs' if len(different) == 1 else 'differ'}"
    )
    yield from wrapped(text, width)
    for path in dict.fromkeys(path for path, good in zip((args.first, args.second), whole, strict=True) if not good):
        yield from wrapped(f"{path}: something was cut off or rejected; brakebench decode tells what", width)
    if different:
        heads = ("signal", "unit", "compared", "differ", "one-sided", "from s", "greatest", "at s", "rms")
        yield ""
        yield from columns(heads, [_row(one) for one in different], width, left=(0, 1))
    unpaired = sorted((one for one in found.messages if not one.equal), key=lambda one: one.unpaired_s or 0.0)
    if unpaired:
        yield ""
        frames = ("frames without a partner", "in A", "in B", "only in A", "only in B", "from s")
        yield from columns(frames, [_unpaired_row(one) for one in unpaired[:SHOWN]], width)
    if len(unpaired) > SHOWN:
        yield f"and {len(unpaired) - SHOWN} more messages with frames that have no partner (all of them with --json)"
    notes: list[str] = []
    for path, only in ((args.first, found.only_first), (args.second, found.only_second)):
        if only:
            shown = ", ".join(f"{name} ({count:,})" for name, count in list(only.items())[:SHOWN])
            more = f", and {len(only) - SHOWN} more" if len(only) > SHOWN else ""
            notes.append(f"only in {path}: {shown}{more}")
    if found.unknown:
        shown = ", ".join(f"{name} ({a:,} and {b:,})" for name, (a, b) in list(found.unknown.items())[:SHOWN])
        more = f", and {len(found.unknown) - SHOWN} more" if len(found.unknown) > SHOWN else ""
        notes.append(f"in no database, and not equally many: {shown}{more}")
    if notes:
        yield ""
    yield from (line for note in notes for line in wrapped(note, width, "    "))


def _unpaired_row(one: MessageDifference) -> tuple[str, ...]:
    alone = (f"{n:,}" if n else "" for n in (one.unpaired_first, one.unpaired_second))
    return one.name, f"{one.first:,}", f"{one.second:,}", *alone, f"{one.unpaired_s or 0.0:.3f}"


def _row(one: SignalDifference) -> tuple[str, ...]:
    sided = one.only_first + one.only_second
    return (
        one.name,
        one.unit,
        f"{one.compared:,}",
        f"{one.differing:,}" if one.differing else "",
        f"{sided:,}" if sided else "",
        "" if one.first_s is None else f"{one.first_s:.3f}",
        f"{one.greatest:.6g}",
        "" if one.greatest_s is None else f"{one.greatest_s:.3f}",
        f"{one.rms:.4g}",
    )


def _values(found: LogDifference, args: argparse.Namespace, whole: list[bool]) -> dict[str, Any]:
    return {
        "first": str(args.first),
        "second": str(args.second),
        "equal": found.equal,
        "whole": whole,
        "same_clock": found.same_clock,
        "signals": {
            one.name: {
                "unit": one.unit,
                "tolerance": one.tolerance,
                "compared": one.compared,
                "differing": one.differing,
                "only_first": one.only_first,
                "only_second": one.only_second,
                "first_s": one.first_s,
                "greatest": one.greatest if math.isfinite(one.greatest) else None,
                "greatest_s": one.greatest_s,
                "rms": one.rms if math.isfinite(one.rms) else None,
            }
            for one in found.signals
        },
        "messages": {
            one.name: {
                "first": one.first,
                "second": one.second,
                "unpaired_first": one.unpaired_first,
                "unpaired_second": one.unpaired_second,
                "unpaired_s": one.unpaired_s,
            }
            for one in found.messages
        },
        "only_first": found.only_first,
        "only_second": found.only_second,
        "unknown": {name: list(pair) for name, pair in found.unknown.items()},
    }
