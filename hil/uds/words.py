"""A diagnostic message as one line of words: what is asked, what is answered, why it is refused."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from hil.uds import names
from hil.uds.dtc import ALL_CODES, obd_text
from hil.uds.dtc_report import count_text, report_words
from hil.uds.known import FOREIGN, Names, hex_text, named, value_text
from hil.uds.payload import CutShortError, Payload


class Kind(Enum):
    """What a message is, by its first byte."""

    REQUEST = "request"
    ANSWER = "answer"
    REFUSAL = "refusal"
    PENDING = "pending"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class Said:
    """A message in words; ``service`` is that of the request, also in an answer (None: no service at all)."""

    kind: Kind
    service: int | None
    text: str


def service_text(service: int) -> str:
    """Name of a service, with its number where it has none."""
    return names.SERVICES.get(service) or names.OBD_SERVICES.get(service) or f"service 0x{service:02X}"


def refusal_text(code: int) -> str:
    """Negative response code in words, with its number."""
    return f"{names.NEGATIVE_CODES.get(code, 'unknown reason')} (0x{code:02X})"


def is_service(service: int) -> bool:
    """Whether it is a service of ISO 14229 or ISO 15031-5."""
    return service in names.SERVICES or service in names.OBD_SERVICES


def describe(message: bytes, known: Names = FOREIGN) -> Said:
    """Say what a message is.

    Parameters
    ----------
    message : all its bytes, as ISO-TP delivers them.
    known : names of the ECU it goes to or comes from.
    """
    if not message:
        return Said(Kind.OTHER, None, "empty message")
    first = message[0]
    if first == names.NEGATIVE_RESPONSE:
        return _refusal(message)
    if is_service(first):
        return Said(Kind.REQUEST, first, _line(first, message[1:], known, answer=False))
    service = first - names.RESPONSE_OFFSET
    if is_service(service):
        return Said(Kind.ANSWER, service, _line(service, message[1:], known, answer=True))
    return Said(Kind.OTHER, None, f"no service of ISO 14229: {hex_text(message)}")


def _refusal(message: bytes) -> Said:
    if len(message) < 3:
        return Said(Kind.OTHER, None, f"negative response cut short: {hex_text(message)}")
    kind = Kind.PENDING if message[2] == names.PENDING else Kind.REFUSAL
    return Said(kind, message[1], f"{service_text(message[1])}: {refusal_text(message[2])}")


def _line(service: int, data: bytes, known: Names, answer: bool) -> str:
    words, rest = [service_text(service)], Payload(data)
    try:
        quiet = False
        sub = 0
        if service in names.WITH_SUBFUNCTION:
            byte = rest.number()
            sub, quiet = byte & ~names.SUPPRESS_BIT, bool(byte & names.SUPPRESS_BIT) and not answer
            words.append(_level(sub) if service == 0x27 else named(names.SUBFUNCTIONS.get(service, {}), sub))
        words += _PARTS[service](rest, sub, known, answer) if service in _PARTS else []
        if rest.left:
            words.append(value_text(rest.rest()))
        if quiet:
            words.append("no answer wanted")
    except CutShortError:
        words.append(f"cut short at {len(data) + 1} bytes")
    return ", ".join(filter(None, words))


def _level(sub: int) -> str:
    return f"{'request seed' if sub % 2 else 'send key'}, level {(sub + 1) // 2}"


def _session(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    if not answer:
        return []
    p2_ms, p2_star_ms = rest.number(2), rest.number(2) * 10
    return [f"P2 {p2_ms} ms", f"P2* {p2_star_ms} ms"]


def _clear(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    if answer:
        return []
    group = rest.number(3)
    return ["all codes" if group == ALL_CODES else known.dtc_text(group)]


def _read(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    words = []
    while rest.left:
        did = rest.number(2)
        if not answer:
            words.append(known.did_text(did))
            continue
        length = known.dids[did].length if did in known.dids else None
        data = rest.rest() if length is None else rest.take(length)
        words.append(f"{known.did_text(did)} = {known.value_text(did, data)}")
    return words


def _write(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    did = rest.number(2)
    return [known.did_text(did)] if answer else [f"{known.did_text(did)} = {known.value_text(did, rest.rest())}"]


def _memory(rest: Payload) -> str:
    form = rest.number()
    address, size = rest.number(form & 0xF), rest.number(form >> 4)
    return f"{size} bytes at 0x{address:X}"


def _read_memory(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    return [] if answer else [_memory(rest)]


def _write_memory(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    return [_memory(rest)]


def _transfer_request(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    if not answer:
        return [f"format 0x{rest.number():02X}", _memory(rest)]
    return [f"blocks of at most {rest.number(rest.number() >> 4)} bytes"]


def _transfer(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    return [f"block {rest.number()}", *([f"{len(data)} bytes"] if (data := rest.rest()) else [])]


def _file(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    return [named(names.FILE_MODES, rest.number())]


def _security(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    data = rest.rest()
    if not data:
        return []
    if answer and not any(data):
        return ["already unlocked"]
    return [f"{'seed' if answer else 'key' if sub % 2 == 0 else 'data'} {hex_text(data)}"]


def _communication(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    if answer:
        return []
    kind = rest.number()
    node = f", node 0x{rest.number(2):04X}" if sub in (4, 5) else ""
    return [named(names.COMMUNICATION_TYPES, kind & 0x3) + node]


def _periodic(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    if answer:
        return []
    rate = named(names.PERIODIC_RATES, rest.number())
    return [rate, *(known.did_text(0xF200 | low) for low in rest.rest())]


def _define(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    words = [known.did_text(rest.number(2))] if rest.left else []
    while rest.left and sub == 1 and not answer:
        source, place, size = rest.number(2), rest.number(), rest.number()
        words.append(f"{size} bytes from byte {place} of {known.did_text(source)}")
    return words


def _io(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    did = rest.number(2)
    control = named(names.IO_CONTROLS, rest.number()) if rest.left else ""
    data = rest.rest()
    return [known.did_text(did), control, known.value_text(did, data)]


def _routine(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    routine, data = rest.number(2), rest.rest()
    text = known.routine_text(routine)
    return [
        f"{text} = {known.routine_value(routine, data)}" if answer and data else text,
        *([] if answer else [hex_text(data)]),
    ]


def _reset(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    return [f"power down in {rest.number()} s"] if answer and sub == 4 else []


def _obd(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    return [f"PID 0x{rest.number():02X}"] if rest.left else []


def _obd_codes(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    if not answer:
        return []
    count = rest.number()
    return [count_text(count), *(obd_text(rest.number(2)) for _ in range(count))]


_PARTS: Mapping[int, Callable[[Payload, int, Names, bool], list[str]]] = {
    **dict.fromkeys((0x01, 0x02, 0x05, 0x06, 0x08, 0x09), _obd),
    **dict.fromkeys((0x03, 0x07, 0x0A), _obd_codes),
    0x10: _session,
    0x11: _reset,
    0x14: _clear,
    0x19: report_words,
    0x22: _read,
    0x23: _read_memory,
    0x27: _security,
    0x28: _communication,
    0x2A: _periodic,
    0x2C: _define,
    0x2E: _write,
    0x2F: _io,
    0x31: _routine,
    0x34: _transfer_request,
    0x35: _transfer_request,
    0x36: _transfer,
    0x38: _file,
    0x3D: _write_memory,
}
