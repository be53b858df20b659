"""``brakebench latency``: timing on the wire, of a live bus or of a log."""

import argparse
import json
import sys
from typing import TYPE_CHECKING, Any

from hil.cli.log_options import LOGS, add_databases
from hil.cli.options import add_json
from hil.errors import BrakebenchError
from hil.log.samples import log_path

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbc.frame import Frame
    from hil.bench.wire_timing import Cyclic, Response, Spread
    from hil.bus.bus import Bus
    from hil.bus.transmit import ListeningBus
    from hil.log.frames import FrameTable


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "latency",
        description="Measure stimulus to response and the jitter of every cyclic message against its cycle time, on a "
        "live bus, to which nothing is sent, or in a log.",
        epilog="Age: from the newest frame of the stimulus to each frame of the response. Reaction: from the frame "
        "with which a signal begins to move to the frame with which the other one does. More: docs/adapters.md.",
    )
    parser.add_argument("log", nargs="?", metavar="LOG", help=LOGS)
    parser.add_argument("--bus", metavar="BUS", help="listen to this bus instead")
    parser.add_argument("--for", dest="for_s", type=float, default=10.0, metavar="S", help="how long (default: 10)")
    parser.add_argument("--from", dest="stimulus", metavar="MESSAGE[.SIGNAL]", help="the stimulus (default: our own)")
    parser.add_argument("--to", dest="response", metavar="MESSAGE[.SIGNAL]", help="the response")
    add_databases(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure and print."""
    from hil.bench.wire_timing import OWN_PAIRS, TimingError, cyclic_messages, response_of
    from hil.cli.columns import say
    from hil.cli.log_options import databases

    if (args.log is None) == (args.bus is None):
        raise BrakebenchError("latency: expected a log or --bus BUS, one of them")
    if (args.stimulus is None) != (args.response is None):
        raise BrakebenchError("latency: --from and --to go together")
    known, _ = databases(args.dbc)
    frames, lost = _listen(args.bus, args.for_s) if args.log is None else (_read(args.log), None)
    if not len(frames):
        raise TimingError(f"latency: {args.log or args.bus}: not one frame")
    responses = []
    if args.stimulus is not None:
        responses.append(response_of(frames, known, args.stimulus, args.response))
    else:
        for stimulus, response in OWN_PAIRS:
            try:
                responses.append(response_of(frames, known, stimulus, response))
            except TimingError:  # not of this bus
                continue
    cyclic = cyclic_messages(frames, known)
    if args.json:
        print(json.dumps(_values(args, frames, lost, responses, cyclic), indent=2))
    else:
        say(_lines(responses, cyclic))
    return 0


def _read(log: str) -> "FrameTable":
    from hil.log.read import read_log

    return read_log(log_path(log)).frames


def _listen(spec: str, for_s: float) -> "tuple[FrameTable, int]":
    """What came, and how many frames were lost on the way here."""
    from dbc.frame import BusName
    from hil.bench.wire_timing import table_of
    from hil.bus.transmit import open_for_role
    from hil.rt.clock import WallClock
    from hil.rt.process import StopSignal

    if not 0.0 < for_s <= 3600.0:
        raise BrakebenchError(f"--for {for_s:g}: expected seconds above 0, at most 3600")
    stop, clock = StopSignal(), WallClock()
    with stop.at_once():
        bus = open_for_role(spec, BusName.VEHICLE, transmit=False, optional=False)
    with bus:
        _say(f"listening to {bus.name} for {for_s:g} s")
        end_ns = clock.now_ns() + round(for_s * 1e9)
        heard, lost = _hear(bus, lambda: not stop.asked and clock.now_ns() < end_ns)
    return table_of(heard), lost


def _hear(bus: "Bus | ListeningBus", goes_on: "Callable[[], bool]") -> "tuple[list[Frame], int]":
    """Frames of a bus, and how many were lost; says so, and what listening means there."""
    from dbc.frame import Frame, LinkState
    from hil.bus.transmit import ListeningBus

    if isinstance(bus, ListeningBus):
        _say(bus.words)
    heard: list[Frame] = []
    lost = 0
    while goes_on():
        for item in bus.receive(0.1):
            if isinstance(item, Frame):
                heard.append(item)
            elif item.state is LinkState.RX_OVERFLOW:
                lost += item.number
    if lost:
        _say(f"{lost} frames were lost on the way here: cycles missed and jitter are partly this machine's")
    return heard, lost


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _values(
    args: argparse.Namespace,
    frames: "FrameTable",
    lost: int | None,
    responses: "list[Response]",
    cyclic: "list[Cyclic]",
) -> dict[str, Any]:
    def plain(one: "Response | Cyclic") -> dict[str, Any]:
        return {k: v._asdict() if hasattr(v, "_asdict") else v for k, v in one._asdict().items()}

    return {
        "log": args.log,
        "bus": args.bus,
        "frames": len(frames),
        "lost": lost,
        "responses": [plain(one) for one in responses],
        "cyclic": [plain(one) for one in cyclic],
    }


def _lines(responses: "list[Response]", cyclic: "list[Cyclic]") -> list[str]:
    from hil.cli.columns import columns, terminal_width

    width = terminal_width()
    lines = []
    if responses:
        rows = []
        for one in responses:
            pair = f"{one.stimulus} to {one.response}"
            rows.append([pair, "age", *_cells(one.age)])
            if one.reaction is not None:
                lost = f" ({one.unanswered} unanswered)" if one.unanswered else ""
                rows.append([pair, f"reaction{lost}", *_cells(one.reaction)])
        lines += columns(["stimulus to response", "what", "n", "p50 ms", "p99 ms", "max ms"], rows, width, (0, 1))
        lines.append("")
    rows = [
        [
            *(c.name, c.channel, str(c.frames), f"{c.cycle_ms:g}{'' if c.stated else ' (median)'}"),
            *_cells(c.jitter)[1:],
            *(f"{c.shortest_ms:.3f}", f"{c.longest_ms:.3f}", str(c.missed)),
        ]
        for c in cyclic
    ]
    heads = ["cyclic message", "channel", "frames", "cycle ms", "jitter p50", "p99", "max ms", "shortest", "longest"]
    return lines + columns([*heads, "missed"], rows, width, (0, 1))


def _cells(spread: "Spread") -> list[str]:
    numbers = (spread.p50_ms, spread.p99_ms, spread.max_ms)
    return [str(spread.n), *("-" if number is None else f"{number:.3f}" for number in numbers)]
