"""``brakebench faults``: every fault of the library at many instants of a stop, held against the budgets."""

import argparse
import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from hil.cli.columns import columns, say, terminal_width, wrapped
from hil.cli.options import add_json, add_seed, out_folder, positive
from hil.errors import BrakebenchError

if TYPE_CHECKING:
    from hil.validation.fault_campaign.campaign import Campaign
    from hil.validation.fault_campaign.table import Row


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "faults",
        description="Drives a stop from 72 km/h with every fault of the library on its usual targets at many instants, "
        "in virtual time, beside the same stop without the fault; then two faults at once, the rows that depend on "
        "the time-out at longer ones, and faults of real processes. Prints what was missed, and what physics forbids.",
        epilog="Exit codes: 0 no miss but those with a physical bound, 1 misses, 2 wrong use. More: "
        "docs/fault-campaign.md.",
    )
    parser.add_argument(
        "--instants", type=positive, default=200, metavar="N", help="instants of every row (default: 200)"
    )
    parser.add_argument(
        "--only", action="append", default=[], metavar="NAME", help="one fault (or `pair`), a line for each target; "
        "may be given again"
    )  # fmt: skip
    parser.add_argument("--no-processes", action="store_true", help="leave out the faults of real processes")
    parser.add_argument("--out", type=out_folder, metavar="DIR", help="write report.html")
    add_seed(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Drive, judge, print."""
    from hil.cli.progress import Progress
    from hil.validation.fault_campaign.campaign import drive_campaign
    from hil.validation.fault_campaign.processes import drive_processes

    if args.out is not None:
        try:  # before anything is driven
            args.out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BrakebenchError(f"{args.out}: cannot be written ({error.strerror}); give another folder") from error
    with Progress() as progress:
        progress.part(0, "stops with faults")
        campaign = drive_campaign(args.instants, args.seed, os.cpu_count() or 1, progress, args.only)
    if not (args.no_processes or args.only):
        campaign = replace(campaign, processes=drive_processes(args.seed, _tell))
    if args.out is not None:
        _write(campaign, args.out)
    if args.json:
        say([json.dumps(campaign.as_json() | {"verdict": "passed" if campaign.passed else "failed"}, indent=2)])
    else:
        say(_lines(campaign, by_target=bool(args.only), width=max(terminal_width(), 100)))
    return 0 if campaign.passed else 1


def _write(campaign: "Campaign", out: Path) -> None:
    from hil.cli.origin import with_origin
    from hil.report.html import write_html
    from hil.validation.fault_campaign.page import build_report

    write_html(with_origin(build_report(campaign)), out / "report.html")


def _tell(text: str) -> None:
    print(text, file=sys.stderr)


def _lines(campaign: "Campaign", by_target: bool, width: int) -> list[str]:
    from hil.validation.fault_campaign.table import merged
    from hil.validation.fault_campaign.text import at_timeouts, bounded, legend, missed, verdict

    lines = _table(campaign.rows if by_target else merged(campaign.rows), by_target, width)
    if campaign.pairs:
        lines += ["", "two faults at once", *_table(campaign.pairs, True, width)]
    if campaign.processes:
        lines += ["", "real processes, in real time", *_table(campaign.processes, True, width)]
    if campaign.timeouts:
        own = next(iter(campaign.timeouts))
        lines += ["", f"at time-outs of the controller of {', '.join(map(str, campaign.timeouts))} ms ({own} ms is its "
                  "own): maxima"]  # fmt: skip
        lines += columns(*at_timeouts(campaign.timeouts), width)
    lines += ["", *wrapped(legend(), width, "")]
    for sentences in (missed(campaign.judged), bounded(campaign.judged), verdict(campaign)):
        if sentences:
            lines += ["", *(line for sentence in sentences for line in wrapped(sentence, width))]
    return lines


def _table(rows: "list[Row]", by_target: bool, width: int) -> list[str]:
    from hil.validation.fault_campaign.text import HEADS, cells

    named = [cells(row, f"{row.fault} {row.target}" if by_target else row.fault) for row in rows]
    return columns(HEADS, named, width)
