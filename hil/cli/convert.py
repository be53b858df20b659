"""``brakebench convert``: a log from one format to another, compared after writing, or its signals as MCAP."""

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from hil.cli.columns import say, terminal_width, wrapped
from hil.cli.log_options import LOGS, add_databases, add_force, add_timezone, databases
from hil.cli.progress import Progress
from hil.errors import BrakebenchError
from hil.log.account import Account
from hil.log.convert import Conversion, convert
from hil.log.formats import WRITABLE
from hil.log.samples import log_path
from hil.log.source import ReadOptions

MCAP = ".mcap"


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "convert",
        description=f"Convert a CAN log; the suffix names the format: {', '.join(WRITABLE)} (.log is candump's), or "
        f"{MCAP} for its signals, to be seen in Foxglove, PlotJuggler or Rerun.",
        epilog="The written file is read back and compared with the frames of IN before it appears as OUT. "
        "Exit codes: 0 all of IN is in OUT; 1 something of IN was cut off or rejected; 2 unusable.",
    )
    parser.add_argument("source", metavar="IN", help=LOGS)
    parser.add_argument("target", metavar="OUT", type=Path, help="log to write")
    add_databases(parser)
    add_force(parser, "OUT")
    add_timezone(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Convert and say what happened."""
    if args.target.suffix.lower() == MCAP:
        return _signals(args)
    if args.dbc:
        raise BrakebenchError(f"--dbc: only signals need a database; leave it out, or write OUT{MCAP}")
    with Progress() as progress:
        progress.part(0, "converting")
        done = convert(log_path(args.source), args.target, args.force, ReadOptions(timezone=args.timezone), progress)
    account = done.account
    if args.json:
        result = {
            "in": str(done.source),
            "format": done.format,
            "out": str(done.path),
            "frames_read": done.frames_read,
            "frames_written": done.frames_written,
            "rejected": account.rejected,
            "truncated_at": account.truncated_at,
            "passed_over": dict(account.passed_over),
            "notes": [*done.notes, *account.notes],
        }
        say([json.dumps(result)])
    else:
        text = (
            f"{done.source} ({done.format}) -> {done.path}: {done.frames_read:,} frames read, "
            f"{done.frames_written:,} written, equal"
        )
        say(line for note in (text, *_notes(done)) for line in wrapped(note, terminal_width()))
    if args.json:
        for note in _notes(done):
            print("\n".join(wrapped(note, terminal_width())), file=sys.stderr)
    return 0 if account.whole else 1


def _signals(args: argparse.Namespace) -> int:
    """Write the signals as MCAP and say what happened."""
    from hil.log.export.signals_of_log import write_signals_of

    of, files = databases(args.dbc)
    source, options = log_path(args.source), ReadOptions(timezone=args.timezone)
    with Progress() as progress:
        progress.part(0, "converting")
        done = write_signals_of(source, args.target, of, args.force, options, progress, files)
    notes = [*of.warnings, *done.account.notes]
    if done.unknown:
        notes.append(f"{done.unknown:,} frames of no message in the databases are left out")
    if done.rejected:
        notes.append(f"{done.rejected:,} frames shorter than their message are left out")
    shown = [*notes, *_missing(source, done.account)]
    text = (
        f"{source} ({done.format}) -> {args.target}: {done.frames:,} frames read, {done.messages:,} messages "
        "written with their signals"
    )
    if args.json:
        result = {
            "in": str(source),
            "format": done.format,
            "out": str(args.target),
            "frames_read": done.frames,
            "frames_written": done.messages,
            "rejected": done.account.rejected + done.rejected,
            "truncated_at": done.account.truncated_at,
            "passed_over": dict(done.account.passed_over),
            "notes": notes,
        }
        say([json.dumps(result)])
    for note in shown if args.json else (text, *shown):
        print("\n".join(wrapped(note, terminal_width())), file=sys.stderr if args.json else sys.stdout)
    return 0 if done.account.whole and not done.rejected else 1


def _notes(done: Conversion) -> Iterator[str]:
    yield from done.notes
    yield from done.account.notes
    yield from _missing(done.source, done.account)


def _missing(source: Path, account: Account) -> Iterator[str]:
    """What of a log is not in the output."""
    for kind, count in account.passed_over.items():
        yield f"{count:,} {kind} passed over"
    if account.rejected:
        single = account.rejected == 1
        what = f"piece of {source} is no frame" if single else f"pieces of {source} are no frames"
        yield f"{account.rejected:,} {what} and left out:"
        yield from (f"  at byte {one.offset}: {one.text}" for one in account.first_rejected)
    if account.truncated_at is not None:
        yield f"{source} is cut off at byte {account.truncated_at}"
