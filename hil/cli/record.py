"""``brakebench record``: everything on a bus to a candump file, or what surrounds a condition."""

import argparse
import contextlib
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from dbc.frame import BusName
from hil.bench.recorder import FLUSH_PERIOD_NS, Recorder, RecorderError, Source
from hil.bus.channel import bench_channel
from hil.bus.open import open_bus
from hil.bus.transmit import open_for_role
from hil.cli.options import add_bus, add_ready_fd, seconds
from hil.errors import BrakebenchError, Verdict
from hil.faults.line import FaultyListener
from hil.rt.clock import WallClock
from hil.rt.loop import Loop
from hil.rt.process import StopSignal, end_with_parent, say_ready

TOLD_S = 1.0  # more than a clock that is kept right drifts in a recording
AROUND_S = 5.0  # kept before and after a trigger where nobody says; a choice: a stop and what led to it
MOST_S = 600.0  # ten minutes: beyond it an ordinary recording is the better one


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "record",
        description="Append every frame on a bus to a candump file. With --trigger the last seconds are kept in "
        "memory, and each time the condition begins to hold they are written, with the next ones, to FILE-1.log, "
        "FILE-2.log, ...",
        epilog="Conditions: BRAKE_STATUS.MODE == SAFE_STOP, BRAKE_TROUBLE_CODE.TROUBLE_CODE != 0 (a code is set), "
        "BRAKE_STATUS.ACTIVE_FAULTS & PEDAL_1 (a bit), 0x7E8 or BRAKE_STATUS (such a frame comes); terms are joined by "
        "and. More: docs/logs.md.",
    )
    parser.add_argument("out", type=Path, metavar="FILE", help="file to create (candump format)")
    add_bus(parser)
    parser.add_argument(
        "--trigger",
        action="append",
        default=[],
        metavar="CONDITION",
        help="write only around this; repeatable: any of them",
    )
    around = partial(seconds, most_s=MOST_S)
    parser.add_argument(
        "--before", type=around, metavar="S", help=f"seconds before the trigger (default: {AROUND_S:g})"
    )
    parser.add_argument("--after", type=around, metavar="S", help=f"seconds after it (default: {AROUND_S:g})")
    parser.add_argument("--count", type=_count, metavar="N", help="end after so many files (default: at Ctrl-C)")
    # as of `hil.cli.log_options`, which loads all that reads logs
    parser.add_argument("--dbc", metavar="[BUS=]FILE", action="append", default=[], help="database of the conditions")
    add_ready_fd(parser)
    parser.set_defaults(run=run)


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a number, 1 or more, got {text!r}")
    return int(text)


def run(args: argparse.Namespace) -> int:
    """Record until Ctrl-C or SIGTERM."""
    unused = [f"--{name}" for name in ("before", "after", "count", "dbc") if getattr(args, name) not in (None, [])]
    if unused and not args.trigger:
        raise BrakebenchError(f"record: {', '.join(unused)} without --trigger")
    if args.ready_fd is not None:
        end_with_parent()
    stop = StopSignal()
    with contextlib.ExitStack() as stack:
        with stop.at_once():
            vehicle = stack.enter_context(open_for_role(args.bus, BusName.VEHICLE, transmit=False, optional=False))
            bench = stack.enter_context(open_bus(bench_channel(args.bus), BusName.BENCH))
        sources: list[Source] = [vehicle, FaultyListener(bench, ("RECORDER",))]
        return _record_around(args, sources, stop) if args.trigger else _record_all(args, sources, stop)


def _record_all(args: argparse.Namespace, sources: Sequence[Source], stop: StopSignal) -> int:
    try:
        recorder = Recorder(args.out, sources)
    except RecorderError as error:  # nothing has begun: wrong use
        raise BrakebenchError(str(error)) from error
    try:
        with stop.at_once():
            say_ready(args.ready_fd)
        for _ in Loop(WallClock(), FLUSH_PERIOD_NS).ticks():
            recorder.flush()
            if stop.asked:
                break
    finally:
        recorder.close()
    lines = recorder.lines
    _tell_clock(lines.clock_set_ns())
    _say(f"{lines.frames} frames recorded to {args.out}{_lost(lines.lost)}")
    return 0


def _record_around(args: argparse.Namespace, sources: Sequence[Source], stop: StopSignal) -> int:
    from hil.bench.trigger import Trigger
    from hil.bench.trigger_recorder import TriggerRecorder
    from hil.cli.log_options import databases

    before_ns, after_ns = (round((AROUND_S if s is None else s) * 1e9) for s in (args.before, args.after))
    try:
        trigger = Trigger(args.trigger, databases(args.dbc)[0])
        recorder = TriggerRecorder(args.out, sources, trigger, before_ns, after_ns, _say, most_files=args.count)
    except RecorderError as error:
        raise BrakebenchError(str(error)) from error
    clock = WallClock()
    begun_ns = clock.now_ns()
    try:
        with stop.at_once():
            say_ready(args.ready_fd)
        _say(f"waiting for {' or '.join(args.trigger)}")
        for _ in Loop(clock, FLUSH_PERIOD_NS).ticks():
            recorder.flush(clock.now_ns())
            if stop.asked or recorder.done:
                break
    finally:
        recorder.close(clock.now_ns())
    lines, files = recorder.lines, len(recorder.files)
    _tell_clock(lines.clock_set_ns())
    heard = f"{lines.frames} frames in {(clock.now_ns() - begun_ns) * 1e-9:.1f} s{_lost(lines.lost)}"
    if not recorder.triggers:
        _say(f"never triggered, nothing written; heard {heard}")
    else:
        _say(f"triggered {recorder.triggers} times, {files} files written; heard {heard}")
    if recorder.shortened_ns:
        _say(f"memory was full: up to {recorder.shortened_ns * 1e-9:.1f} s before a trigger are missing")
    short = args.count is not None and files < args.count
    return Verdict.INCOMPLETE.exit_code if short else Verdict.PASSED.exit_code


def _lost(lost: int) -> str:
    return f", {lost} lost on the way" if lost else ""


def _tell_clock(set_ns: int) -> None:
    if abs(set_s := set_ns * 1e-9) > TOLD_S:
        _say(f"the time of day was set by {set_s:+.1f} s meanwhile; stamps go on from the start's")


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
