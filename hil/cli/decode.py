"""``brakebench decode``: a log's frames as signals, every frame accounted for."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from dbc.database import Database, DatabaseError, parse_database
from hil.errors import BrakebenchError
from hil.log.decode import DecodedLog, decode_log, own_databases
from hil.log.export import export
from hil.log.read import read_log

SHOWN = 10


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "decode",
        help="decode a log into signals",
        description="Decode a CAN log into signals; every frame is accounted for.",
        epilog="Without --dbc our own databases are used: bench.dbc for a channel named bench, brake.dbc for others.",
    )
    parser.add_argument("log", metavar="LOG", type=Path, help="log file: candump, ASC, BLF, TRC, MF4, CSV, Parquet")
    parser.add_argument("--dbc", metavar="FILE", type=Path, help="database for all channels of the log")
    parser.add_argument("--out", metavar="FILE", type=Path, help="write the signals: FILE.parquet or FILE.csv")
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Decode, print the account, write the table."""
    databases = {str(args.dbc): _database(args.dbc)} if args.dbc else own_databases()
    recording = read_log(args.log)
    log = decode_log(recording, next(iter(databases.values())) if args.dbc else databases)
    warnings = [w for database in databases.values() for w in database.warnings]
    if args.out:
        export(log, args.out)
    if args.json:
        print(json.dumps(summary(log, warnings, args.out), allow_nan=False))
        for line in _notes(log, warnings):
            print(line, file=sys.stderr)
    else:
        print("\n".join([*_table(log), *_notes(log, warnings)]))
        if args.out:
            print(f"signals: {args.out} ({len(log.time_s)} rows, {len(log.columns)} signals)")
    return 0


def _database(path: Path) -> Database:
    try:
        return parse_database(path.read_bytes(), str(path))
    except OSError as error:
        raise BrakebenchError(f"{path}: cannot be opened: {error.strerror or error}; give a DBC file") from error
    except DatabaseError as error:
        raise BrakebenchError(str(error)) from error


def summary(log: DecodedLog, warnings: list[str], out: Path | None) -> dict[str, Any]:
    """Return the account as the plain values that ``--json`` prints."""
    recording = log.recording
    return {
        "log": str(recording.path),
        "format": recording.format,
        "frames": log.frames,
        "decoded": log.decoded,
        "unknown": log.unknown,
        "rejected": log.rejected,
        "truncated_at": recording.truncated_at,
        "messages": {name: {"count": m.count, "rate_hz": m.rate_hz} for name, m in log.messages.items()},
        "unknown_ids": dict(log.unknown_ids.most_common()),
        "rejected_reasons": dict(log.reasons),
        "first_rejected": [{"offset": r.offset, "text": r.text} for r in recording.first_rejected],
        "dbc_warnings": warnings,
        "out": None if out is None else str(out),
    }


def _table(log: DecodedLog) -> list[str]:
    width = max([7, *(len(name) for name in log.messages)])
    lines = [f"{'message':<{width}}  {'count':>9}  {'rate':>10}"]
    for name, message in log.messages.items():
        rate = "-" if message.rate_hz is None else f"{message.rate_hz:.1f} Hz"
        lines.append(f"{name:<{width}}  {message.count:>9}  {rate:>10}")
    span = log.time_s.max() - log.time_s.min() if len(log.time_s) else 0.0
    channels = ", ".join(log.recording.frames.channels) or "none"
    lines += [
        "",
        f"{log.frames} frames in {span:.1f} s (channels: {channels}): "
        f"{log.decoded} decoded, {log.unknown} unknown, {log.rejected} rejected",
    ]
    return lines


def _notes(log: DecodedLog, warnings: list[str]) -> list[str]:
    """What the reader should know beside the counts."""
    lines = [f"rejected: {count} {reason}" for reason, count in log.reasons.items()]
    lines += [f"  at byte {r.offset}: {r.text}" for r in log.recording.first_rejected]
    if log.recording.truncated_at is not None:
        lines.append(f"the file is cut off at byte {log.recording.truncated_at}")
    if log.unknown_ids:
        shown = ", ".join(f"{name} ({count})" for name, count in log.unknown_ids.most_common(SHOWN))
        more = len(log.unknown_ids) - SHOWN
        lines.append(f"unknown: {shown}{f', and {more} more' if more > 0 else ''}")
    lines += [f"database: {warning}" for warning in warnings[:SHOWN]]
    if len(warnings) > SHOWN:
        lines.append(f"database: and {len(warnings) - SHOWN} more warnings (all of them with --json)")
    return lines
