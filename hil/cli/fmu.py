"""``brakebench fmu``: plant and controller as FMUs for other people's benches."""

import argparse
from pathlib import Path

from hil.cli.columns import say


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("fmu")
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True)
    export = actions.add_parser(
        "export",
        help="write an FMU",
        description="Write plant or controller as an FMI 3.0 co-simulation FMU for Linux; see docs/fmu.md.",
        epilog="Needs a C compiler here, and where the FMU runs a Python that has brakebench installed: the python3 on "
        "the PATH, or the one that BRAKEBENCH_PYTHON names.",
    )
    export.add_argument("what", choices=("plant", "ecu"), help="the car, or the controller (with a CAN terminal)")
    export.add_argument("out", metavar="OUT.fmu", type=Path, help="file to write")
    export.add_argument(
        "--scenario",
        default="stop72",
        metavar="SCENARIO",
        help="whose parameters and start are the FMU's start values, by name or path (default: stop72)",
    )
    export.add_argument("--force", action="store_true", help="replace OUT.fmu where it exists")
    export.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Write the FMU and say what it needs."""
    from hil.fmu.export import export
    from hil.scenario.scenario import load_scenario

    scenario = load_scenario(args.scenario)
    export(args.what, scenario, args.out, args.force)
    say(
        [
            f"{args.out}: FMI 3.0 co-simulation for Linux, {args.out.stat().st_size:,} bytes, {scenario.name} inside",
            "where it runs: Python with brakebench installed, python3 on the PATH or named by BRAKEBENCH_PYTHON",
        ]
    )
    return 0
