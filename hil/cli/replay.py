"""``brakebench replay``: a recorded log back on a bus."""

import argparse
import json
import math
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from hil.bench.playback import LATE_NS, ROLES, Replay, Selection, select
from hil.cli.options import add_bus, add_json, add_transmit
from hil.errors import INTERRUPTED_EXIT_CODE, Verdict

MOST_SUPERSEDED = 0.01
"""Share of the frames that a stall may leave out before the replay says nothing of what hears it; a choice."""


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "replay",
        help="send a recorded log back on a bus",
        description="Send a recorded log back on a bus, each frame at its own time. The channels vehicle and bench of "
        "our own recordings go to the buses of these names, a foreign log's only channel goes to the vehicle bus.",
        epilog="The bus is listened to first: an identifier that somebody else sends is never sent (exit code 2 before "
        "the start; during the replay that sender's messages are no longer sent: exit code 5, incomplete, at the end). "
        "After a stall overdue frames are sent at once, but no more than 20 ms of the past of each cyclic message.",
    )
    parser.add_argument("log", type=Path, metavar="LOG", help="candump, ASC, BLF, TRC, MF4, CSV or Parquet log")
    add_bus(parser)
    parser.add_argument(
        "--role",
        choices=tuple(ROLES),
        default="all",
        help="send only what the plant (so that a live ECU is driven) or the ECU sends by our DBC (default: all)",
    )
    parser.add_argument("--channel", metavar="NAME", help="the log's channel that goes to the vehicle bus")
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


def run(args: argparse.Namespace) -> int:
    """Replay until the log ends or somebody says stop."""
    from dbc.frame import BusName
    from hil.bus.channel import bench_channel, resolve
    from hil.bus.open import open_bus
    from hil.bus.transmit import check_transmit
    from hil.log.read import read_log
    from hil.rt.clock import WallClock
    from hil.rt.process import StopSignal
    from hil.rt.realtime import request_timer_slack

    spec = resolve(args.bus)
    check_transmit(spec, args.transmit, "a replay sends")
    stop = StopSignal()
    recording = read_log(args.log)
    for problem in recording_problems(recording.rejected, recording.truncated_at):
        _say(f"{args.log}: {problem}")
    selection = select(recording, args.role, args.channel)
    used = {identity.bus for identity in selection.identities}
    request_timer_slack()
    with ExitStack() as stack:
        specs = {BusName.VEHICLE: spec, BusName.BENCH: bench_channel(spec)}
        buses = {bus: stack.enter_context(open_bus(specs[bus], bus)) for bus in BusName if bus in used}
        replay = Replay(selection, buses, WallClock(), args.speed, lambda: stop.asked)
        replay.listen()
        n, seconds = len(selection.time_ns), selection.time_ns[-1] * 1e-9 / args.speed
        _say(f"replaying {n} frames of {args.log} as {args.role} on {spec}: {seconds:.1f} s")
        replay.run()
    facts = result(args, spec, len(recording.frames), selection, replay)
    if args.json:
        print(json.dumps(facts, indent=2))
    else:
        _print_text(facts)
    if stop.interrupted:
        return INTERRUPTED_EXIT_CODE
    return Verdict(facts["verdict"]).exit_code


def recording_problems(rejected: int, truncated_at: int | None) -> list[str]:
    """What of the log could not be read."""
    problems = [f"{rejected} lines or objects are no frames and were left out"] if rejected else []
    return problems + ([f"cut off at byte {truncated_at}"] if truncated_at is not None else [])


def result(args: argparse.Namespace, spec: str, in_log: int, selection: Selection, replay: Replay) -> dict[str, Any]:
    """Return what ``--json`` prints."""
    served = replay.sent + replay.superseded + sum(replay.refused.values())
    late_ms = replay.lateness_ns * 1e-6
    p50, p99, most = np.percentile(late_ms, (50, 99, 100)).tolist() if late_ms.size else (None, None, None)
    verdict, reason = judge(selection, replay, served)
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
        "lateness_ms": {"p50": p50, "p99": p99, "max": most},
        "duration_s": replay.duration_ns * 1e-9,
        "log_duration_s": float(selection.time_ns[-1]) * 1e-9,
        "refused": [
            {"bus": str(i.bus), "id": i.can_id, "message": i.message, "sender": i.sender, "frames": count}
            for i, count in replay.refused.items()
        ],
        "live": [str(identity) for identity in replay.intruders],
        "link_events": {str(state): number for state, number in replay.link_events.items()},
        "stopped": served < len(selection.time_ns),
    }


def judge(selection: Selection, replay: Replay, served: int) -> tuple[Verdict, str]:
    """How a replay of which so many frames were dealt with is judged, and why."""
    reasons = [f"somebody else sends {replay.intruders[0]}"] if replay.intruders else []
    reasons += ["stopped before the end of the log"] if served < len(selection.time_ns) else []
    if reasons:
        return Verdict.INCOMPLETE, "; ".join(reasons)
    if replay.superseded > MOST_SUPERSEDED * len(selection.time_ns):
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
        Number("Duration", round(facts["duration_s"], 3), "s", note=f"{whole:.3f} s by the log and the speed"),
        Number("Lateness, median", lateness["p50"], "ms"),
        Number("Lateness, 99th percentile", lateness["p99"], "ms"),
        Number("Lateness, largest", lateness["max"], "ms"),
        Number("Frames late", facts["late"], note=f"by more than {LATE_NS * 1e-6:g} ms"),
        Number("Frames superseded", facts["superseded"], note="older ones after a stall"),
        Number("Frames refused", refused, note="their sender is live on the bus"),
    ]
    numbers += [Number(f"Left out: {reason}", count) for reason, count in facts["left_out"].items()]
    numbers += [Number(f"Link: {state}", number) for state, number in facts["link_events"].items()]
    title = f"Replay of {facts['log']} as {facts['role']} on {facts['bus']}"
    print_text(Report(title, Verdict(facts["verdict"]), facts["reason"], tuple(numbers)), sys.stdout)


def _say(text: str) -> None:
    print(text, file=sys.stderr)
