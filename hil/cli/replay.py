"""``brakebench replay``: a recorded log back on a bus."""

import argparse
import json
import math
import re
import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.bench.playback import LATE_NS, Replay
from hil.bench.replay_selection import ALL, ReplayError, Selection, select
from hil.cli.log_options import add_databases
from hil.cli.options import add_bus, add_json, add_transmit, seconds
from hil.errors import INTERRUPTED_EXIT_CODE, Verdict
from hil.log.frames import MAX_EXTENDED_ID
from hil.log.samples import log_path

if TYPE_CHECKING:
    from hil.log.signals.databases import Databases

MOST_SUPERSEDED = 0.01
"""Share of the frames that a stall may leave out before the replay says nothing of what hears it; a choice."""


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "replay",
        description="Send a recorded log back on a bus, each frame at its own time. The channels vehicle and bench of "
        "our own recordings go to the buses of these names, a foreign log's only channel goes to the vehicle bus. "
        "More: docs/logs.md.",
        epilog="The bus is listened to first: an identifier that somebody else sends is never sent (exit code 2 before "
        "the start; during the replay that sender's messages are no longer sent: exit code 5, incomplete, at the end). "
        "After a stall overdue frames are sent at once, but no more than 20 ms of the past of each cyclic message.",
    )
    parser.add_argument("log", type=log_path, metavar="LOG", help="candump, ASC, BLF, TRC, MF4, CSV or Parquet log")
    add_bus(parser)
    parser.add_argument(
        "--role",
        default=ALL,
        metavar="ROLE",
        help="send only what this role sends: plant (so that a live ECU is driven) or ecu, by our DBC, or nodes of the "
        "database, parted by commas (default: all)",
    )
    parser.add_argument(
        "--map",
        type=_mapped,
        action="append",
        default=[],
        metavar="CHANNEL=BUS",
        help="the log's channel goes to this bus: vehicle, bench, or one of its own (can1=socketcan:can1); repeatable; "
        "channels that are not named are left out",
    )
    add_databases(parser)
    parser.add_argument(
        "--from",
        dest="begin",
        metavar="TIME",
        help="from here on: seconds from the log's first frame, or date and time",
    )
    parser.add_argument("--to", dest="end", metavar="TIME", help="up to here, included")
    parser.add_argument(
        "--max-gap",
        type=seconds,
        metavar="S",
        help="shorten longer pauses of what is sent to so many seconds of the log",
    )
    parser.add_argument("--loop", action="store_true", help="begin again at the end, until Ctrl-C")
    parser.add_argument(
        "--wait-for",
        metavar="ID",
        help="start with the first frame of this identifier (hexadecimal: 0x1A0) or message on the bus",
    )
    add_transmit(parser)
    parser.add_argument("--speed", type=_speed, default=1.0, metavar="X", help="2 is twice as fast (default: 1)")
    add_json(parser)
    parser.set_defaults(run=run)


def _speed(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.001 <= value <= 1000.0:
        raise argparse.ArgumentTypeError(f"expected a number from 0.001 to 1000, got {text!r}")
    return value


def _mapped(text: str) -> tuple[str, str]:
    channel, _, bus = text.partition("=")
    if not channel or not bus:
        raise argparse.ArgumentTypeError(f"expected CHANNEL=BUS, as can1=vehicle or can1=socketcan:can1, got {text!r}")
    return channel, bus


def _identifier(text: str, known: "Databases") -> int:
    """Identifier of ``--wait-for``."""
    for message in known.messages():
        if message.name == text:
            return message.can_id
    # 714 would be decimal to one reader and hexadecimal to the next
    if not re.fullmatch(r"0[xX][0-9a-fA-F]+", text) or int(text, 16) > MAX_EXTENDED_ID:
        raise ReplayError(
            f"--wait-for {text}: expected an identifier in hexadecimal with 0x, as 0x1A0, or a message of the database"
        )
    return int(text, 16)


def run(args: argparse.Namespace) -> int:
    """Replay until the log ends or somebody says stop."""
    from datetime import UTC

    from dbc.frame import BusName
    from hil.bus.channel import bench_channel, resolve
    from hil.bus.open import open_bus
    from hil.bus.transmit import check_transmit
    from hil.cli.log_options import databases
    from hil.log.choice import Choice, Moment
    from hil.log.read import read_log
    from hil.log.signals.databases import Databases
    from hil.rt.clock import WallClock
    from hil.rt.process import StopSignal
    from hil.rt.realtime import request_timer_slack

    spec = resolve(args.bus)
    named = {str(BusName.VEHICLE): spec, str(BusName.BENCH): bench_channel(spec)}
    for bus in (spec, *(named.get(bus) or resolve(bus) for _, bus in args.map)):
        check_transmit(bus, args.transmit, "a replay sends")
    known = databases(args.dbc)[0] if args.dbc else None
    wait_for = None if args.wait_for is None else _identifier(args.wait_for, known or Databases.own())
    begin, end = (None if text is None else Moment.parse(text, UTC) for text in (args.begin, args.end))
    stop = StopSignal()
    recording = read_log(args.log)
    for problem in recording_problems(recording.rejected, recording.truncated_at):
        _say(f"{args.log}: {problem}")
    gap_ns = None if args.max_gap is None else round(args.max_gap * 1e9)
    selection = select(recording, args.role, dict(args.map), known, Choice(begin=begin, end=end), gap_ns)
    used = dict.fromkeys(identity.bus for identity in selection.identities)
    specs = {bus: named.get(bus) or resolve(bus) for bus in used}
    if len(set(specs.values())) < len(specs):
        raise ReplayError(f"--map: {' and '.join(specs)} are one bus; name it once, as vehicle where it is --bus")
    request_timer_slack()
    with ExitStack() as stack:
        kinds = {bus: BusName.BENCH if bus == BusName.BENCH else BusName.VEHICLE for bus in specs}
        buses = {bus: stack.enter_context(open_bus(specs[bus], kinds[bus])) for bus in specs}
        replay = Replay(selection, buses, WallClock(), args.speed, lambda: stop.asked, args.loop, wait_for)
        replay.listen()
        if wait_for is not None:
            _say(f"waiting for 0x{wait_for:X}")
            replay.wait()
        n, whole_s = len(selection.time_ns), selection.time_ns[-1] * 1e-9 / args.speed
        again = ", again and again" if args.loop else ""
        on = ", ".join(specs.values())
        if not stop.asked:
            _say(f"replaying {n} frames of {args.log} as {args.role} on {on}: {whole_s:.1f} s{again}")
        replay.run()
    facts = result(args, on, len(recording.frames), selection, replay)
    if args.json:
        print(json.dumps(facts, indent=2))
    else:
        _print_text(facts)
    if stop.interrupted and not args.loop:  # which ends in no other way
        return INTERRUPTED_EXIT_CODE
    return Verdict(facts["verdict"]).exit_code


def recording_problems(rejected: int, truncated_at: int | None) -> list[str]:
    """What of the log could not be read."""
    problems = [f"{rejected} lines or objects are no frames and were left out"] if rejected else []
    return problems + ([f"cut off at byte {truncated_at}"] if truncated_at is not None else [])


def result(args: argparse.Namespace, spec: str, in_log: int, selection: Selection, replay: Replay) -> dict[str, Any]:
    """Return what ``--json`` prints."""
    late_ms = replay.lateness_ns * 1e-6
    p50, p99 = np.percentile(late_ms, (50, 99)).tolist() if late_ms.size else (None, None)
    stopped = not args.loop and replay.dealt < len(selection.time_ns)
    verdict, reason = judge(replay, stopped)
    return {
        "verdict": verdict.value,
        "reason": reason,
        "log": str(args.log),
        "bus": spec,
        "role": args.role,
        "speed": args.speed,
        "frames_in_log": in_log,
        "left_out": selection.left_out,
        "selected": len(selection.time_ns),
        "sent": replay.sent,
        "late": replay.late,
        "superseded": replay.superseded,
        "lateness_ms": {"p50": p50, "p99": p99, "max": replay.most_late_ns * 1e-6 if late_ms.size else None},
        "duration_s": replay.duration_ns * 1e-9,
        "log_duration_s": float(selection.time_ns[-1]) * 1e-9,
        "gaps_shortened": selection.gaps,
        "shortened_s": selection.cut_ns * 1e-9,
        "rounds": replay.rounds,
        "refused": [
            {"bus": str(i.bus), "id": i.can_id, "message": i.message, "sender": i.sender, "frames": count}
            for i, count in replay.refused.items()
        ],
        "live": [str(identity) for identity in replay.intruders],
        "link_events": {str(state): number for state, number in replay.link_events.items()},
        "stopped": stopped,
    }


def judge(replay: Replay, stopped: bool) -> tuple[Verdict, str]:
    """How a replay is judged, stopped before its end or not, and why."""
    reasons = [f"somebody else sends {replay.intruders[0]}"] if replay.intruders else []
    reasons += ["stopped before the end of the log"] if stopped else []
    if reasons:
        return Verdict.INCOMPLETE, "; ".join(reasons)
    if replay.superseded > MOST_SUPERSEDED * replay.dealt:
        return Verdict.INCONCLUSIVE, f"{replay.superseded} frames were left out after stalls of this machine"
    return Verdict.PASSED, ""


def _print_text(facts: dict[str, Any]) -> None:
    """Print what happened."""
    from hil.report.report import Number, Report
    from hil.report.text import print_text

    refused = sum(row["frames"] for row in facts["refused"])
    lateness = facts["lateness_ms"]
    whole = facts["log_duration_s"] / facts["speed"]
    numbers = [
        Number(
            "Frames sent", facts["sent"], note=f"of {facts['selected']} selected, {facts['frames_in_log']} in the log"
        ),
        Number(
            "Duration",
            round(facts["duration_s"], 3),
            "s",
            note=f"{whole:.3f} s{' a round' if facts['rounds'] > 1 else ''} by the log and the speed",
        ),
        Number("Lateness, median", lateness["p50"], "ms"),
        Number("Lateness, 99th percentile", lateness["p99"], "ms"),
        Number("Lateness, largest", lateness["max"], "ms"),
        Number("Frames late", facts["late"], note=f"by more than {LATE_NS * 1e-6:g} ms"),
        Number("Frames superseded", facts["superseded"], note="older ones after a stall"),
        Number("Frames refused", refused, note="their sender is live on the bus"),
    ]
    if facts["gaps_shortened"]:
        numbers.append(
            Number("Gaps shortened", facts["gaps_shortened"], note=f"by {facts['shortened_s']:.3f} s in all")
        )
    if facts["rounds"] > 1:
        numbers.append(Number("Whole rounds", facts["rounds"]))
    numbers += [Number(f"Left out: {reason}", count) for reason, count in facts["left_out"].items()]
    numbers += [Number(f"Link: {state}", number) for state, number in facts["link_events"].items()]
    title = f"Replay of {facts['log']} as {facts['role']} on {facts['bus']}"
    print_text(Report(title, Verdict(facts["verdict"]), facts["reason"], tuple(numbers)), sys.stdout)


def _say(text: str) -> None:
    print(text, file=sys.stderr)
