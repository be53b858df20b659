"""A diagnostic message as one line of words: what is asked, what is answered, why it is refused."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from hil.errors import BrakebenchError, Verdict
from hil.uds import names
from hil.uds.dtc import ALL_CODES, dtc_text, obd_text, status_text

SHOWN_BYTES = 16
"""Bytes of a value without a known form that a line shows; the rest is counted."""


class Kind(Enum):
    """What a message is, by its first byte."""

    REQUEST = "request"
    ANSWER = "answer"
    REFUSAL = "refusal"
    PENDING = "pending"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class Did:
    """A data identifier of a known ECU.

    Attributes
    ----------
    name : one word, as it is asked for.
    length : its bytes; None where they may be any number.
    value : what its bytes say, with unit.
    coded : bytes of a value as a person writes it; BrakebenchError where it is none.
    """

    name: str
    length: int | None = None
    value: Callable[[bytes], str] | None = None
    coded: Callable[[str], bytes] | None = None


@dataclass(frozen=True, slots=True)
class Names:
    """What is known of an ECU beyond the standard; nothing of a foreign one."""

    dids: Mapping[int, Did] = field(default_factory=dict)
    dtcs: Mapping[int, str] = field(default_factory=dict)
    routines: Mapping[int, Did] = field(default_factory=dict)
    records: Mapping[int, Did] = field(default_factory=dict)
    """Extended data records of a code, of one byte each."""
    periodic: Mapping[int, int] = field(default_factory=dict)
    """Data identifiers by the byte that stands for them in periodic messages."""

    def did_text(self, did: int) -> str:
        """Identifier with its name, where it has one."""
        name = self.dids[did].name if did in self.dids else names.DIDS.get(did, "")
        return f"0x{did:04X} {name}".rstrip()

    def dtc_text(self, number: int) -> str:
        """Code with its name, where it has one."""
        return f"{dtc_text(number)} {self.dtcs.get(number, '')}".rstrip()

    def routine_text(self, routine: int) -> str:
        """Routine identifier with its name, where it has one."""
        return f"0x{routine:04X} {self.routines[routine].name if routine in self.routines else ''}".rstrip()

    def routine_value(self, routine: int, data: bytes) -> str:
        """What a routine answers."""
        known = self.routines.get(routine)
        return known.value(data) if known is not None and known.value is not None and data else value_text(data)

    def periodic_text(self, data: bytes) -> str:
        """A periodic message: the byte of its data identifier, its value, padding."""
        did = self.periodic.get(data[0], 0xF200 | data[0])
        length = self.dids[did].length if did in self.dids else None
        value = data[1:] if length is None else data[1 : 1 + length]
        return f"periodic data, {self.did_text(did)} = {self.value_text(did, value)}"

    def extended_text(self, records: bytes) -> list[str]:
        """Extended data records of a code; only of an ECU whose records are known can they be told apart."""
        if len(records) % 2 == 0 and set(records[::2]) <= set(self.records):
            pairs = [(self.records[records[k]], records[k + 1 : k + 2]) for k in range(0, len(records), 2)]
            return [f"{one.name} {one.value(data) if one.value is not None else data[0]}" for one, data in pairs]
        return [f"record {records[0]} = {hex_text(records[1:])}"] if records else []

    def value_text(self, did: int, data: bytes) -> str:
        """Value of a data identifier: in its unit where that is known, as text where it is text, else its bytes."""
        known = self.dids.get(did)
        if known is not None and known.value is not None and known.length in (None, len(data)):
            return known.value(data)
        if did == 0xF186 and len(data) == 1:
            return named(names.SESSIONS, data[0])
        return value_text(data)


FOREIGN = Names()


@dataclass(frozen=True, slots=True)
class Said:
    """A message in words; ``service`` is that of the request, also in an answer (None: no service at all)."""

    kind: Kind
    service: int | None
    text: str


class CutShortError(BrakebenchError):
    """A message has fewer bytes than its service needs."""

    exit_code = Verdict.BROKEN.exit_code

    def __init__(self) -> None:
        super().__init__("the answer is cut short: it has fewer bytes than its service needs")


class _Bytes:
    """Bytes that are taken from the front."""

    def __init__(self, data: bytes) -> None:
        self.left = data

    def take(self, n: int) -> bytes:
        if len(self.left) < n:
            raise CutShortError
        taken, self.left = self.left[:n], self.left[n:]
        return taken

    def number(self, n: int = 1) -> int:
        return int.from_bytes(self.take(n), "big")

    def rest(self) -> bytes:
        return self.take(len(self.left))


def hex_text(data: bytes) -> str:
    """Bytes in hexadecimal, at most `SHOWN_BYTES` of them."""
    more = f" ... ({len(data)} bytes)" if len(data) > SHOWN_BYTES else ""
    return data[:SHOWN_BYTES].hex(" ").upper() + more


def value_text(data: bytes) -> str:
    """Bytes as text in quotes where all are visible ASCII (three at least, zeros behind are padding), else as bytes."""
    text = data.rstrip(b"\0")
    if len(text) >= 3 and all(0x20 <= byte < 0x7F for byte in text):
        return f'"{text.decode("ascii")}"'
    return hex_text(data)


def named(table: Mapping[int, str], value: int) -> str:
    """Name of a value with the value where it has none."""
    return table.get(value, f"0x{value:02X}")


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
    words, rest = [service_text(service)], _Bytes(data)
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


def _session(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    if not answer:
        return []
    p2_ms, p2_star_ms = rest.number(2), rest.number(2) * 10
    return [f"P2 {p2_ms} ms", f"P2* {p2_star_ms} ms"]


def _clear(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    if answer:
        return []
    group = rest.number(3)
    return ["all codes" if group == ALL_CODES else known.dtc_text(group)]


def _read(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
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


def _write(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    did = rest.number(2)
    return [known.did_text(did)] if answer else [f"{known.did_text(did)} = {known.value_text(did, rest.rest())}"]


def _memory(rest: _Bytes) -> str:
    form = rest.number()
    address, size = rest.number(form & 0xF), rest.number(form >> 4)
    return f"{size} bytes at 0x{address:X}"


def _read_memory(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    return [] if answer else [_memory(rest)]


def _write_memory(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    return [_memory(rest)]


def _transfer_request(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    if not answer:
        return [f"format 0x{rest.number():02X}", _memory(rest)]
    return [f"blocks of at most {rest.number(rest.number() >> 4)} bytes"]


def _transfer(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    return [f"block {rest.number()}", *([f"{len(data)} bytes"] if (data := rest.rest()) else [])]


def _file(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    return [named(names.FILE_MODES, rest.number())]


def _security(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    data = rest.rest()
    if not data:
        return []
    if answer and not any(data):
        return ["already unlocked"]
    return [f"{'seed' if answer else 'key' if sub % 2 == 0 else 'data'} {hex_text(data)}"]


def _communication(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    if answer:
        return []
    kind = rest.number()
    node = f", node 0x{rest.number(2):04X}" if sub in (4, 5) else ""
    return [named(names.COMMUNICATION_TYPES, kind & 0x3) + node]


def _periodic(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    if answer:
        return []
    rate = named(names.PERIODIC_RATES, rest.number())
    return [rate, *(known.did_text(0xF200 | low) for low in rest.rest())]


def _define(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    words = [known.did_text(rest.number(2))] if rest.left else []
    while rest.left and sub == 1 and not answer:
        source, place, size = rest.number(2), rest.number(), rest.number()
        words.append(f"{size} bytes from byte {place} of {known.did_text(source)}")
    return words


def _io(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    did = rest.number(2)
    control = named(names.IO_CONTROLS, rest.number()) if rest.left else ""
    data = rest.rest()
    return [known.did_text(did), control, known.value_text(did, data)]


def _routine(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    routine, data = rest.number(2), rest.rest()
    text = known.routine_text(routine)
    return [
        f"{text} = {known.routine_value(routine, data)}" if answer and data else text,
        *([] if answer else [hex_text(data)]),
    ]


def _reset(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    return [f"power down in {rest.number()} s"] if answer and sub == 4 else []


def _obd(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    return [f"PID 0x{rest.number():02X}"] if rest.left else []


def _obd_codes(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    if not answer:
        return []
    count = rest.number()
    return [_count(count), *(obd_text(rest.number(2)) for _ in range(count))]


def _count(n: int) -> str:
    return "no codes" if n == 0 else f"{n} code{'' if n == 1 else 's'}"


def _mask(status: int) -> str:
    return f"mask 0x{status:02X}" + ("" if status == 0xFF else f" ({status_text(status)})")


def _record(number: int) -> str:
    return "all records" if number == 0xFF else f"record {number}"


def _report(rest: _Bytes, sub: int, known: Names, answer: bool) -> list[str]:
    """ReadDTCInformation: requests and answers of ISO 14229-1:2020, tables 300 to 340."""
    if not answer:
        return _report_request(rest, sub, known)
    if sub in (0x01, 0x07, 0x11, 0x12):
        rest.take(2)
        return [_count(rest.number(2))]
    if sub in (0x02, 0x0A, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x13, 0x15, 0x17):
        rest.take(2 if sub == 0x17 else 1)
        found = [(rest.number(3), rest.number()) for _ in range(len(rest.left) // 4)]
        return [_count(len(found)), *(_with_status(known, *one) for one in found)]
    if sub in (0x08, 0x09):
        rest.take(1)
        records = [(rest.number(), rest.number(), rest.number(3), rest.number()) for _ in range(len(rest.left) // 6)]
        return [_count(len(records)), *(f"{_with_status(known, n, s)} severity 0x{v:02X}" for v, _, n, s in records)]
    if sub in (0x03, 0x14):
        what = "snapshot" if sub == 0x03 else "counter"
        pairs = [(rest.number(3), rest.number()) for _ in range(len(rest.left) // 4)]
        return [_count(len(pairs)), *(f"{known.dtc_text(number)} {what} {value}" for number, value in pairs)]
    if sub in (0x04, 0x06, 0x10, 0x18, 0x19):
        if sub in (0x18, 0x19):
            rest.take(1)
        words = [_with_status(known, rest.number(3), rest.number())]
        return words + (_snapshots(rest, known) if sub in (0x04, 0x18) else known.extended_text(rest.rest()))
    return []


def _report_request(rest: _Bytes, sub: int, known: Names) -> list[str]:
    if sub in (0x01, 0x02, 0x0F, 0x11, 0x12, 0x13):
        return [_mask(rest.number())]
    if sub == 0x17:
        return [_mask(rest.number()), f"memory {rest.number()}"]
    if sub in (0x07, 0x08):
        return [f"severity mask 0x{rest.number():02X}", _mask(rest.number())]
    if sub in (0x04, 0x06, 0x10, 0x18, 0x19):
        return [known.dtc_text(rest.number(3)), _record(rest.number())]
    if sub == 0x09:
        return [known.dtc_text(rest.number(3))]
    return [_record(rest.number())] if sub in (0x05, 0x16, 0x1A) else []


def _with_status(known: Names, number: int, status: int) -> str:
    return f"{known.dtc_text(number)} [{status_text(status)}]"


def snapshots(records: bytes, known: Names) -> list[tuple[int, int, bytes]]:
    """Part snapshot records: record number, data identifier, value.

    Only an ECU whose lengths are known tells where a value ends; else the first one takes all the rest.
    """
    rest, found = _Bytes(records), []
    while rest.left:
        record, count = rest.number(), rest.number()
        for _ in range(count):
            did = rest.number(2)
            length = known.dids[did].length if did in known.dids else None
            found.append((record, did, rest.rest() if length is None else rest.take(length)))
            if length is None:
                return found
    return found


def _snapshots(rest: _Bytes, known: Names) -> list[str]:
    words, shown = [], -1
    for record, did, data in snapshots(rest.rest(), known):
        words += [f"record {record}"] if record != shown else []
        words.append(f"{known.did_text(did)} = {known.value_text(did, data)}")
        shown = record
    return words


_PARTS: Mapping[int, Callable[[_Bytes, int, Names, bool], list[str]]] = {
    **dict.fromkeys((0x01, 0x02, 0x05, 0x06, 0x08, 0x09), _obd),
    **dict.fromkeys((0x03, 0x07, 0x0A), _obd_codes),
    0x10: _session,
    0x11: _reset,
    0x14: _clear,
    0x19: _report,
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
