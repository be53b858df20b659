"""The page docs/uds.md: services, identifiers and routines of the controller, generated from the server's tables."""

from collections.abc import Iterator

from dbc.diagnostic_ids import PERIODIC, REQUEST, REQUEST_FUNCTIONAL, RESPONSE
from ecu.diagnostics import routines, security
from ecu.diagnostics.actuators import DEMANDS
from ecu.diagnostics.calibration import PARAMETERS
from ecu.diagnostics.identifiers import ACTIVE_SESSION, IDENTIFIERS, Identifier
from ecu.diagnostics.protocol import (
    BURST,
    MOST_ANSWER,
    MOST_PERIODIC,
    MOST_REQUEST,
    P2_NS,
    P2_STAR_NS,
    S3_NS,
    SILENT_WHEN_FUNCTIONAL,
    Nrc,
    Session,
)
from ecu.diagnostics.services import SERVICES, Service
from ecu.diagnostics.trouble_memory import AGED_AFTER
from hil.validation.doc_pages.wrap import markdown

_SILENT = ", ".join(f"0x{nrc:02X}" for nrc in sorted(SILENT_WHEN_FUNCTIONAL))
_INTRO = f"""# Diagnostics of the controller by UDS

What the brake controller answers to a tester (ISO 14229-1 over ISO 15765-2). Generated from `ecu/diagnostics` by
`python -m hil.validation.doc_pages.uds_page`; a test holds it current, and a scan over every service in every session
finds exactly this.

| frames (11 bits, 8 bytes, filled with 0xCC) | identifier |
|---|---|
| requests to the controller alone (physical) | 0x{REQUEST:03X} |
| requests to everybody (functional), single frames only | 0x{REQUEST_FUNCTIONAL:03X} |
| answers | 0x{RESPONSE:03X} |
| periodic data, without ISO-TP | 0x{PERIODIC:03X} |

- **Times**: P2 {P2_NS // 10**6} ms, P2* {P2_STAR_NS // 10**9} s, S3 {S3_NS // 10**9} s. ISO 14229-2 asks that
  an answer begins within P2. Here a complete answer ends within P2, because some testers (udsoncan) measure to its end.
  If it would take longer, response pending (0x78) is sent first. The controller estimates the duration from block
  size and STmin of the tester's last flow control. Before the first flow control it assumes the slowest values. If a
  tester becomes slower between two answers, one answer may end late.
- **Lengths**: requests up to {MOST_REQUEST} bytes, answers up to {MOST_ANSWER} (longer: 0x14). At most {BURST}
  diagnostic frames are sent per tick, for adapters with short queues: answers first, then periodic data. A long answer
  leaves room for all periodic identifiers that are active, and takes longer for it. While an answer is being sent,
  other requests are ignored, except tester present with a suppressed answer.
- **Functional requests** are answered, but the negative answers {_SILENT} are not sent. **Suppressed** positive
  answers: bit 0x80 of the sub-function.
- **Checks** come in the order of ISO 14229-1: 0x11 service, 0x7F session, 0x13 least length, 0x12 sub-function, 0x31
  identifier, 0x33 lock, 0x13 length, 0x31 value, 0x22 conditions.
- **The session ends** {S3_NS // 10**9} s after the last request. Then, and at each change of session, the tester's
  demands go back to the law, routines stop, the lock closes; with the default session periodic data end, messages are
  sent again and the setting of codes is on.
- **The driver comes first**: pressures and motors are the tester's only while the car stands by every wheel speed and
  by the estimate, the mode has demands and the driver does not brake. In the tick in which one of these ends, the law
  has them back. A reset, writing, and silence on the bus need a standing car, too.
"""
_CODES = f"""
## Trouble codes

The three bytes of a code are its number in [trouble-codes.md](trouble-codes.md) and 0x00. The law debounces: a code
that it finds active is failed, pending and confirmed in the same tick, and the warning indicator is asked for while it
is active. When the code heals, *test failed* and the indicator are cleared. The snapshot (record 0x01) holds the car
when the code became confirmed; extended data are how often it became active (0x01), operation cycles without failure
(0x02) and the fault detection counter (0x03). An operation cycle lasts from one ECUReset to the next; after
{AGED_AFTER} of them without failure a code is forgotten. The memory lasts over resets, not over the end of the process.
ClearDiagnosticInformation takes all codes (0xFFFFFF) or one; one that is still active comes again at the next tick.

## SecurityAccess

Level 0x01/0x02, a teaching example: key = ((seed XOR 0x4252414B) rotated left by 7 bits) + 0x45, 32 bits, big endian
(`ecu.diagnostics.security.key_of`). After {security.MOST_ATTEMPTS} wrong keys (0x35, the last 0x36) no seed is given
for {security.DELAY_NS // 10**9} s (0x37); neither a session nor a reset shortens it. It opens writing, demands, and the
routines that press.

## ECUReset, CommunicationControl

Hard (0x01) and soft (0x03) reset begin the law anew behind the answer, in INIT; the hard one takes back what was
written and the zero of the pressure sensors. CommunicationControl stops what the controller sends on the vehicle bus
(0x01) but diagnostics; the brake then follows its own pedal map. Reception stays: the law needs its sensors.
"""
_DATA = f"""
## Data identifiers

Numbers are big endian. Quantities 0xF200 and up begin with the low byte of the law's tick number, so that missing
samples show, then a 32-bit float. ReadDataByPeriodicIdentifier sends the same bytes behind the identifier's low byte,
each 1 s (0x01), 100 ms (0x02) or 10 ms (0x03), at most {MOST_PERIODIC} identifiers at once; 0x04 stops. Parameters are
64-bit floats, exactly those of the set; the writable ones take any value within their bounds that goes with the others
(fade_start above fade_end, friction_lowest below friction_highest), until a hard reset. One that is not known is left
out of an answer with several; 0x31 where none is known.

| identifier | name | unit | bytes | write |
|---|---|---|---|---|"""


def _answers(sid: int, service: Service | None, session: Session, functional: bool) -> str:
    if service is None:
        nrc = Nrc.SERVICE_NOT_SUPPORTED
    elif session not in service.sessions:
        nrc = Nrc.SERVICE_NOT_SUPPORTED_IN_SESSION
    else:
        return f"0x{sid + 0x40:02X}"
    return "none" if functional and nrc in SILENT_WHEN_FUNCTIONAL else f"0x{nrc:02X}"


def _services() -> Iterator[str]:
    cases = [(session, functional) for session in Session for functional in (False, True)]
    yield from ("", "## Services", "")
    heads = [f"{session.name.lower()}, {'functional' if functional else 'physical'}" for session, functional in cases]
    yield f"| service | name | sub-functions | {' | '.join(heads)} |"
    yield f"|---|---|---|{'---|' * len(cases)}"
    for sid, service in SERVICES.items():
        sub = ", ".join(f"0x{number:02X} {name}" for number, name in (service.sub or {}).items()) or "none"
        cells = [_answers(sid, service, *case) for case in cases]
        yield f"| 0x{sid:02X} | {service.name} | {sub} | {' | '.join(cells)} |"
    cells = [_answers(0, None, *case) for case in cases]
    yield f"| all others | | | {' | '.join(cells)} |"
    yield ""
    yield (
        "A sub-function that is not named: 0x12, functional: none. A request shorter than its service needs, or "
        "longer: 0x13, both ways."
    )


def _row(did: int, one: Identifier) -> str:
    parameter = PARAMETERS.get(did)
    write = f"{parameter.low:g} to {parameter.high:g}" if parameter is not None and parameter.writable else ""
    form = one.form.lstrip(">") if one.form != "text" else "text"
    return f"| 0x{did:04X} | {one.name} | {one.unit} | {one.size} ({form}) | {write} |"


def _identifiers() -> Iterator[str]:
    yield _DATA
    rows = {did: _row(did, one) for did, one in IDENTIFIERS.items()}
    rows[ACTIVE_SESSION] = f"| 0x{ACTIVE_SESSION:04X} | active_session |  | 1 (B) |  |"
    for did, one in DEMANDS.items():
        rows[did] = f"| 0x{did:04X} | {one.name} | {one.unit} | 4 (f) | 0x2F: {one.low:g} to {one.high:g} |"
    yield from (rows[did] for did in sorted(rows))


def _routines() -> Iterator[str]:
    yield """
## InputOutputControl

0x00 returns a demand to the law, 0x02 keeps it as it is, 0x03 sets it (a 32-bit float, SI); the answer holds the demand
as it is sent. The law is told what was asked, so a demand of the tester's makes no trouble code.

## Routines

| routine | name | lock | results behind the state |
|---|---|---|---|"""
    results = {
        routines.SELF_TEST: "supplied sources (16 bits, order of `ecu.law.types.Source`), active codes, mode",
        routines.BLEED: f"none; {routines.PULSES} pulses of {routines.BLEED_PA / 1e5:g} bar on each wheel",
        routines.PRESSURE_ZERO: "four 32-bit floats, Pa: what the sensors show without pressure, taken off from now on",
    }
    for number, name in routines.NAMES.items():
        lock = "yes" if number in routines.SECURED else ""
        yield f"| 0x{number:04X} | {name} | {lock} | {results[number]} |"
    states = ", ".join(f"{state.value} {state.name.lower().replace('_', ' ')}" for state in routines.State)
    yield ""
    yield f"States: {states}. One routine or demands at a time (0x22); stopping one that does not run is 0x24."


def _joined(text: str) -> Iterator[str]:
    """Lines of a text with each paragraph and point of a list as one line: numbers have made them uneven."""
    held = ""
    for line in text.strip("\n").split("\n"):
        alone = not line or line.startswith(("#", "|"))
        if held and (alone or line.startswith("- ")):
            yield held
            held = ""
        if alone:
            yield line
        else:
            held = f"{held} {line.strip()}".strip()
    if held:
        yield held


def page() -> str:
    """The page in Markdown."""
    parts = (_INTRO, "\n".join(_services()), _CODES, "\n".join(_routines()), "\n".join(_identifiers()))
    return markdown([line for part in parts for line in ("", *_joined(part))][1:])


if __name__ == "__main__":
    from pathlib import Path

    Path("docs/uds.md").write_text(page(), encoding="utf-8")
