"""Requests and answers of ReadDTCInformation in words."""

from hil.uds.dtc import status_text
from hil.uds.known import Names
from hil.uds.payload import Payload


def count_text(n: int) -> str:
    """Number of codes in words."""
    return "no codes" if n == 0 else f"{n} code{'' if n == 1 else 's'}"


def _mask(status: int) -> str:
    return f"mask 0x{status:02X}" + ("" if status == 0xFF else f" ({status_text(status)})")


def _record(number: int) -> str:
    return "all records" if number == 0xFF else f"record {number}"


def report_words(rest: Payload, sub: int, known: Names, answer: bool) -> list[str]:
    """Words of a request or an answer of ReadDTCInformation behind its sub-function (ISO 14229-1)."""
    if not answer:
        return _report_request(rest, sub, known)
    if sub in (0x01, 0x07, 0x11, 0x12):
        rest.take(2)
        return [count_text(rest.number(2))]
    if sub in (0x02, 0x0A, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x13, 0x15, 0x17):
        rest.take(2 if sub == 0x17 else 1)
        found = [(rest.number(3), rest.number()) for _ in range(len(rest.left) // 4)]
        return [count_text(len(found)), *(_with_status(known, *one) for one in found)]
    if sub in (0x08, 0x09):
        rest.take(1)
        records = [(rest.number(), rest.number(), rest.number(3), rest.number()) for _ in range(len(rest.left) // 6)]
        return [
            count_text(len(records)),
            *(f"{_with_status(known, n, s)} severity 0x{v:02X}" for v, _, n, s in records),
        ]
    if sub in (0x03, 0x14):
        what = "snapshot" if sub == 0x03 else "counter"
        pairs = [(rest.number(3), rest.number()) for _ in range(len(rest.left) // 4)]
        return [count_text(len(pairs)), *(f"{known.dtc_text(number)} {what} {value}" for number, value in pairs)]
    if sub in (0x04, 0x06, 0x10, 0x18, 0x19):
        if sub in (0x18, 0x19):
            rest.take(1)
        words = [_with_status(known, rest.number(3), rest.number())]
        return words + (_snapshots(rest, known) if sub in (0x04, 0x18) else known.extended_text(rest.rest()))
    return []


def _report_request(rest: Payload, sub: int, known: Names) -> list[str]:
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
    rest, found = Payload(records), []
    while rest.left:
        record, count = rest.number(), rest.number()
        for _ in range(count):
            did = rest.number(2)
            length = known.dids[did].length if did in known.dids else None
            found.append((record, did, rest.rest() if length is None else rest.take(length)))
            if length is None:
                return found
    return found


def _snapshots(rest: Payload, known: Names) -> list[str]:
    words, shown = [], -1
    for record, did, data in snapshots(rest.rest(), known):
        words += [f"record {record}"] if record != shown else []
        words.append(f"{known.did_text(did)} = {known.value_text(did, data)}")
        shown = record
    return words
