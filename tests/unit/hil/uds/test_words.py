"""Messages in words, against bytes written by hand from ISO 14229-1 and against udsoncan's own requests and answers."""

import pytest
import udsoncan
from hypothesis import given
from hypothesis import strategies as st
from udsoncan import services

from hil.errors import BrakebenchError
from hil.uds import names
from hil.uds.dtc import dtc_number, dtc_text, status_text
from hil.uds.known import Did, Names
from hil.uds.own import OWN as OUR_ECU
from hil.uds.words import Kind, describe

OWN = Names(
    dids={0x0100: Did("mode", 1, lambda data: f"mode {data[0]}"), 0x0101: Did("speed", 2, lambda d: f"{d[0]} m/s")},
    dtcs={0x100100: "pedal_lost"},
    routines={0x0203: Did("self_test")},
)
SAID = [
    ("10 03", "DiagnosticSessionControl, extended"),
    ("10 83", "DiagnosticSessionControl, extended, no answer wanted"),
    ("50 03 00 32 01 F4", "DiagnosticSessionControl, extended, P2 50 ms, P2* 5000 ms"),
    ("11 01", "ECUReset, hard reset"),
    ("14 FF FF FF", "ClearDiagnosticInformation, all codes"),
    ("14 10 01 00", "ClearDiagnosticInformation, P1001-00 pedal_lost"),
    ("19 02 0D", "ReadDTCInformation, codes by status mask, mask 0x0D (failed now, pending, confirmed)"),
    ("59 02 FF", "ReadDTCInformation, codes by status mask, no codes"),
    (
        "59 02 FF 10 01 00 09 51 23 1F 01",
        "ReadDTCInformation, codes by status mask, 2 codes, P1001-00 pedal_lost [failed now, confirmed], "
        "C1123-1F [failed now]",
    ),
    ("59 01 FF 01 00 03", "ReadDTCInformation, number of codes by status mask, 3 codes"),
    ("19 04 10 01 00 FF", "ReadDTCInformation, snapshot by code, P1001-00 pedal_lost, all records"),
    (
        "59 04 10 01 00 08 01 02 01 00 03 01 01 07 00",
        "ReadDTCInformation, snapshot by code, P1001-00 pedal_lost [confirmed], record 1, 0x0100 mode = mode 3, "
        "0x0101 speed = 7 m/s",
    ),
    ("59 06 10 01 00 08 01 05", "ReadDTCInformation, extended data by code, P1001-00 pedal_lost [confirmed], "
     "record 1 = 05"),
    ("22 F1 90 01 00", "ReadDataByIdentifier, 0xF190 VIN, 0x0100 mode"),
    ("62 01 00 02 01 01 09 00", "ReadDataByIdentifier, 0x0100 mode = mode 2, 0x0101 speed = 9 m/s"),
    ("62 F1 90 41 42 43 00", 'ReadDataByIdentifier, 0xF190 VIN = "ABC"'),
    ("62 F1 86 03", "ReadDataByIdentifier, 0xF186 active diagnostic session = extended"),
    ("23 12 12 34 10", "ReadMemoryByAddress, 16 bytes at 0x1234"),
    ("27 01", "SecurityAccess, request seed, level 1"),
    ("67 01 11 22 33 44", "SecurityAccess, request seed, level 1, seed 11 22 33 44"),
    ("67 01 00 00", "SecurityAccess, request seed, level 1, already unlocked"),
    ("27 02 AA BB", "SecurityAccess, send key, level 1, key AA BB"),
    ("28 03 01", "CommunicationControl, disable reception and transmission, normal messages"),
    ("2A 03 01 02", "ReadDataByPeriodicIdentifier, fast, 0xF201, 0xF202"),
    ("2C 01 F2 01 01 00 01 01", "DynamicallyDefineDataIdentifier, define by identifier, 0xF201, "
     "1 bytes from byte 1 of 0x0100 mode"),
    ("2E 01 00 05", "WriteDataByIdentifier, 0x0100 mode = mode 5"),
    ("2F 01 00 03 01", "InputOutputControlByIdentifier, 0x0100 mode, short-term adjustment, mode 1"),
    ("31 01 02 03 FF", "RoutineControl, start, 0x0203 self_test, FF"),
    ("71 03 02 03 00", "RoutineControl, result, 0x0203 self_test = 00"),
    ("34 00 22 10 00 00 20", "RequestDownload, format 0x00, 32 bytes at 0x1000"),
    ("74 20 04 00", "RequestDownload, blocks of at most 1024 bytes"),
    ("36 01 AA BB", "TransferData, block 1, 2 bytes"),
    ("3E 80", "TesterPresent, no answer wanted"),
    ("85 02", "ControlDTCSetting, off"),
    ("7F 22 31", "ReadDataByIdentifier: request out of range (0x31)"),
    ("7F BA 11", "service 0xBA: service not supported (0x11)"),
    ("01 0C", "OBD current data, PID 0x0C"),
    ("43 01 01 33", "OBD stored codes, 1 code, P0133"),
    ("50", "DiagnosticSessionControl, cut short at 1 bytes"),
    ("59 04 10 01", "ReadDTCInformation, snapshot by code, cut short at 4 bytes"),
    ("BA 01", "no service of ISO 14229: BA 01"),
]  # fmt: skip


@pytest.mark.parametrize(("message", "words"), SAID, ids=[message for message, _ in SAID])
def test_a_message_is_said_in_words(message, words):
    assert describe(bytes.fromhex(message), OWN).text == words


def test_kinds_and_services():
    kinds = {"22 F1 90": Kind.REQUEST, "62 F1 90": Kind.ANSWER, "7F 22 31": Kind.REFUSAL, "7F 22 78": Kind.PENDING}
    for message, kind in kinds.items():
        said = describe(bytes.fromhex(message))
        assert (said.kind, said.service) == (kind, 0x22)
    assert describe(b"").kind is Kind.OTHER
    assert describe(b"\x7f\x22").kind is Kind.OTHER


def test_services_and_negative_codes_are_those_of_udsoncan():
    theirs = {s.request_id() for s in vars(services).values() if hasattr(s, "request_id") and hasattr(s, "_sid")}
    assert theirs <= set(names.SERVICES)
    codes = {
        code
        for name, code in vars(udsoncan.ResponseCode.ResponseCode).items()
        if isinstance(code, int) and name[0] != "_"
    }
    # from 0x3C on ISO 15764's, which udsoncan puts upon ISO 14229's
    assert {code for code in codes if code and not 0x3B <= code <= 0x40} <= set(names.NEGATIVE_CODES)
    for service in (s for s in vars(services).values() if hasattr(s, "_sid")):
        # udsoncan 1.26.1 gives a sub-function to every service that it does not know more of
        if service.request_id() not in (0x24, 0x2A, 0x84):
            assert service.use_subfunction() == (service.request_id() in names.WITH_SUBFUNCTION), service
        assert names.SERVICES[service.request_id()] == service.get_name()


@given(st.binary(max_size=60))
def test_any_bytes_are_said_without_an_error(message):
    for known in (Names(), OWN, OUR_ECU):
        assert describe(message, known).text


_TEST = "0x0201 self test"


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ("71 01 02 02 02", "start, 0x0202 bleed the brake = done"),
        ("71 01 02 01 10", "start, 0x0201 self test = 0x10"),
        ("71 03 02 01 02 03 FF 00 01", f"result, {_TEST} = done, sources supplied 0x3FF, active codes 0, mode NORMAL"),
        ("71 03 02 01 05 03 FF 00 7B", f"result, {_TEST} = 0x05, sources supplied 0x3FF, active codes 0, mode 0x7B"),
    ],
)
def test_states_and_modes_of_our_ecu_are_named_where_they_have_a_name(message, words):
    assert describe(bytes.fromhex(message), OUR_ECU).text == f"RoutineControl, {words}"


@given(st.sampled_from(sorted(OUR_ECU.routines)), st.binary(max_size=20))
def test_any_answer_of_a_routine_of_our_ecu_is_said(routine, data):
    assert describe(b"\x71\x03" + routine.to_bytes(2, "big") + data, OUR_ECU).text


@given(st.integers(0, 0xFFFFFF))
def test_a_code_is_written_as_udsoncan_writes_it_and_read_back(number):
    assert dtc_number(dtc_text(number)) == number
    assert dtc_text(number) == udsoncan.Dtc(number).id_iso()


def test_codes_are_read_in_words_and_numbers():
    assert dtc_number("u0100") == 0xC10000
    assert dtc_number("0x100100") == 0x100100
    for wrong in ("X1000", "C10", "0x1000000", "-1"):
        with pytest.raises(BrakebenchError, match="no trouble code"):
            dtc_number(wrong)
    assert status_text(0) == "none"
    assert status_text(0x81) == "failed now, warning lamp"
