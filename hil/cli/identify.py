"""``brakebench identify friction``: pad friction from a dynamometer record, as in the paper's Figures 3 to 5."""

import argparse
import json
import sys
from dataclasses import asdict, replace
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from hil.cli.options import add_json, out_folder
from hil.errors import BrakebenchError

if TYPE_CHECKING:
    from hil.identify.model import Brake
    from hil.identify.study import Study
    from hil.report.report import Report
    from plant.parameters.brakes import FrictionBrakeParameters

_AXLES = ("front", "rear")


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("identify")
    what = parser.add_subparsers(title="what", metavar="WHAT", required=True)
    friction = what.add_parser(
        "friction",
        help="pad friction from a brake dynamometer's record",
        description="Fit a, b, c, gamma and epsilon of the paper's equations (3) and (4) to a dynamometer record: a "
        "CSV with the columns 'time [s], pressure [bar], speed [m/s], torque [N m], temperature [degC]'; the speed is "
        "the sliding speed at the effective radius.",
    )
    friction.add_argument(
        "record", type=Path, nargs="?", metavar="DYNO.csv",
        help="record to fit (default: the shipped records, synthetic, one to fit and one to validate)",
    )  # fmt: skip
    friction.add_argument(
        "--validate", type=Path, metavar="OTHER.csv", help="record to predict, e.g. at twice the frequency"
    )
    friction.add_argument(
        "--out", type=out_folder, metavar="DIR", help="write report, figures, result.json and pad.toml"
    )
    add_json(friction)
    friction.add_argument(
        "--heating", choices=("printed", "friction"),
        help="heating term of equation (4): Nv as printed, or mu Nv (default: what fits better)",
    )  # fmt: skip
    friction.add_argument("--coverage", type=int, metavar="N", help="check the intervals on N records of known truth")
    brake = friction.add_argument_group("brake on the dynamometer (default: the plant's)")
    brake.add_argument("--parameters", type=Path, metavar="SET.toml", help="plant parameter set to take it from")
    brake.add_argument("--axle", choices=_AXLES, default="front", help="whose brake (default: front)")
    brake.add_argument("--pads", type=int, choices=(1, 2), default=2, help="pads that rub (default: 2)")
    brake.add_argument("--piston-area-cm2", type=_positive, metavar="CM2", help="piston area of one side")
    brake.add_argument("--radius-mm", type=_positive, metavar="MM", help="effective radius")
    brake.add_argument("--ambient-degc", type=float, metavar="DEGC", help="T0 of equation (4)")
    friction.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Identify, or check the intervals, and print."""
    from hil.scenario.parameters import load_set
    from plant.parameters.plant import PlantParameters

    source = args.parameters or resources.files("plant.parameters") / "paper_car.toml"
    parameters = load_set(source, PlantParameters).friction_brake
    brake = _brake(args, parameters)
    if args.coverage is not None:
        return _coverage(args, brake)
    return _identify(args, brake, parameters, str(source.name))


def _identify(args: argparse.Namespace, brake: "Brake", parameters: "FrictionBrakeParameters", source: str) -> int:
    from hil.identify.files import as_json
    from hil.identify.record import read_record
    from hil.identify.study import identify, shipped_records
    from hil.identify.summary import build_report
    from hil.report.text import print_text

    if args.record is None and args.validate is not None:
        raise BrakebenchError("--validate without a record to fit; give DYNO.csv first")
    first, second = (args.record, args.validate) if args.record else shipped_records()
    print("reading and fitting (the model is compiled first) ...", file=sys.stderr)
    other = read_record(second) if second else None
    study = identify(read_record(first), brake, other, args.heating)
    report = build_report(study, _provenance(study, source, args.axle))
    if args.out is not None:
        _write(args, study, parameters, report)
    if args.json:
        print(json.dumps(as_json(study), indent=2, allow_nan=False))
    else:
        print_text(report, sys.stdout)
    return 0


def _coverage(args: argparse.Namespace, brake: "Brake") -> int:
    from hil.cli.progress import Progress
    from hil.identify.coverage import LEVEL, coverage
    from hil.identify.files import coverage_json

    if args.record is not None or args.validate is not None or args.out is not None:
        raise BrakebenchError("--coverage makes its own records; leave DYNO.csv, --validate and --out away")
    if args.coverage < 1:
        raise BrakebenchError(f"--coverage: expected at least 1 record, got {args.coverage}")
    print(f"{100 * LEVEL:g} % joint region of (a, b, c, gamma, eps), {args.coverage} seeds a row", file=sys.stderr)
    with Progress().part(0, "fitting records of known truth") as progress:
        rows = list(coverage(brake, range(args.coverage), progress))
    for row in () if args.json else rows:
        print(
            f"heating {row.heating:8}  noise {row.noise:11}  truth inside {row.inside} of {row.seeds} "
            f"(at least {row.least} asked)  heating form found {row.form_found} of {row.seeds}"
        )
    if args.json:
        print(json.dumps(coverage_json(rows), indent=2))
    return 0 if all(row.met for row in rows) else 1


def _write(args: argparse.Namespace, study: "Study", parameters: "FrictionBrakeParameters", report: "Report") -> None:
    from hil.cli.origin import with_origin
    from hil.identify.files import as_json, pad_toml
    from hil.identify.summary import figures
    from hil.report.figure import write_figure
    from hil.report.html import write_html
    from hil.report.pictures import no_pictures
    from hil.scenario.parameters import ParameterError, load_set
    from plant.parameters.brakes import OstermeyerParameters

    try:
        args.out.mkdir(parents=True, exist_ok=True)
        write_html(with_origin(report), args.out / "report.html")
        if not all(write_figure(figure, args.out / name) for name, figure in figures(study).items()):
            print(no_pictures(), file=sys.stderr)
        (args.out / "result.json").write_text(json.dumps(as_json(study), indent=2, allow_nan=False), encoding="utf-8")
        table = pad_toml(study, _AXLES.index(args.axle), parameters)
        (args.out / "pad.toml").write_text(table, encoding="utf-8")
    except OSError as error:
        raise BrakebenchError(f"{args.out}: cannot be written ({error.strerror}); give another directory") from error
    try:
        load_set(args.out / "pad.toml", OstermeyerParameters)
    except ParameterError as error:
        print(f"the plant cannot take this pad: {error}; are geometry and units right?", file=sys.stderr)
    print(f"report, figures, result.json and pad.toml written to {args.out}", file=sys.stderr)


def _brake(args: argparse.Namespace, parameters: "FrictionBrakeParameters") -> "Brake":
    from hil.identify.model import brake_of

    brake = brake_of(parameters, _AXLES.index(args.axle), args.pads)
    if args.piston_area_cm2 is not None:
        brake = replace(brake, piston_area_m2=args.piston_area_cm2 * 1e-4)
    if args.radius_mm is not None:
        brake = replace(brake, effective_radius_m=args.radius_mm * 1e-3)
    if args.ambient_degc is not None:
        brake = replace(brake, ambient_k=args.ambient_degc + 273.15)
    return brake


def _provenance(study: "Study", source: str, axle: str) -> dict[str, object]:
    records = [study.record] + ([study.validation.record] if study.validation else [])
    return {
        "records": {
            r.name: {"samples": r.time_s.size, "averaged from": r.averaged, "head of the file": "; ".join(r.remarks)}
            for r in records
        },
        "brake": {"parameter set": source, "axle": axle, **asdict(study.brake)},
        "brakebench": version("brakebench"),
    }


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"expected a positive number, got {text}")
    return value
