"""``brakebench run``: ECU and plant on one bus, one scenario, recorded and measured."""

import argparse
import contextlib
import sys
from pathlib import Path

from hil.cli.options import add_bus, add_json, add_realtime, add_scenario, add_seed, add_transmit


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("run")
    add_scenario(parser)
    add_bus(parser)
    parser.add_argument(
        "--virtual",
        action="store_true",
        help="virtual time: both nodes in this process, as fast as it goes; the same seed gives the same bytes; "
        "with --bus timed[:BITRATE][,bit_error_rate=P][,queue=fifo] on a CAN bus with real bit times",
    )
    parser.add_argument(
        "--without",
        action="append",
        choices=("ecu", "plant"),
        default=[],
        help="do not start this node: it is somebody else's, on the same bus",
    )
    parser.add_argument(
        "--live",
        action="store_true",
        help="serve a page on 127.0.0.1 that shows the run and commands it; see docs/live.md",
    )
    parser.add_argument("--terminal", action="store_true", help="show the run on this terminal while it goes on")
    parser.add_argument(
        "--mcap",
        action="store_true",
        help="write recording.mcap beside the recording, for Foxglove, PlotJuggler and Rerun; see docs/logs.md",
    )
    parser.add_argument("--extend", type=Path, metavar="FILE", help="extension that `explain` wrote: the car it taught")
    parser.add_argument(
        "--plant",
        type=Path,
        metavar="FMU",
        help="somebody else's FMU in the place of the car, in virtual time; see docs/fmu.md",
    )
    parser.add_argument("--map", type=Path, metavar="MAP.toml", help="which signal is which variable of --plant")
    parser.add_argument("--out", metavar="DIR", help="folder for log, signals, figure and report (default: runs/...)")
    add_transmit(parser)
    add_seed(parser)
    add_realtime(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run, measure, report."""
    from hil.bench.run import run_scenario
    from hil.bus.timed.line import is_timed
    from hil.errors import BrakebenchError

    timed = is_timed(args.bus)
    if args.virtual and (args.without or args.realtime or not (timed or args.bus == "auto")):
        raise BrakebenchError(
            "--virtual has no processes and no bus but a timed one: leave out --without, --realtime and --bus, "
            "or give --bus timed"
        )
    if timed and not args.virtual:
        raise BrakebenchError(f"--bus {args.bus}: a timed bus is in virtual time; add --virtual")
    if args.live or args.terminal:
        from hil.cli.watch import check_extra

        option = "--live" if args.live else "--terminal"
        if args.virtual:
            raise BrakebenchError(f"{option} shows a run in real time: leave out --virtual")
        if args.live and args.terminal:
            raise BrakebenchError("--live and --terminal: give one of them; `brakebench watch` shows the bus as well")
        check_extra(args.terminal)
    if args.mcap:
        from hil.log.export.mcap_file import check_extra as check_mcap

        check_mcap(Path("recording.mcap"))
    if (args.plant is None) != (args.map is None):
        raise BrakebenchError("--plant FMU goes with --map MAP.toml; give both or neither")
    if args.plant is not None and not args.virtual:
        raise BrakebenchError(
            "--plant: an FMU states a step, but not how long it takes to compute, so no tick could be promised in real "
            "time; add --virtual"
        )
    scenario, out = args.scenario, args.out
    if args.extend is not None:
        from hil.bench.run import new_folder
        from hil.diagnosis.result.extended_scenario import effects_after_end, extended_scenario

        folder = Path(out) if out else new_folder(Path(scenario).stem)
        folder.mkdir(parents=True, exist_ok=True)
        extended = extended_scenario(scenario, args.extend, folder)
        for remark in effects_after_end(extended):
            print(remark, file=sys.stderr)
        scenario, out = str(extended), str(folder)
    foreign = None
    if args.plant is not None:
        from hil.fmu.foreign_plant import open_plant
        from hil.scenario.scenario import load_scenario

        start_mps = load_scenario(scenario).manoeuvre.initial_speed_mps
        foreign = open_plant(args.plant, args.map, args.seed, start_mps)
        print(f"plant {foreign}", file=sys.stderr, flush=True)
    with foreign or contextlib.nullcontext():
        outcome = run_scenario(
            scenario,
            args.bus,
            out=out,
            seed=args.seed,
            realtime=args.realtime,
            transmit=args.transmit,
            virtual=args.virtual,
            without=args.without,
            command_line=" ".join(sys.argv[1:]),
            say=lambda line: print(line, file=sys.stderr, flush=True),
            plant=foreign,
            live=args.live,
            terminal=args.terminal,
            mcap=args.mcap,
        )
    if args.json:
        print(outcome.json_text())
    else:
        outcome.print_text(sys.stdout)
    return outcome.exit_code
