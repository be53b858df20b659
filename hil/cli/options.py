"""Options that several commands share."""

import argparse


def add_bus(parser: argparse.ArgumentParser) -> None:
    """``--bus``: the vehicle bus."""
    parser.add_argument(
        "--bus",
        default="auto",
        metavar="BUS",
        help="vehicle bus: auto (vcan0 where there is one, else a loopback), loopback:NAME, socketcan:vcan0, "
        "or any python-can interface as INTERFACE:CHANNEL (default: auto)",
    )


def add_ready_fd(parser: argparse.ArgumentParser) -> None:
    """How a bench waits for the process it started; of no use on the command line."""
    parser.add_argument("--ready-fd", type=int, help=argparse.SUPPRESS)


def add_json(parser: argparse.ArgumentParser) -> None:
    """``--json``: one object alone on standard output, all else on standard error."""
    parser.add_argument("--json", action="store_true", help="print one JSON object alone on standard output")
