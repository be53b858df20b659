"""Options that several commands share."""

import argparse
import math
import os
from pathlib import Path


def add_bus(parser: argparse.ArgumentParser) -> None:
    """``--bus``: the vehicle bus."""
    parser.add_argument(
        "--bus",
        default="auto",
        metavar="BUS",
        help="vehicle bus: auto (vcan0 where there is one, else a loopback), loopback:NAME, socketcan:vcan0, "
        "or any python-can interface as INTERFACE:CHANNEL (default: auto)",
    )


def add_transmit(parser: argparse.ArgumentParser) -> None:
    """``--transmit``: whether a bus with hardware is sent to."""
    parser.add_argument(
        "--transmit",
        action="store_true",
        help="send on a bus with hardware, where it reaches a real ECU or a real brake; without it such a bus is only "
        "listened to (a loopback, vcan and vxcan need none)",
    )


def add_force(parser: argparse.ArgumentParser) -> None:
    """``--force``: beside a live sender."""
    parser.add_argument(
        "--force", action="store_true", help="send although somebody on the bus already sends the same messages"
    )


def add_ready_fd(parser: argparse.ArgumentParser) -> None:
    """How a bench waits for the process it started; of no use on the command line."""
    parser.add_argument("--ready-fd", type=int, help=argparse.SUPPRESS)


def add_json(parser: argparse.ArgumentParser) -> None:
    """``--json``: one object alone on standard output, all else on standard error."""
    parser.add_argument("--json", action="store_true", help="print one JSON object alone on standard output")


def add_scenario(parser: argparse.ArgumentParser) -> None:
    """The scenario, by name or path."""
    parser.add_argument(
        "scenario",
        nargs="?",
        default="stop72",
        metavar="SCENARIO",
        help="name of a scenario of the library, or the path of a .toml file (default: stop72)",
    )


def add_realtime(parser: argparse.ArgumentParser) -> None:
    """``--realtime``: what a kernel can give to be punctual."""
    parser.add_argument(
        "--realtime",
        action="store_true",
        help="ask for real-time scheduling, locked memory and no garbage collection; says what was not granted",
    )


def add_seed(parser: argparse.ArgumentParser) -> None:
    """``--seed``: of all noise."""
    parser.add_argument("--seed", type=seed, default=1, help="seed of all noise (default: 1)")


def add_node_options(parser: argparse.ArgumentParser) -> None:
    """What the commands ``ecu`` and ``plant`` share."""
    add_scenario(parser)
    add_bus(parser)
    add_transmit(parser)
    add_force(parser)
    add_realtime(parser)
    add_ready_fd(parser)


def seconds(text: str, most_s: float = math.inf) -> float:
    """Read a time of an option, 0 to ``most_s``; never infinite.

    Raises
    ------
    argparse.ArgumentTypeError : it is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (0.0 <= value <= most_s and value < math.inf):
        such = f"0 to {most_s:.10g}" if most_s < math.inf else "0 or more"
        raise argparse.ArgumentTypeError(f"expected seconds, {such}, got {text!r}")
    return value


def out_folder(text: str) -> Path:
    """Read a folder to write into; it is made later, and refused here, before anything long is done.

    Raises
    ------
    argparse.ArgumentTypeError : it cannot be made, or nothing can be written into it.
    """
    path = Path(text)
    try:
        place = next(one for one in (path, *path.parents) if one.exists())
        why = "" if place.is_dir() else f"{place} is no folder"
        if not why and not os.access(place, os.W_OK | os.X_OK):
            why = f"{place} may not be written into"
    except OSError as error:
        why = error.strerror or str(error)
    if why:
        raise argparse.ArgumentTypeError(f"{text}: cannot be written: {why}; name another folder")
    return path


def seed(text: str) -> int:
    """Read a seed, a whole number from 0.

    Raises
    ------
    argparse.ArgumentTypeError : it is none.
    """
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"expected a whole number, 0 or more, got {text!r}")
    return int(text)


def positive(text: str) -> int:
    """Read a whole number from 1.

    Raises
    ------
    argparse.ArgumentTypeError : it is none.
    """
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"expected a whole number, 1 or more, got {text!r}")
    return int(text)
