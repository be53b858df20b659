"""What ``brakebench diag`` can ask: each action's arguments, and the lines and values of its answer."""

import argparse
import difflib
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from hil.cli.diag_measure import add_measure
from hil.cli.options import seconds
from hil.errors import BrakebenchError

if TYPE_CHECKING:
    from hil.uds.known import Names
    from hil.uds.tester import FoundDtc, Tester

Answer = tuple[list[str], Any]
Do = Callable[["Tester", argparse.Namespace], Answer]
LISTED = 0x0D
"""Status mask of `read-dtc`: failed now, pending, confirmed, which a workshop asks for."""
HOLD_MOST_S = 86_399.0  # less than a day; a choice: longer is a slip of the keyboard


def number(text: str, what: str, most: int, such: str) -> int:
    """Read a number of an argument, decimal or 0x.

    Raises
    ------
    BrakebenchError : none, or beyond ``most``; ``such`` tells what would do.
    """
    try:
        value = int(text, 0)
    except ValueError:
        value = -1
    if not 0 <= value <= most:
        raise BrakebenchError(f"{what} {text!r}: expected {such}, or a number up to 0x{most:X}")
    return value


def _bytes(text: str, what: str) -> bytes:
    try:
        return bytes.fromhex(text)
    except ValueError:
        raise BrakebenchError(f"{what} {text!r}: expected bytes in hexadecimal, such as 0A1B") from None


def _did(known: "Names", text: str, coded: bool = False) -> int:
    """Number of a data identifier by name or number; ``coded``: among those that take values."""
    from hil.uds.names import DIDS

    of_standard = {} if coded else {_plain(name): did for did, name in DIDS.items()}
    own = _by_name({did: one.name for did, one in known.dids.items() if one.coded is not None or not coded})
    by_name = of_standard | own
    found = by_name.get(_plain(text))
    return number(text, "data identifier", 0xFFFF, _such(text, by_name, "0xF190")) if found is None else found


def _plain(name: str) -> str:
    return name.lower().replace(" ", "_")


def _by_name(names: Mapping[int, str]) -> dict[str, int]:
    """Numbers by their names as they are typed; of two with one name the first."""
    by_name: dict[str, int] = {}
    for value, name in names.items():
        by_name.setdefault(_plain(name), value)
    return by_name


def _such(text: str, by_name: Mapping[str, int], example: str) -> str:
    """What would do in the place of a name that is not known."""
    close = difflib.get_close_matches(_plain(text), by_name, 3)
    return f"a name ({', '.join(close or list(by_name)[:3])}, ...) or {example}" if by_name else example


def _add_read_dtc(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("code", nargs="?", metavar="CODE", help="one code, as C1001-00 or 0x500100, with its records")
    parser.add_argument(
        "--mask", default=f"0x{LISTED:02X}", help="status bits of which one must be set (default: 0x0D)"
    )
    parser.add_argument("--supported", action="store_true", help="all codes that the ECU knows")
    parser.set_defaults(do=_read_dtc, action="read-dtc")


def _read_dtc(tester: "Tester", args: argparse.Namespace) -> Answer:
    from hil.uds.dtc import dtc_number

    if args.code is not None:
        return _one_code(tester, _code(tester.known, args.code, dtc_number))
    mask = number(args.mask, "--mask", 0xFF, "status bits")
    found = tester.supported() if args.supported else tester.codes(mask)
    count = f"{len(found)} trouble code{'' if len(found) == 1 else 's'}" if found else "no trouble codes"
    return [count, *(_code_line(tester.known, one) for one in found)], [_code_values(tester.known, o) for o in found]


def _code(known: "Names", text: str, read: Callable[[str], int]) -> int:
    by_name = {name: code for code, name in known.dtcs.items()}
    return by_name[text] if text in by_name else read(text)


def _code_line(known: "Names", one: "FoundDtc") -> str:
    from hil.uds.dtc import dtc_text, status_text

    return f"{dtc_text(one.number)}  {known.dtcs.get(one.number, ''):32}  {status_text(one.status)}"


def _code_values(known: "Names", one: "FoundDtc") -> dict[str, Any]:
    from hil.uds.dtc import dtc_text, status_text

    return {
        "code": dtc_text(one.number),
        "number": one.number,
        "name": known.dtcs.get(one.number),
        "status": one.status,
        "status_text": status_text(one.status),
    }


def _one_code(tester: "Tester", code: int) -> Answer:
    """Status, snapshot and extended data of a code."""
    from hil.uds.dtc_report import snapshots
    from hil.uds.tester import FoundDtc, RefusedError

    wanted = code.to_bytes(3, "big") + b"\xff"
    snapshot = tester.ask(b"\x19\x04" + wanted)
    if len(snapshot) < 6:
        raise BrakebenchError(f"snapshot of a code: expected 6 bytes or more, got {snapshot.hex(' ')}")
    one = FoundDtc(int.from_bytes(snapshot[2:5], "big"), snapshot[5])
    values = _code_values(tester.known, one) | {"snapshot": [], "extended": None}
    lines = [_code_line(tester.known, one)]
    for record, did, data in snapshots(snapshot[6:], tester.known):
        lines.append(f"  snapshot {record}  {tester.known.did_text(did)} = {tester.known.value_text(did, data)}")
        values["snapshot"].append(_did_values(tester.known, did, data) | {"record": record})
    if len(snapshot) == 6:
        lines.append("  no snapshot")
    try:
        extended = tester.ask(b"\x19\x06" + wanted)[6:]
    except RefusedError as error:
        return [*lines, f"  no extended data: {error}"], values
    values["extended"] = extended.hex()
    return [*lines, f"  extended data  {', '.join(tester.known.extended_text(extended)) or 'none'}"], values


def _did_values(known: "Names", did: int, data: bytes) -> dict[str, Any]:
    return {"did": did, "name": known.did_text(did)[7:], "data": data.hex(), "text": known.value_text(did, data)}


def _add_clear(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("code", nargs="?", metavar="CODE", help="one code or a group (default: all)")
    parser.set_defaults(do=_clear, action="clear")


def _clear(tester: "Tester", args: argparse.Namespace) -> Answer:
    from hil.uds.dtc import ALL_CODES, dtc_number

    code = ALL_CODES if args.code is None else _code(tester.known, args.code, dtc_number)
    tester.clear(code)
    return [f"cleared: {'all codes' if code == ALL_CODES else tester.known.dtc_text(code)}"], None


def _add_read(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("did", nargs="+", metavar="DID", help="data identifiers: a name of our ECU's, or 0xF190")
    parser.set_defaults(do=_read, action="read")


def _read(tester: "Tester", args: argparse.Namespace) -> Answer:
    """One after the other: of a foreign ECU nobody can tell where one value ends."""
    lines, values = [], []
    for did in [_did(tester.known, text) for text in args.did]:
        data = tester.ask(b"\x22" + did.to_bytes(2, "big"))[3:]
        lines.append(f"{tester.known.did_text(did)} = {tester.known.value_text(did, data)}")
        values.append(_did_values(tester.known, did, data))
    return lines, values


def _add_write(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("did", metavar="DID", help="data identifier: a name of our ECU's, or 0xF190")
    parser.add_argument(
        "value", metavar="VALUE", help="bytes in hexadecimal; of our ECU's numbers the value in its unit"
    )
    parser.set_defaults(do=_write, action="write")


def _write(tester: "Tester", args: argparse.Namespace) -> Answer:
    did = _did(tester.known, args.did, coded=True)
    data = _value(tester.known, did, args.value)
    tester.ask(b"\x2e" + did.to_bytes(2, "big") + data)
    shown = f"{tester.known.did_text(did)} = {tester.known.value_text(did, data)}"
    return [f"written: {shown}"], _did_values(tester.known, did, data)


def _value(known: "Names", did: int, text: str) -> bytes:
    one = known.dids.get(did)
    return _bytes(text, "value") if one is None or one.coded is None else one.coded(text)


def _add_routine(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("routine", metavar="NAME", help="routine: a name of our ECU's, or 0x0203")
    parser.add_argument("what", choices=("start", "stop", "result"))
    parser.add_argument("data", nargs="?", default="", metavar="BYTES", help="its option, hexadecimal")
    parser.set_defaults(do=_routine, action="routine")


def _routine(tester: "Tester", args: argparse.Namespace) -> Answer:
    by_name = _by_name({routine: one.name for routine, one in tester.known.routines.items()})
    routine = by_name.get(_plain(args.routine))
    if routine is None:
        routine = number(args.routine, "routine", 0xFFFF, _such(args.routine, by_name, "0x0203"))
    sub = ("start", "stop", "result").index(args.what) + 1
    answer = tester.ask(bytes((0x31, sub)) + routine.to_bytes(2, "big") + _bytes(args.data, "option"))[4:]
    result = f" = {tester.known.routine_value(routine, answer)}" if answer else ""
    text = f"{args.what}: {tester.known.routine_text(routine)}{result}"
    return [text], {"routine": routine, "what": args.what, "data": answer.hex()}


def _add_session(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", metavar="NAME", help="default, programming, extended, safety system, or a number")
    _add_hold(parser, "stay so long, with tester present")
    parser.set_defaults(do=_session, action="session")


def _add_hold(parser: argparse.ArgumentParser, words: str) -> None:
    parser.add_argument("--hold", type=partial(seconds, most_s=HOLD_MOST_S), default=0.0, metavar="S", help=words)


def session_number(text: str) -> int:
    """Number of a session by its name or number."""
    from hil.uds.names import SESSIONS

    by_name = {name: session for session, name in SESSIONS.items()}
    return by_name[text] if text in by_name else number(text, "session", 0x7F, ", ".join(by_name))


def _session(tester: "Tester", args: argparse.Namespace) -> Answer:
    answer = tester.session(session_number(args.name))
    _hold(tester, args.hold)
    return [tester.say(answer).text], None


def _hold(tester: "Tester", hold_s: float) -> None:
    """Keep the session alive, and with it what it holds."""
    from hil.rt.clock import WallClock
    from hil.uds.tester import PRESENT_EVERY_S

    clock = WallClock()
    until_ns = clock.now_ns() + round(hold_s * 1e9)
    while (now_ns := clock.now_ns()) < until_ns:
        tester.present()
        clock.sleep_until(min(until_ns, now_ns + round(PRESENT_EVERY_S * 1e9)))


def _add_reset(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("kind", nargs="?", default="hard", choices=("hard", "key", "soft"), help="(default: hard)")
    parser.set_defaults(do=_reset, action="reset")


def _reset(tester: "Tester", args: argparse.Namespace) -> Answer:
    kind = {"hard": 1, "key": 2, "soft": 3}[args.kind]
    return [tester.say(tester.ask(bytes((0x11, kind)))).text], None


_CONTROLS = {"return": 0, "default": 1, "freeze": 2, "adjust": 3}


def _add_io(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("did", metavar="DID", help="what is controlled: a name of our ECU's, or 0x1234")
    parser.add_argument("control", choices=tuple(_CONTROLS))
    parser.add_argument("value", nargs="?", metavar="VALUE", help="of adjust: bytes, or a value in its unit")
    _add_hold(parser, "hold it so long, then return control (else the ECU's session ends it)")
    parser.set_defaults(do=_io, action="io")


def _io(tester: "Tester", args: argparse.Namespace) -> Answer:
    if (args.value is None) == (args.control == "adjust"):
        raise BrakebenchError(f"io {args.control}: expected {'a' if args.value is None else 'no'} value")
    did = _did(tester.known, args.did, coded=True)
    data = b"" if args.value is None else _value(tester.known, did, args.value)
    head = b"\x2f" + did.to_bytes(2, "big")
    answer = tester.ask(head + bytes((_CONTROLS[args.control],)) + data)
    lines = [tester.say(answer).text]
    if args.hold:
        try:
            _hold(tester, args.hold)
        finally:
            lines.append(tester.say(tester.ask(head + bytes((_CONTROLS["return"],)))).text)
    return lines, {"did": did, "data": answer[4:].hex()}


def _add_request(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bytes", nargs="+", metavar="BYTES", help="the request in hexadecimal, from its service on")
    parser.set_defaults(do=_request, action="request")


def _request(tester: "Tester", args: argparse.Namespace) -> Answer:
    answer = tester.ask(_bytes("".join(args.bytes), "request"))
    if not answer:
        return ["no answer was wanted"], None
    return [tester.say(answer).text, answer.hex(" ").upper()], {"data": answer.hex()}


ACTIONS: tuple[tuple[str, str, Callable[[argparse.ArgumentParser], None]], ...] = (
    ("read-dtc", "list trouble codes, or one with its snapshot and extended data", _add_read_dtc),
    ("clear", "clear trouble codes", _add_clear),
    ("read", "read data by identifier", _add_read),
    ("write", "write data by identifier", _add_write),
    ("measure", "read quantities of our ECU's law periodically", add_measure),
    ("routine", "start or stop a routine, or ask for its result", _add_routine),
    ("session", "change the session", _add_session),
    ("reset", "restart the ECU", _add_reset),
    ("io", "control an input or output", _add_io),
    ("request", "send any request of ISO 14229", _add_request),
)
"""Actions in the order of the help: name, what it does, its arguments."""
