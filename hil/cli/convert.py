"""``brakebench convert``: a log from one format to another, compared after writing."""

import argparse
import json
import sys
from pathlib import Path

from hil.log.convert import convert
from hil.log.write import FORMATS


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "convert",
        help="convert a log to another format",
        description=f"Convert a CAN log; the suffix names the format: {', '.join(FORMATS)} (.log is candump's).",
        epilog="The written file is read back and compared with the frames of IN before it appears as OUT.",
    )
    parser.add_argument("source", metavar="IN", type=Path, help="log to read")
    parser.add_argument("target", metavar="OUT", type=Path, help="log to write")
    parser.add_argument("--force", action="store_true", help="replace OUT where it exists")
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Convert and say what happened."""
    done = convert(args.source, args.target, args.force)
    source = done.source
    notes = list(done.notes)
    if source.rejected:
        notes.append(f"{source.rejected} lines or objects of {source.path} are no frames and were left out:")
        notes += [f"  at byte {r.offset}: {r.text}" for r in source.first_rejected]
    if source.truncated_at is not None:
        notes.append(f"{source.path} is cut off at byte {source.truncated_at}")
    if args.json:
        result = {
            "in": str(source.path),
            "out": str(done.path),
            "frames_read": len(source.frames),
            "frames_written": done.frames_written,
            "rejected": source.rejected,
            "truncated_at": source.truncated_at,
            "notes": list(done.notes),
        }
        print(json.dumps(result))
    else:
        print(f"{source.path} -> {done.path}: {len(source.frames)} frames read, {done.frames_written} written, equal")
    for note in notes:
        print(note, file=sys.stderr if args.json else sys.stdout)
    return 0
