"""``brakebench diag``: asks an ECU by UDS, ours or any other, and prints its answers in words."""

import argparse
import json
import sys
from typing import TYPE_CHECKING, Any

from hil.cli.columns import say
from hil.cli.diag_actions import ACTIONS, session_number
from hil.cli.options import add_bus, add_json, add_transmit
from hil.errors import BrakebenchError, Verdict
from hil.extras import pip_install
from hil.log.account import printable

if TYPE_CHECKING:
    from hil.uds.tester import Exchange, Tester


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "diag",
        description="Ask an ECU by UDS (ISO 14229 over ISO-TP), ours by default, and print its answers in words.",
        epilog="Exit codes: 0 answered; 1 the ECU refuses; 2 wrong use; 3 no answer. A tutorial: docs/diagnose-it.md.",
    )
    _add_connection(parser)
    shared = {option.dest for option in parser._actions}
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True)
    for name, words, add in ACTIONS:
        action = actions.add_parser(name, help=words, description=words[0].upper() + words[1:] + ".")
        add(action)
        _add_connection(action)
        for option in action._actions:  # behind the action an option that is not given leaves what stands before it
            if option.dest in shared:
                option.default = argparse.SUPPRESS
    parser.set_defaults(run=run)


def _add_connection(parser: argparse.ArgumentParser) -> None:
    """Options that may stand before and behind the action."""
    group = parser.add_argument_group("connection")
    add_bus(parser)
    group.add_argument("--request-id", metavar="ID", help="identifier of requests, hexadecimal (default: our ECU's)")
    group.add_argument("--response-id", metavar="ID", help="identifier of its answers (default: our ECU's)")
    group.add_argument("--extended", action="store_true", help="both identifiers have 29 bits, however short")
    group.add_argument("--functional", metavar="ID", help="send to this identifier of all ECUs: 7DF, 18DB33F1")
    group.add_argument("--timeout", metavar="S", type=float, default=1.0, help="until an answer begins (default: 1)")
    group.add_argument("--session", metavar="NAME", help="change to this session first: extended, or a number")
    group.add_argument("--unlock", action="store_true", help="security access first, by our ECU's seed and key")
    add_transmit(parser)
    group.add_argument("--trace", action="store_true", help="tell every request and answer on standard error")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Ask, print; a refusal and silence are errors with exit codes of their own."""
    try:
        from hil.uds.tester import Tester
        from hil.uds.transport import IsoTpConnection
    except ImportError as error:
        raise BrakebenchError(
            f"brakebench diag needs udsoncan and can-isotp ({error}); install them with: {pip_install('diag')}"
        ) from error
    from dbc.frame import BusName
    from hil.bus.channel import resolve
    from hil.bus.open import open_bus
    from hil.bus.transmit import check_transmit
    from hil.uds.own import PERIODIC, REQUEST, names_of

    spec = resolve(args.bus)
    check_transmit(spec, args.transmit, "diag sends requests")
    if not 0.0 < args.timeout <= 60.0:
        raise BrakebenchError(f"--timeout {args.timeout:g}: expected seconds above 0, at most 60")
    request, answer, functional = _identifiers(args)
    known = names_of(request)
    facts: dict[str, Any] = {"verdict": Verdict.PASSED.value, "reason": "", "bus": spec, "action": args.action}
    facts |= {"request_id": request.can_id, "response_id": answer.can_id, "extended": request.extended}
    exchanges: list[Exchange] = []

    def tell(one: "Exchange") -> None:
        exchanges.append(one)
        if args.trace:
            from hil.uds.words import describe

            for what, data in (("request", one.request), ("answer", one.answer)):
                words = f"{describe(data, known).text} [{data.hex(' ').upper()}]" if data else "none"
                print(printable(f"{what:8} {words}"), file=sys.stderr)

    code = 0
    lines: list[str] = []
    with open_bus(spec, BusName.VEHICLE) as bus:
        connection = IsoTpConnection(bus, request, answer, functional, PERIODIC if request == REQUEST else None)
        tester = Tester(connection, known, args.timeout, tell)
        try:
            _prepare(tester, args)
            lines, facts["result"] = args.do(tester, args)
        except BrakebenchError as error:
            if not args.json or error.exit_code == BrakebenchError.exit_code:
                raise
            code = error.exit_code
            facts |= {"verdict": _verdict(code), "reason": str(error), "result": None}
            print(f"brakebench: {printable(str(error))}", file=sys.stderr)
    if args.json:
        facts["exchanges"] = [_exchange_values(one, known) for one in exchanges]
        print(json.dumps(facts, indent=2))
    else:
        say(map(printable, lines))
    return code


def _identifiers(args: argparse.Namespace) -> Any:
    from hil.uds.addresses import Identifier, standard_partner
    from hil.uds.own import ANSWER, REQUEST

    def read(text: str) -> Identifier:
        one = Identifier.parse(text)
        return Identifier(one.can_id, True) if args.extended else one

    request = REQUEST if args.request_id is None else read(args.request_id)
    answer = read(args.response_id) if args.response_id is not None else None
    if answer is None:
        answer = ANSWER if request == REQUEST else standard_partner(request)
    if answer is None:
        raise BrakebenchError(f"--request-id {request}: no standard says who answers it; give --response-id as well")
    functional = None if args.functional is None else read(args.functional)
    if functional is not None and functional.extended != request.extended:
        raise BrakebenchError(
            f"--functional {functional}: expected an identifier of {29 if request.extended else 11} bits, such as "
            f"{'18DB33F1' if request.extended else '7DF'}"
        )
    return request, answer, functional


def _prepare(tester: "Tester", args: argparse.Namespace) -> None:
    from ecu.diagnostics.security import key_of
    from hil.uds.own import LEVEL

    if args.session is not None:
        tester.session(session_number(args.session))
    if args.unlock:
        tester.unlock(LEVEL, key_of)


def _verdict(code: int) -> str:
    return next(verdict.value for verdict in Verdict if verdict.exit_code == code)


def _exchange_values(one: "Exchange", known: Any) -> dict[str, Any]:
    from hil.uds.words import describe

    return {
        "request": one.request.hex(),
        "answer": one.answer.hex(),
        "request_text": describe(one.request, known).text,
        "answer_text": describe(one.answer, known).text if one.answer else "",
        "time_ms": one.time_ns * 1e-6,
    }
