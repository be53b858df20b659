"""``brakebench bus-analysis``: load and worst-case responses of the messages of a database."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.cli.columns import columns, say, terminal_width, wrapped
from hil.cli.options import add_json
from hil.errors import BrakebenchError

if TYPE_CHECKING:
    from dbc.database_values import Database
    from hil.bus.timed.analysis import BusAnalysis

_HEADS = ("id", "message", "sender", "bytes", "cycle ms", "frame us", "blocked us", "worst ms", "of cycle", "")


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "bus-analysis",
        description="Bus load, and by which time each message arrives at the latest (Davis et al. 2007), for any "
        "database with cycle times. The deadline of a message is its cycle time.",
        epilog="Exit codes: 0 every deadline is met, 1 one is missed, 2 unusable. More: docs/bus-timing.md.",
    )
    parser.add_argument("dbc", type=Path, metavar="DBC", help="database of one bus: DBC, ARXML, KCD or SYM")
    parser.add_argument(
        "--bitrate",
        metavar="RATE[/DATA]",
        help="bit/s (default: what the database states); with DATA, CAN FD frames switch to that",
    )
    parser.add_argument(
        "--jitter", type=float, default=0.0, metavar="MS", help="queueing jitter of every message, ms (default: 0)"
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Analyse and print."""
    from hil.bus.timed.analysis import analyse
    from hil.log.foreign.database_files import read_database

    if not 0.0 <= args.jitter < 1e6:
        raise BrakebenchError(f"--jitter {args.jitter:g}: expected milliseconds, 0 or more")
    database = read_database(args.dbc)
    bit_rate, data_bit_rate = _rates(args.bitrate, database)
    analysis = analyse(database, bit_rate, data_bit_rate, round(args.jitter * 1e6))
    if not analysis.messages:
        raise BrakebenchError(
            f"{args.dbc}: none of its {len(database.messages)} messages can be analysed: {analysis.left_out[0][1]}; "
            "give a database with cycle times (attribute GenMsgCycleTime of a DBC)"
        )
    if args.json:
        facts = {"database": str(args.dbc), "bit_rate": bit_rate, "data_bit_rate": data_bit_rate}
        facts |= {"jitter_ms": args.jitter} | _values(analysis) | {"warnings": database.warnings}
        say([json.dumps(facts, indent=2)])
    else:
        say(_lines(analysis, str(args.dbc), bit_rate, data_bit_rate, args.jitter, terminal_width()))
    return 1 if analysis.missed else 0


def _rates(word: str | None, database: "Database") -> tuple[int, int | None]:
    if word is not None:
        from hil.cli.log_options import bit_rates

        ((channel, (bit_rate, data_bit_rate)),) = bit_rates([word]).items()
        if channel or bit_rate is None:
            raise BrakebenchError(f"--bitrate {word}: a database is of one bus; give the rate alone, as 500000")
        return bit_rate, data_bit_rate
    if database.bit_rate is None:
        raise BrakebenchError(f"{database.source}: it states no bit rate; give --bitrate, as 500000")
    return database.bit_rate, None


def _values(analysis: "BusAnalysis") -> dict[str, Any]:
    messages = [
        {
            "name": one.message.name,
            "id": one.message.can_id,
            "extended": one.message.extended,
            "sender": one.message.sender,
            "fd": one.message.is_fd,
            "bytes": len(one.frame.data),
            "cycle_ms": one.period_ns / 1e6,
            "frame_us": one.transmission_ns / 1e3,
            "blocking_us": one.response.blocking_ns / 1e3,
            "response_ms": None if one.response.response_ns is None else one.response.response_ns / 1e6,
            "missed": one.missed,
        }
        for one in analysis.messages
    ]
    left_out = [{"name": m.name, "id": m.can_id, "extended": m.extended, "reason": why} for m, why in analysis.left_out]
    return {"load": analysis.load, "missed": analysis.missed, "messages": messages, "left_out": left_out}


def _lines(
    analysis: "BusAnalysis", source: str, bit_rate: int, data_bit_rate: int | None, jitter_ms: float, width: int
) -> list[str]:
    rows = []
    for one in analysis.messages:
        bound_ns = one.response.response_ns
        rows.append(
            (
                f"{one.message.can_id:0{8 if one.message.extended else 3}X}",
                one.message.name,
                one.message.sender,
                str(len(one.frame.data)),
                f"{one.period_ns / 1e6:g}",
                f"{one.transmission_ns / 1e3:.1f}",
                f"{one.response.blocking_ns / 1e3:.1f}",
                "no bound" if bound_ns is None else f"{bound_ns / 1e6:.3f}",
                "" if bound_ns is None else f"{bound_ns / one.period_ns:.0%}",
                "MISSED" if one.missed else "",
            )
        )
    rates = f"{bit_rate / 1e3:g} kbit/s" + (f", data {data_bit_rate / 1e3:g} kbit/s" if data_bit_rate else "")
    count = len(analysis.messages)
    lines = wrapped(f"{source}: {count} messages with a cycle time at {rates}, load {analysis.load:.1%}", width)
    lines += ["", *columns(_HEADS, rows, width, left=(0, 1, 2, 9)), ""]
    jitter = f", {jitter_ms:g} ms of jitter" if jitter_ms else ""
    lines += wrapped(
        "worst: from the event to the end of the frame, every frame with all stuff bits it may need, no bit errors"
        f"{jitter}; transmit queues by priority.",
        width,
    )
    for message, why in analysis.left_out:
        lines += wrapped(f"left out: {message.name} ({message.can_id:X}): {why}", width)
    if analysis.load >= 1.0:
        lines += wrapped("the bus is overloaded: there is no bound for the least urgent messages", width)
    missed = analysis.missed
    lines.append(f"{missed} of {count} deadlines missed" if missed else f"all {count} deadlines are met")
    return lines
