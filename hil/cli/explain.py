"""``brakebench explain``: what the simulation gets wrong in measured data, its cause, and what an extension gains."""

import argparse
import json
import sys
from pathlib import Path

from hil.cli.options import add_json, out_folder
from hil.diagnosis.data.log import UnusableError
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
    parser.add_argument("--map", type=Path, metavar="CHANNELS.toml", help="which signal is which channel")
    parser.add_argument(
        "--logs", dest="about", type=Path, metavar="LOGS.toml", help="direction, disc temperature per file"
    )
    parser.add_argument(
        "--reference", nargs="+", type=Path, metavar="REF",
        help="logs of the same car from before something changed, or a folder of them: the change is explained",
    )  # fmt: skip
    parser.add_argument("--extend", type=Path, metavar="FILE", help="extension to start from")
    parser.add_argument(
        "--out", type=out_folder, metavar="DIR", help="write report.html, report.png, result.json, extension.toml"
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Explain and print."""
    from hil.diagnosis.explain import explain
    from hil.diagnosis.manoeuvres.coast_down import CoastDown
    from hil.diagnosis.manoeuvres.coast_down_page import build_report as coast_report
    from hil.diagnosis.manoeuvres.stop_figures import StopFigures
    from hil.diagnosis.manoeuvres.stop_figures import build_report as stops_report
    from hil.diagnosis.result.page import build_report
    from hil.diagnosis.sensor_consistency.check import Consistency
    from hil.diagnosis.sensor_consistency.page import build_report as sensor_report

    begun_ns = monotonic_ns()

    def progress(text: str) -> None:
        print(f"{(monotonic_ns() - begun_ns) * 1e-9:5.0f} s  {text} ...", file=sys.stderr, flush=True)

    try:
        answer = explain(
            list(args.logs), args.vehicle, channel_map=args.map, database=args.dbc, about=args.about,
            extend=args.extend, out=args.out, reference=args.reference, progress=progress,
        )  # fmt: skip
    except UnusableError as error:
        if not args.json:
            raise
        print(json.dumps(_unusable(str(error)), indent=2))
        return error.exit_code
    sources = [str(path) for path in args.logs]
    if isinstance(answer, CoastDown):
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


def _unusable(why: str) -> dict[str, object]:
    return {
        "verdict": "unusable", "why": why, "headline": why, "causes": [], "rivals": [], "moved_numbers": [],
        "goodness_of_fit": None, "undetectable_effects": [],
        "discriminating_manoeuvres": [], "residual_patterns": [], "held_out_error": {}, "extension": None,
    }  # fmt: skip
