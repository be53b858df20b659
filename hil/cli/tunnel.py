"""``brakebench tunnel``: a bus on two machines."""

import argparse
import sys

from hil.cli.options import add_realtime


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "tunnel",
        description="One end of a tunnel between two loopbacks, vehicle bus and bench bus, until Ctrl-C. There is no "
        "authentication and no encryption: listen on 127.0.0.1, and cross to another machine with ssh -L.",
    )
    parser.add_argument("--bus", required=True, metavar="loopback:NAME", help="the loopback on this machine")
    ends = parser.add_mutually_exclusive_group(required=True)
    ends.add_argument("--listen", metavar="[HOST:]PORT", help="wait for the other end (HOST by default: 127.0.0.1)")
    ends.add_argument("--connect", metavar="HOST:PORT", help="connect to the other end, again whenever it is lost")
    parser.add_argument(
        "--lifetime",
        type=float,
        metavar="MS",
        help="frames older than that are dropped (default: 20, half of what the brake waits for a demand)",
    )
    add_realtime(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Pass frames until told to stop."""
    from hil.bench.tunnel import LIFETIME_NS, TunnelError, serve_tunnel
    from hil.bench.tunnel_line import parse_place

    if args.lifetime is not None and not 0 < args.lifetime < 1e6:
        raise TunnelError(f"tunnel: --lifetime: expected milliseconds above 0, such as 20, got {args.lifetime:g}")

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    serve_tunnel(
        args.bus,
        parse_place(args.listen, "127.0.0.1") if args.listen else parse_place(args.connect),
        listen=bool(args.listen),
        lifetime_ns=LIFETIME_NS if args.lifetime is None else round(args.lifetime * 1e6),
        realtime=args.realtime,
        say=say,
    )
    return 0
