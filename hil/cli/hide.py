"""``brakebench hide``: logs of a car with something hidden in them, and the answer in a sealed file."""

import argparse
import json
import sys
from typing import TYPE_CHECKING

from hil.cli.options import add_json, out_folder, seed
from hil.errors import BrakebenchError

if TYPE_CHECKING:
    from hil.validation.reference_car.case import Hidden


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "hide",
        description="Drive a manoeuvre set with a car that is not the bench's own plant (other equations, integrator, "
        "sensors; numbers off by their tolerances), with something hidden in it. DIR gets logs, logs.toml and "
        "vehicle.toml; the answer goes to DIR.sealed/answer.json, which `brakebench explain` never opens.",
    )
    parser.add_argument(
        "--effect", action="append", metavar="E", required=True,
        help="what to hide, or 'none', or 'list' to print what can be hidden; repeat to hide several at once",
    )  # fmt: skip
    parser.add_argument(
        "--magnitude", action="append", type=float, metavar="M",
        help="size in the effect's own parameter, one per --effect (default: a usual size)",
    )  # fmt: skip
    parser.add_argument(
        "--wheel", action="append", metavar="W",
        help="where, one per --effect: car, front, rear, left, right, fl, fr, rl, rr or a node (default: its first)",
    )  # fmt: skip
    parser.add_argument("--snr", type=float, metavar="X", help="scale the magnitudes so that the expected SNR is X")
    parser.add_argument("--onset", type=float, metavar="S", help="begin S seconds into the session, logs in order")
    parser.add_argument("--noise", choices=("low", "medium", "high"), default="medium", help="(default: medium)")
    parser.add_argument(
        "--manoeuvres", metavar="SET", default="full", help="full, stops, cold or decide (default: full)"
    )
    parser.add_argument("--seed", type=seed, default=1, metavar="N", help="true car, noise and bus (default: 1)")
    parser.add_argument("--out", type=out_folder, metavar="DIR", help="folder for the logs; must be empty or not exist")
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Hide, write, say where."""
    if args.effect == ["list"]:
        return _list(args.json)
    if args.out is None:
        raise BrakebenchError("--out is missing: give a folder for the logs, e.g. --out hidden/one")
    from hil.validation.reference_car.case import make_case, measured_case, scaled_case
    from hil.validation.reference_car.files import write

    hidden = _hidden(args)
    case = make_case(hidden, args.seed, args.noise, args.manoeuvres)
    if hidden:
        print("driving pairs of runs to find how visible it is ...", file=sys.stderr)
        case = scaled_case(case, args.snr) if args.snr else measured_case(case)
        if not case.reached:
            print("brakebench: a physical bound came before that SNR; what was reached is sealed", file=sys.stderr)
    path = write(case, args.out)
    told = {"logs": str(args.out), "sealed": str(path), "count": len(case.drives)}
    print(json.dumps(told) if args.json else f"{len(case.drives)} logs in {args.out}; the answer is in {path}")
    return 0


def _hidden(args: argparse.Namespace) -> list["Hidden"]:
    from hil.validation.reference_car.case import Hidden
    from hil.validation.reference_car.catalogue import find

    if args.effect == ["none"]:
        if args.magnitude or args.wheel or args.snr or args.onset is not None:
            raise BrakebenchError("--effect none has no magnitude, wheel, SNR or onset; leave them out")
        return []
    for option, given in (("--magnitude", args.magnitude), ("--wheel", args.wheel)):
        if given and len(given) != len(args.effect):
            raise BrakebenchError(
                f"{option} is given {len(given)} times, --effect {len(args.effect)} times; give as many"
            )
    kinds = [find(name) for name in args.effect]
    sizes = args.magnitude or [kind.typical for kind in kinds]
    wheels = args.wheel or [kind.where[0] for kind in kinds]
    return [Hidden(kind.name, wheel, size, args.onset) for kind, wheel, size in zip(kinds, wheels, sizes, strict=True)]


def _list(as_json: bool) -> int:
    from hil.validation.reference_car.catalogue import HIDEABLE

    if as_json:
        rows = {
            kind.name: {
                "parameter": kind.parameter, "unit": kind.unit, "typical": kind.typical, "low": kind.low,
                "high": kind.high, "where": list(kind.where), "listed": kind.law == 0,
            }
            for kind in HIDEABLE.values()
        }  # fmt: skip
        print(json.dumps(rows, indent=1))
        return 0
    for kind in HIDEABLE.values():
        size = f"{kind.typical:g} {kind.unit}".strip()
        print(f"{kind.name:24} {kind.parameter:18} {size:14} {', '.join(kind.where)}")
    return 0
