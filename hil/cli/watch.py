"""``brakebench watch``: a page that shows a running bus, and commands a bench; or a view on the terminal."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from hil.cli.options import add_bus, add_ready_fd
from hil.errors import BrakebenchError

if TYPE_CHECKING:
    from hil.log.signals.databases import Databases


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "watch",
        description="Listen to a running bus and serve a page on 127.0.0.1 that shows it live, until Ctrl-C: signals, "
        "the car, trouble codes, every message with its cycle and protection. Where a bench runs the page also has its "
        "controls and faults. Nothing is sent on the vehicle bus. `brakebench run --live` starts it by itself.",
        epilog="More: docs/live.md.",
    )
    add_bus(parser)
    parser.add_argument("--dbc", metavar="FILE", type=Path, action="append", default=[],
                        help="database of the vehicle bus (DBC, ARXML, KCD, SYM; default: our own)")  # fmt: skip
    parser.add_argument(
        "--terminal",
        action="store_true",
        help="show it on this terminal instead of a page; where the output is none, a view a second as plain text",
    )
    parser.add_argument("--port", type=_port, default=0, help="port of the page (default: any that is free)")
    parser.add_argument("--scenario", default="stop72", metavar="SCENARIO",
                        help="whose car's wheel radius and torque constant are used (default: stop72)")  # fmt: skip
    parser.add_argument("--wait", type=float, default=0.0, help=argparse.SUPPRESS)  # of a run, for its first page
    add_ready_fd(parser)
    parser.set_defaults(run=run)


def _port(text: str) -> int:
    if not text.isdecimal() or not 1024 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"expected a port from 1024 to 65535, got {text!r}")
    return int(text)


def run(args: argparse.Namespace) -> int:
    """Serve the page until told to stop."""
    check_extra(args.terminal)
    from hil.scenario.scenario import load_scenario

    plant = load_scenario(args.scenario).plant
    car = {
        "wheel_radius_m": plant.wheel.rolling_radius_m,
        "torque_constant_nm_a": plant.motor.torque_constant_nm_a,
    }

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    databases, wait_ns = _databases(args.dbc), round(args.wait * 1e9)
    if args.terminal:
        from hil.live.terminal import show_view

        show_view(args.bus, databases, car, args.ready_fd)
        return 0
    from hil.live.view import serve_view

    serve_view(args.bus, databases, car, port=args.port, ready_fd=args.ready_fd, wait_ns=wait_ns, say=say)
    return 0


def check_extra(terminal: bool = False) -> None:
    """Refuse to go on without the library of page or terminal; BrakebenchError says how to get it."""
    from hil.extras import missing

    if lacks := missing("rich" if terminal else "websockets"):
        raise BrakebenchError(f"the live view {lacks}")


def _databases(files: list[Path]) -> "Databases | None":
    if not files:
        return None
    from hil.log.foreign.database_files import read_database
    from hil.log.signals.databases import Databases

    return Databases.joined([read_database(file) for file in files], {})
