"""``brakebench decode``: what a log holds, every frame accounted for, and its signals as tables."""

import argparse
import json
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from hil.cli.columns import say, terminal_width
from hil.cli.log_options import (
    LOGS,
    add_databases,
    add_force,
    add_timezone,
    bit_rates,
    check_found,
    databases,
    paths,
    unused,
    words_of,
)
from hil.cli.log_pages import add_page, check_page, decode_report, write_page
from hil.cli.progress import Progress
from hil.cli.summary_json import summary_values
from hil.cli.summary_text import summary_lines
from hil.errors import BrakebenchError
from hil.log.account import printable
from hil.log.atomic_write import check_folder
from hil.log.choice import Choice, Moment
from hil.log.export.blocks import Block, Field, Layout, blocks_of
from hil.log.several import Logs
from hil.log.source import ReadOptions
from hil.log.summary.contents import Contents
from hil.log.summary.values import Summary

_NOT_WITH = ("out", "messages", "signals", "resample", "names", "bitrate", "dbc", "e2e_legacy", "page")  # --uds


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "decode",
        description="Summarise a CAN log and decode it into signals; every frame is accounted for.",
        epilog="Without --dbc our own databases are used: bench.dbc for a channel named bench, brake.dbc for others. "
        "Exit codes: 0 the whole log was read; 1 something of it was cut off, rejected or shorter than its message; "
        "2 unusable. More: docs/logs.md.",
    )
    parser.add_argument("log", metavar="LOG", nargs="+", help=f"{LOGS}; several, or a quoted pattern, are one log")
    add_databases(parser)
    parser.add_argument(
        "--out", metavar="FILE", help="write signals: FILE.csv, FILE.parquet, FILE.mf4, FILE.mcap or FOLDER/"
    )
    add_force(parser)
    parser.add_argument("--messages", metavar="GLOB,...", action="append", default=[], help="only these messages")
    parser.add_argument(
        "--signals", metavar="GLOB,...", action="append", default=[], help="only these: MESSAGE.SIGNAL or SIGNAL"
    )
    parser.add_argument("--channel", metavar="NAME", action="append", default=[], help="only this channel (repeatable)")
    parser.add_argument("--from", dest="begin", metavar="TIME", help="seconds from the first frame, or a date and time")
    parser.add_argument("--to", dest="end", metavar="TIME", help="likewise; both ends are included")
    parser.add_argument("--resample", metavar="SECONDS", type=float, help="one raster, the last value held")
    parser.add_argument("--names", action="store_true", help="write a column of value names beside the numbers")
    add_timezone(parser)
    parser.add_argument(
        "--bitrate", metavar="[CHANNEL=]RATE[/DATA]", action="append", default=[], help="bit/s, for the bus load"
    )
    add_page(parser)
    parser.add_argument("--limit-mb", metavar="N", type=float, help="read at most so much of each log (unpacked)")
    parser.add_argument("--e2e-legacy", action="store_true", help="check by the check value of older recordings")
    _add_uds(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Summarise, write the signals, say what is missing."""
    _check_uds(args)
    choice = _choice(args)
    if args.uds:
        from hil.cli.decode_uds import run_uds  # the names of our ECU take as long to load as a small log

        return run_uds(args, choice, _limit_bytes(args))
    databases_, files = databases(args.dbc)
    wanted = choice.wanted(databases_)
    rates = bit_rates(args.bitrate)
    contents = Contents(databases_, wanted, rates, args.e2e_legacy)
    _check_out(args)
    check_page(args.page, args.force)
    limit = _limit_bytes(args)
    warnings = (*databases_.warnings, *(w for one in databases_.all() for w in one.warnings))
    with (
        Logs(paths(args.log), ReadOptions(timezone=args.timezone), limit) as logs,
        Progress(1 if args.out is None else 2) as progress,
    ):
        for table in choice.frames(logs.tables(progress)):
            contents.add(table)
        summary = contents.summary()
        check_found(choice, summary.frames, logs)
        named = {"--channel": choice.channels, "--bitrate": filter(None, rates), "--dbc": databases_.by_channel}
        if not args.dbc:
            del named["--dbc"]
        logs.notes += [note for option, names in named.items() for note in unused(option, names, logs)]
        if summary.backwards is not None and not choice.of_frames:
            line = logs.line_of(summary.backwards.frame - 1)
            summary = replace(summary, backwards=replace(summary.backwards, line=line))
        rows = None
        if args.out is not None and summary.frames:
            progress.part(1, "writing")
            blocks = blocks_of(choice.frames(logs.tables(progress)), databases_.decoder(wanted))
            rows = _write(args, blocks, contents, summary, [*files, *(part.path for part in logs.parts)])
    values = summary_values(logs, contents, summary, warnings) if args.json or args.page else {}
    if args.page is not None and summary.frames:
        whole = logs.whole and not contents.counts.rejected
        read = [*files, *(part.path for part in logs.parts)]
        write_page(decode_report(values, whole), args.page, args.force, read)
    if args.json:
        say([json.dumps(values | {"out": args.out, "rows": rows}, allow_nan=False)])
    else:
        lines = summary_lines(logs, contents, summary, args.timezone, terminal_width(), warnings)
        if rows is not None:
            lines += ["", f"signals: {printable(args.out)} ({rows:,} rows, {len(contents.signals)} signals)"]
        say(lines)
    return _exit_code(logs, contents, summary)


def _add_uds(parser: argparse.ArgumentParser) -> None:
    """``--uds`` and its identifiers."""
    parser.add_argument("--uds", action="store_true", help="print diagnostic requests and answers (UDS over ISO-TP)")
    parser.add_argument(
        "--uds-ids",
        metavar="REQUEST:ANSWER,...",
        action="append",
        default=[],
        help="identifiers of diagnostics, hexadecimal (714:77E, 18DA01F1:18DAF101, or one alone for requests to all); "
        "otherwise they are found: the standard ones, ours, and pairs on which requests are answered",
    )


def _check_uds(args: argparse.Namespace) -> None:
    """Refuse options that have no meaning with or without ``--uds``."""
    if not args.uds:
        if args.uds_ids:
            raise BrakebenchError("--uds-ids says where diagnostics are; give --uds as well")
        return
    for name in _NOT_WITH:
        if getattr(args, name):
            option = f"--{name.replace('_', '-')}"
            raise BrakebenchError(f"{option}: --uds prints messages of diagnostics, not signals; leave {option} out")


def _choice(args: argparse.Namespace) -> Choice:
    begin, end = (None if text is None else Moment.parse(text, args.timezone) for text in (args.begin, args.end))
    return Choice(tuple(args.channel), begin, end, words_of(args.messages), words_of(args.signals))


def _limit_bytes(args: argparse.Namespace) -> int | None:
    if args.limit_mb is None:
        return None
    if not 0 < args.limit_mb < 1e9:
        raise BrakebenchError(f"--limit-mb {args.limit_mb:g}: expected a number of megabytes above 0")
    return int(args.limit_mb * 1_000_000)


def _check_out(args: argparse.Namespace) -> None:
    if args.out is not None:
        from hil.log.export.messages import check_target

        check_target(args.out)
        if not args.out.endswith("/"):
            check_folder(Path(args.out))
        if Path(args.out).exists() and not args.force:
            raise BrakebenchError(f"{args.out}: exists already; use --force to replace it, or give another name")
    elif args.resample is not None or args.names:
        raise BrakebenchError("--resample and --names say how signals are written; give --out as well")
    if args.resample is not None and not 1e-9 <= args.resample < 1e9:
        raise BrakebenchError(f"--resample {args.resample:g}: expected a step above 0 in seconds, 0.01 for 10 ms")


def _write(
    args: argparse.Namespace, blocks: Iterable[Block], contents: Contents, summary: Summary, read: list[Path]
) -> int:
    from hil.log.export.messages import write_signals
    from hil.log.export.resample import raster_rows, resampled

    fields = tuple(Field(one.message, one.signal, one.dtype) for one in contents.signals.values())
    several = contents.counts.several_channels and args.resample is None
    rows = summary.frames
    if args.resample is not None:
        raster = summary.first_ns, summary.last_ns, round(args.resample * 1e9)
        rows, blocks = raster_rows(*raster), resampled(blocks, fields, *raster)
    layout = Layout(fields, several, args.names, summary.first_ns, contents.channel_of(), rows)
    return write_signals(blocks, layout, args.out, args.force, read)


def _exit_code(logs: Logs, contents: Contents, summary: Summary) -> int:
    """0 whole; 1 something of the log is missing; 2 no frame could be read."""
    if not summary.frames:
        print("brakebench: no frame could be read; give a CAN log", file=sys.stderr)
        return 2
    return 0 if logs.whole and not contents.counts.rejected else 1
