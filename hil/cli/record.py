"""``brakebench record``: append everything on a bus to a candump file."""

import argparse
import contextlib
import sys
from pathlib import Path

from dbc.frame import BusName
from hil.bench.recorder import FLUSH_PERIOD_NS, Recorder, RecorderError
from hil.bus.channel import bench_channel
from hil.bus.open import open_bus
from hil.bus.transmit import open_for_role
from hil.cli.options import add_bus, add_ready_fd
from hil.errors import BrakebenchError
from hil.faults.line import FaultyListener
from hil.rt.clock import WallClock
from hil.rt.loop import Loop
from hil.rt.process import StopSignal, end_with_parent, say_ready

TOLD_S = 1.0  # more than a clock that is kept right drifts in a recording


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("record", help="append every frame on a bus to a candump file")
    parser.add_argument("out", type=Path, metavar="FILE", help="file to create (candump format)")
    add_bus(parser)
    add_ready_fd(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Record until Ctrl-C or SIGTERM."""
    if args.ready_fd is not None:
        end_with_parent()
    stop = StopSignal()
    with contextlib.ExitStack() as stack:
        with stop.at_once():
            vehicle = stack.enter_context(open_for_role(args.bus, BusName.VEHICLE, transmit=False))
            bench = stack.enter_context(open_bus(bench_channel(args.bus), BusName.BENCH))
        try:
            recorder = Recorder(args.out, [vehicle, FaultyListener(bench, ("RECORDER",))])
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
    lost = f", {recorder.lost} lost on the way" if recorder.lost else ""
    if abs(set_s := recorder.clock_set_ns() * 1e-9) > TOLD_S:
        print(f"the time of day was set by {set_s:+.1f} s meanwhile; stamps go on from the start's", file=sys.stderr)
    print(f"{recorder.frames} frames recorded to {args.out}{lost}", file=sys.stderr)
    return 0
