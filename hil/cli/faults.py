"""``brakebench faults``: every fault of the library at many instants of a stop, held against the budgets."""

import argparse
import json
import os
from typing import TYPE_CHECKING

from hil.cli.columns import columns, say, terminal_width, wrapped
from hil.cli.options import add_json, add_seed

if TYPE_CHECKING:
    from hil.validation.fault_campaign.campaign import Campaign
    from hil.validation.fault_campaign.table import Row


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "faults",
        help="every fault at many instants of a stop, beside the stop without it, against the budgets",
        description="Drives a stop from 72 km/h with every fault of the library on its usual targets at many instants, "
        "in virtual time, beside the same stop without the fault; then two faults at once, the rows that depend on "
        "the time-out at longer ones, and faults of real processes. Prints what was missed, and what physics forbids.",
        epilog="Exit codes: 0 no miss but those with a physical bound, 1 misses, 2 wrong use. More: "
        "docs/fault-campaign.md.",
    )
    parser.add_argument(
        "--instants", type=_positive, default=200, metavar="N", help="instants of every row (default: 200)"
    )
    parser.add_argument(
        "--only", action="append", default=[], metavar="NAME", help="one fault (or `pair`), a line for each target; "
        "may be given again"
    )  # fmt: skip
    parser.add_argument("--no-processes", action="store_true", help="leave out the faults of real processes")
    add_seed(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"expected a whole number, 1 or more, got {text!r}")
    return int(text)


def run(args: argparse.Namespace) -> int:
    """Drive, judge, print."""
    from hil.cli.progress import Progress
    from hil.validation.fault_campaign.campaign import drive_campaign

    with Progress() as progress:
        progress.part(0, "stops with faults")
        campaign = drive_campaign(args.instants, args.seed, os.cpu_count() or 1, progress, args.only)
    if args.json:
        say([json.dumps(campaign.as_json() | {"verdict": "passed" if campaign.passed else "failed"}, indent=2)])
    else:
        say(_lines(campaign, by_target=bool(args.only), width=max(terminal_width(), 100)))
    return 0 if campaign.passed else 1


def _lines(campaign: "Campaign", by_target: bool, width: int) -> list[str]:
    from hil.validation.fault_campaign.table import merged
    from hil.validation.fault_campaign.text import at_timeouts, legend, missed, verdict

    lines = _table(campaign.rows if by_target else merged(campaign.rows), by_target, width)
    if campaign.pairs:
        lines += ["", "two faults at once", *_table(campaign.pairs, True, width)]
    if campaign.timeouts:
        own = next(iter(campaign.timeouts))
        lines += ["", f"at time-outs of the controller of {', '.join(map(str, campaign.timeouts))} ms ({own} ms is its "
                  "own): maxima"]  # fmt: skip
        lines += columns(*at_timeouts(campaign.timeouts), width)
    lines += ["", *wrapped(legend(), width, "")]
    sentences = [missed(found, row) for row in campaign.judged for found in sorted(row.found, key=lambda f: f.bound)]
    lines += [""] + [line for sentence in sorted(sentences) for line in wrapped(sentence, width)]
    return [*lines, ""] + [line for sentence in verdict(campaign) for line in wrapped(sentence, width)]


def _table(rows: "list[Row]", by_target: bool, width: int) -> list[str]:
    from hil.validation.fault_campaign.text import HEADS, cells

    named = [cells(row, f"{row.fault} {row.target}" if by_target else row.fault) for row in rows]
    return columns(HEADS, named, width)
