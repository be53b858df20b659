"""The services: which there are in which session, and what each answers.

Checks come in the order of ISO 14229-1: service, session, security, least length, sub-function and its session, then
what the service itself asks for.
"""

import struct
from collections.abc import Callable, Mapping
from typing import NamedTuple

from ecu.diagnostics import calibration, quantities, routines
from ecu.diagnostics import security as lock
from ecu.diagnostics.actuators import DEMANDS, Actuators
from ecu.diagnostics.exchange import View
from ecu.diagnostics.identifiers import ACTIVE_SESSION, IDENTIFIERS, SNAPSHOT
from ecu.diagnostics.protocol import (
    MOST_PERIODIC,
    P2_NS,
    P2_STAR_NS,
    SUPPRESS,
    Nrc,
    Refused,
    Session,
    expect_length,
)
from ecu.diagnostics.security import Security
from ecu.diagnostics.trouble_memory import TroubleCodeMemory, dtc_of
from ecu.law.trouble_codes import CODES, TroubleCode
from ecu.parameters.ecu import EcuParameters

BOTH = (Session.DEFAULT, Session.EXTENDED)
EXTENDED = (Session.EXTENDED,)
ALL_CODES = 0xFFFFFF
HARD_RESET, SOFT_RESET = 0x01, 0x03
RATES_NS = {0x01: 1_000_000_000, 0x02: 100_000_000, 0x03: 10_000_000}
"""Periods of ReadDataByPeriodicIdentifier: slow, medium, fast."""
STOP_SENDING = 0x04
_EVERY_STATUS = 0xFF
_DTC_FORMAT = 0x01  # ISO 14229-1
_ALL_RECORDS, _SNAPSHOT_RECORD = 0xFF, 0x01
EXTENDED_RECORDS = {0x01: "occurrences", 0x02: "cycles without failure", 0x03: "fault detection counter"}


class Service(NamedTuple):
    """A row of the table; ``least``: bytes of the shortest request; ``sub``: sub-functions with their names."""

    name: str
    sessions: tuple[Session, ...]
    least: int
    sub: Mapping[int, str] | None = None


SERVICES: dict[int, Service] = {
    0x10: Service("DiagnosticSessionControl", BOTH, 2, {1: "default", 3: "extended"}),
    0x11: Service("ECUReset", BOTH, 2, {HARD_RESET: "hard", SOFT_RESET: "soft"}),
    0x14: Service("ClearDiagnosticInformation", BOTH, 4),
    0x19: Service(
        "ReadDTCInformation", BOTH, 2,
        {1: "number by mask", 2: "by mask", 4: "snapshot", 6: "extended data", 0x0A: "supported"},
    ),
    0x22: Service("ReadDataByIdentifier", BOTH, 3),
    0x27: Service("SecurityAccess", EXTENDED, 2, {lock.REQUEST_SEED: "seed", lock.SEND_KEY: "key"}),
    0x28: Service("CommunicationControl", EXTENDED, 2, {0: "send and receive", 1: "receive only"}),
    0x2A: Service("ReadDataByPeriodicIdentifier", EXTENDED, 2),
    0x2E: Service("WriteDataByIdentifier", EXTENDED, 4),
    0x2F: Service("InputOutputControlByIdentifier", EXTENDED, 4),
    0x31: Service("RoutineControl", EXTENDED, 2, {1: "start", 2: "stop", 3: "results"}),
    0x3E: Service("TesterPresent", BOTH, 2, {0: "zero"}),
    0x85: Service("ControlDTCSetting", EXTENDED, 2, {1: "on", 2: "off"}),
}  # fmt: skip


class Services:
    """State behind the services.

    Attributes
    ----------
    memory : trouble codes; ``parameters``, ``forget``, ``restart``: what a request has just ordered, the server takes
        it. ``periodic``: period and next time of each periodic identifier, ns.
    """

    def __init__(self) -> None:
        self.session = Session.DEFAULT
        self.security = Security()
        self.memory = TroubleCodeMemory()
        self.actuators = Actuators()
        self.routines = routines.Routines()
        self.periodic: dict[int, tuple[int, int]] = {}
        self.silent = False
        self.parameters: EcuParameters | None = None
        self.forget: tuple[TroubleCode, ...] = ()
        self.restart: int | None = None
        self._serve: dict[int, Callable[[int, bytes, View], bytes]] = {
            0x10: self._change_session, 0x11: self._reset, 0x14: self._clear, 0x19: self._read_codes,
            0x22: self._read, 0x27: lambda now_ns, request, _: self.security.serve(now_ns, request),
            0x28: self._communication, 0x2A: self._read_periodically, 0x2E: self._write, 0x2F: self._control,
            0x31: self._routine, 0x3E: self._present, 0x85: self._set_codes,
        }  # fmt: skip

    def serve(self, now_ns: int, request: bytes, view: View) -> bytes:
        """Positive answer behind its service identifier; Refused with what is answered otherwise."""
        service = SERVICES.get(request[0])
        if service is None:
            raise Refused(Nrc.SERVICE_NOT_SUPPORTED)
        if self.session not in service.sessions:
            raise Refused(Nrc.SERVICE_NOT_SUPPORTED_IN_SESSION)
        if len(request) < service.least:
            raise Refused(Nrc.INCORRECT_LENGTH)
        if service.sub is not None and request[1] & ~SUPPRESS not in service.sub:
            raise Refused(Nrc.SUB_FUNCTION_NOT_SUPPORTED)
        return self._serve[request[0]](now_ns, request, view)

    def enter(self, session: Session) -> None:
        """Begin a session: what needs the lock is given back, the rest with the default session (ISO 14229-1)."""
        self.session = session
        self.security.lock()
        self.actuators.release()
        self.routines.abort()
        if session == Session.DEFAULT:
            self.periodic.clear()
            self.silent = False
            self.memory.enabled = True

    def _change_session(self, _: int, request: bytes, _view: View) -> bytes:
        expect_length(request, 2)
        self.enter(Session(request[1] & ~SUPPRESS))
        return struct.pack(">BHH", self.session, P2_NS // 1_000_000, P2_STAR_NS // 10_000_000)

    def _reset(self, _: int, request: bytes, view: View) -> bytes:
        expect_length(request, 2)
        if not view.standstill:
            raise Refused(Nrc.CONDITIONS_NOT_CORRECT)
        self.restart = request[1] & ~SUPPRESS
        return bytes((self.restart,))

    def _clear(self, _: int, request: bytes, _view: View) -> bytes:
        expect_length(request, 4)
        group = int.from_bytes(request[1:], "big")
        codes = tuple(code for code in CODES if group in (ALL_CODES, dtc_of(code)))
        if not codes:
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        self.memory.clear(tuple(map(dtc_of, codes)))
        self.forget = (*self.forget, *codes)
        return b""

    def _read_codes(self, _: int, request: bytes, _view: View) -> bytes:
        kind = request[1] & ~SUPPRESS
        entries = self.memory.entries
        if kind in (1, 2):
            expect_length(request, 3)
            found = [(dtc, entry.status) for dtc, entry in entries.items() if entry.status & request[2]]
            if kind == 1:
                return struct.pack(">BBBH", kind, _EVERY_STATUS, _DTC_FORMAT, len(found))
            return bytes((kind, _EVERY_STATUS)) + b"".join(struct.pack(">I", dtc << 8 | s) for dtc, s in found)
        if kind == 0x0A:
            expect_length(request, 2)
            listed = (struct.pack(">I", dtc << 8 | entry.status) for dtc, entry in entries.items())
            return bytes((kind, _EVERY_STATUS)) + b"".join(listed)
        expect_length(request, 6)
        dtc, record = int.from_bytes(request[2:5], "big"), request[5]
        if dtc not in entries:
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        head = struct.pack(">BI", kind, dtc << 8 | entries[dtc].status)
        return head + (self._snapshot(dtc, record) if kind == 4 else self._extended_data(dtc, record))

    def _snapshot(self, dtc: int, record: int) -> bytes:
        if record not in (_SNAPSHOT_RECORD, _ALL_RECORDS):
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        held = self.memory.entries[dtc].snapshot
        if held is None:
            return b""
        parts = (struct.pack(">H", did) + group.encode(*held) for did, group in SNAPSHOT.items())
        return bytes((_SNAPSHOT_RECORD, len(SNAPSHOT))) + b"".join(parts)

    def _extended_data(self, dtc: int, record: int) -> bytes:
        entry = self.memory.entries[dtc]
        # the law's verdict is one of failed and passed: the ends of the counter's range
        detection = 0x7F if entry.status & 1 else 0x80
        values = dict(zip(EXTENDED_RECORDS, (entry.occurrences, entry.aging, detection), strict=True))
        if record != _ALL_RECORDS and record not in values:
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        if not entry.occurrences:
            return b""
        return b"".join(bytes((i, v)) for i, v in values.items() if record in (i, _ALL_RECORDS))

    def _read_one(self, did: int, view: View) -> bytes | None:
        if did == ACTIVE_SESSION:
            return bytes((self.session,))
        if did in DEMANDS:
            return self.actuators.read(did, view)
        return IDENTIFIERS[did].read(view) if did in IDENTIFIERS else None

    def _read(self, _: int, request: bytes, view: View) -> bytes:
        if len(request) % 2 != 1:
            raise Refused(Nrc.INCORRECT_LENGTH)
        answer = b""
        for (did,) in struct.iter_unpack(">H", request[1:]):
            data = self._read_one(did, view)
            if data is not None:
                answer += struct.pack(">H", did) + data
        if not answer:
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        return answer

    def _communication(self, _: int, request: bytes, view: View) -> bytes:
        expect_length(request, 3)
        kind = request[1] & ~SUPPRESS
        if request[2] not in (1, 3):  # normal messages; there are none of network management alone
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        if kind == 1 and not view.standstill:
            raise Refused(Nrc.CONDITIONS_NOT_CORRECT)
        self.silent = kind == 1
        return bytes((kind,))

    def _read_periodically(self, now_ns: int, request: bytes, _view: View) -> bytes:
        mode, wanted = request[1], request[2:]
        if mode != STOP_SENDING and mode not in RATES_NS:
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        known = [low for low in wanted if low < len(quantities.QUANTITIES)]
        if mode == STOP_SENDING and not wanted:
            self.periodic.clear()
        elif not wanted:
            raise Refused(Nrc.INCORRECT_LENGTH)
        elif not known or (mode != STOP_SENDING and len({*self.periodic, *known}) > MOST_PERIODIC):
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        elif mode == STOP_SENDING:
            for low in known:
                self.periodic.pop(low, None)
        else:
            self.periodic.update(dict.fromkeys(known, (RATES_NS[mode], now_ns)))
        return b""

    def due(self, now_ns: int, view: View, most: int) -> list[bytes]:
        """Periodic identifiers that are due, each with its record; beyond ``most`` they stay due."""
        out: list[bytes] = []
        for low, (period_ns, due_ns) in self.periodic.items():
            if due_ns <= now_ns and len(out) < most:
                self.periodic[low] = period_ns, max(due_ns + period_ns, now_ns + 1)
                out.append(bytes((low,)) + quantities.record(quantities.QUANTITIES[low], view))
        return out

    def _write(self, _: int, request: bytes, view: View) -> bytes:
        (did,) = struct.unpack_from(">H", request, 1)
        one = calibration.PARAMETERS.get(did)
        if one is None or not one.writable:
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        self._expect_unlocked()
        if len(request) != 3 + one.size:
            raise Refused(Nrc.INCORRECT_LENGTH)
        changed = calibration.written(one, self.parameters or view.parameters, request[3:])
        if not view.standstill:
            raise Refused(Nrc.CONDITIONS_NOT_CORRECT)
        self.parameters = changed
        return request[1:3]

    def _control(self, _: int, request: bytes, view: View) -> bytes:
        (did,) = struct.unpack_from(">H", request, 1)
        if did not in DEMANDS:
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        self._expect_unlocked()
        if self.routines.running:
            raise Refused(Nrc.CONDITIONS_NOT_CORRECT)
        return request[1:4] + self.actuators.control(did, request[3], request[4:], view)

    def _routine(self, _: int, request: bytes, view: View) -> bytes:
        expect_length(request, 4)
        kind = request[1] & ~SUPPRESS
        (number,) = struct.unpack_from(">H", request, 2)
        if number not in routines.NAMES:
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        if number in routines.SECURED and kind != routines.RESULTS:
            self._expect_unlocked()
        return bytes((kind,)) + request[2:] + self.routines.control(kind, number, view, self.actuators.active)

    def _present(self, _: int, request: bytes, _view: View) -> bytes:
        expect_length(request, 2)
        return b"\0"

    def _set_codes(self, _: int, request: bytes, _view: View) -> bytes:
        expect_length(request, 2)
        kind = request[1] & ~SUPPRESS
        self.memory.enabled = kind == 1
        return bytes((kind,))

    def _expect_unlocked(self) -> None:
        if not self.security.unlocked:
            raise Refused(Nrc.SECURITY_ACCESS_DENIED)
