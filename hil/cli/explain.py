"""``brakebench explain``: what the simulation gets wrong in measured data, its cause, and what an extension gains."""

import argparse
import json
import sys
from pathlib import Path

from hil.cli.options import add_json, out_folder
from hil.diagnosis.data.log import UnusableError
from hil.errors import BrakebenchError
from hil.log.samples import log_path
from hil.rt.clock import monotonic_ns


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "explain",
        description="Replays measured manoeuvres, shows what the simulation misses, names the cause with interval, "
        "probability and rivals, writes the extended model and measures its gain on held-out manoeuvres.",
    )
    parser.add_argument(
        "logs",
        nargs="+",
        type=log_path,
        metavar="LOG",
        help="CAN log, CSV, Parquet, MF4 or .mat table, or a folder of them; sample:weak_brake comes with brakebench",
    )
    parser.add_argument(
        "--vehicle", type=Path, metavar="SET.toml", help="the vehicle's parameters (default: the shipped car)"
    )
    parser.add_argument("--dbc", type=Path, metavar="FILE", help="another car's DBC, with --map")
    parser.add_argument(
        "--map", type=Path, action="append", default=[], metavar="FILE",
        help="CHANNELS.toml: which signal is which channel; with --plant MAP.toml: which is which variable of the FMU; "
        "both with --plant and another car's logs",
    )  # fmt: skip
    parser.add_argument(
        "--logs", dest="about", type=Path, metavar="LOGS.toml", help="direction, disc temperature per file"
    )
    parser.add_argument(
        "--reference", nargs="+", type=Path, metavar="REF",
        help="logs of the same car from before something changed, or a folder of them: the change is explained",
    )  # fmt: skip
    parser.add_argument("--extend", type=Path, metavar="FILE", help="extension to start from")
    parser.add_argument(
        "--plant", type=Path, metavar="FMU",
        help="instead: what somebody else's plant gets wrong, with --map MAP.toml; names no cause (docs/fmu.md)",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=out_folder, metavar="DIR", help="write report.html, report.png, result.json, extension.toml"
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Explain and print."""
    from hil.diagnosis.explain import explain
    from hil.diagnosis.foreign_plant.page import build_report as residuals_report
    from hil.diagnosis.foreign_plant.residuals import Residuals, residuals
    from hil.diagnosis.manoeuvres.coast_down import CoastDown
    from hil.diagnosis.manoeuvres.coast_down_page import build_report as coast_report
    from hil.diagnosis.manoeuvres.stop_figures import StopFigures
    from hil.diagnosis.manoeuvres.stop_figures import build_report as stops_report
    from hil.diagnosis.result.answer import Answer
    from hil.diagnosis.result.page import build_report
    from hil.diagnosis.sensor_consistency.check import Consistency
    from hil.diagnosis.sensor_consistency.page import build_report as sensor_report

    begun_ns = monotonic_ns()

    def progress(text: str) -> None:
        print(f"{(monotonic_ns() - begun_ns) * 1e-9:5.0f} s  {text} ...", file=sys.stderr, flush=True)

    channel_map, plant_map = _maps(args)
    answer: Answer | Consistency | CoastDown | StopFigures | Residuals
    try:
        if plant_map is not None:
            answer = residuals(
                list(args.logs), args.plant, plant_map, args.vehicle, channel_map=channel_map, database=args.dbc,
                about=args.about, progress=progress,
            )  # fmt: skip
        else:
            answer = explain(
                list(args.logs), args.vehicle, channel_map=channel_map, database=args.dbc, about=args.about,
                extend=args.extend, out=args.out, reference=args.reference, progress=progress,
            )  # fmt: skip
    except UnusableError as error:
        if not args.json:
            raise
        print(json.dumps(_unusable(str(error)), indent=2))
        return error.exit_code
    sources = [str(path) for path in args.logs]
    if isinstance(answer, Residuals):
        report = residuals_report(answer, sources)
    elif isinstance(answer, CoastDown):
        report = coast_report(answer, sources)
    elif isinstance(answer, StopFigures):
        report = stops_report(answer, sources)
    elif isinstance(answer, Consistency):
        report = sensor_report(answer, sources)
    else:
        report = build_report(answer, sources)
    if args.out is not None:
        from hil.cli.origin import with_origin
        from hil.report.figure import write_figure
        from hil.report.html import write_html
        from hil.report.pictures import no_pictures

        args.out.mkdir(parents=True, exist_ok=True)
        write_html(with_origin(report), args.out / "report.html")
        if not write_figure(report, args.out / "report.png"):
            print(no_pictures(), file=sys.stderr)
        (args.out / "result.json").write_text(json.dumps(answer.json, indent=2), encoding="utf-8")
    if args.json:
        print(json.dumps(answer.json, indent=2, allow_nan=False))
    else:
        from hil.report.text import print_text

        print_text(report, sys.stdout)
    return 0


def _maps(args: argparse.Namespace) -> tuple[Path | None, Path | None]:
    """The channel map and, with --plant, that of the FMU, which has outputs."""
    from hil.fmu.plant_map import is_plant_map

    if args.plant is None:
        if len(args.map) > 1:
            raise BrakebenchError("--map: expected one; a second one goes with --plant")
        return (args.map[0] if args.map else None), None
    if args.reference is not None or args.extend is not None:
        raise BrakebenchError("--plant compares an FMU with logs: leave out --reference and --extend")
    of_plant = [path for path in args.map if is_plant_map(path)]
    of_logs = [path for path in args.map if path not in of_plant]
    if len(of_plant) != 1 or len(of_logs) > 1:
        raise BrakebenchError("--plant FMU: give it with one --map MAP.toml that has [outputs] (docs/fmu.md)")
    return (of_logs[0] if of_logs else None), of_plant[0]


def _unusable(why: str) -> dict[str, object]:
    return {
        "verdict": "unusable", "why": why, "headline": why, "causes": [], "rivals": [], "moved_numbers": [],
        "goodness_of_fit": None, "undetectable_effects": [],
        "discriminating_manoeuvres": [], "residual_patterns": [], "held_out_error": {}, "extension": None,
    }  # fmt: skip
