"""`diag` as it is typed, against a foreign ECU on a loopback: every action, refusals, silence, what it will not do."""

import argparse
import json
import sys
import uuid

import pytest
from uds_ecu import ForeignEcu

from hil.cli import diag
from hil.errors import BrakebenchError

IDS = ("--request-id", "714", "--response-id", "77E")


def typed(*words):
    parser = argparse.ArgumentParser()
    diag.add_parser(parser.add_subparsers())
    args = parser.parse_args(["diag", *words])
    return args.run(args)


@pytest.fixture
def channel():
    return f"loopback:u{uuid.uuid4().hex[:10]}"


@pytest.fixture
def ecu(channel):
    with ForeignEcu(channel, 0x714, 0x77E, 0x700) as one:
        yield one


@pytest.fixture
def ask(ecu, channel, capsys):
    """Standard output of an action against the foreign ECU."""

    def run(*words, code=0):
        assert typed(*words, "--bus", channel, *IDS) == code
        return capsys.readouterr().out

    return run


def test_trouble_codes(ask):
    listed = ask("read-dtc").splitlines()
    assert listed[0] == "2 trouble codes"
    assert listed[1].split(maxsplit=1) == [
        "C1123-1F", "failed now, failed this cycle, pending, confirmed, failed since clear",
    ]  # fmt: skip
    assert listed[2].split(maxsplit=1) == ["U0100-00", "confirmed"]
    assert ask("read-dtc", "--supported").startswith("1 trouble code\n")
    one = ask("read-dtc", "c1123-1f").splitlines()
    assert one[1:] == [
        '  snapshot 1  0xF190 VIN = "ABC"',
        "  no extended data: ReadDTCInformation refused: request out of range (0x31)",
    ]
    assert ask("clear") == "cleared: all codes\n"


def test_data_routines_and_the_rest(ask, ecu):
    assert ask("read", "vin", "0x0123").splitlines()[0] == '0xF190 VIN = "WAUZZZ4M1HA000001"'
    assert "(600 bytes)" in ask("read", "0x0123")
    assert ask("read", "0x0200") == "0x0200 = 01\n"  # after two "response pending"
    assert ask("write", "0x0100", "0a0b") == "written: 0x0100 = 0A 0B\n"
    assert "written" in ask("write", "0x0100", 40 * "55")  # a request of several frames
    assert ask("routine", "0x0203", "start") == "start: 0x0203 = 00\n"
    assert "short-term adjustment, 7F" in ask("io", "0x0100", "adjust", "7f")
    assert "return control to the ECU" in ask("io", "0x0100", "adjust", "7f", "--hold", "0.01")
    assert ecu.asked[-3:] == [b"\x2f\x01\x00\x03\x7f", b"\x3e\x80", b"\x2f\x01\x00\x00"]
    assert ask("reset") == "ECUReset, hard reset\n"
    assert ask("session", "extended", "--hold", "0.01") == "DiagnosticSessionControl, extended, P2 50 ms, P2* 5000 ms\n"
    assert ecu.asked[-1] == b"\x3e\x80"
    assert ask("request", "3E", "80") == "no answer was wanted\n"
    assert ask("request", "2A0101") == "ReadDataByPeriodicIdentifier\n6A\n"
    assert ask("request", "24F190").endswith("64 F1 90 01\n")


@pytest.mark.parametrize("action", [("io", "0x0100", "adjust", "7f"), ("session", "extended")])
def test_a_time_that_cannot_be_held_is_refused_before_anything_moves(ecu, channel, capsys, action):
    for text in ("nan", "-1", "inf", "86400", "soon"):
        with pytest.raises(SystemExit):
            typed(*action, f"--hold={text}", "--bus", channel, *IDS)
        assert f"argument --hold: expected seconds, 0 to 86399, got {text!r}" in capsys.readouterr().err
    assert ecu.asked == []


def test_a_session_first_and_everything_as_json(ask, ecu):
    facts = json.loads(ask("--session", "extended", "read", "0xF190", "--json"))
    assert ecu.asked == [b"\x10\x03", b"\x22\xf1\x90"]
    assert (facts["verdict"], facts["action"], facts["request_id"]) == ("passed", "read", 0x714)
    assert facts["result"] == [
        {"did": 0xF190, "name": "VIN", "data": b"WAUZZZ4M1HA000001".hex(), "text": '"WAUZZZ4M1HA000001"'}
    ]
    assert [one["request"] for one in facts["exchanges"]] == ["1003", "22f190"]
    codes = json.loads(ask("read-dtc", "--json"))["result"]
    assert [(one["code"], one["status"]) for one in codes] == [("C1123-1F", 0x2F), ("U0100-00", 0x08)]


def test_a_refusal_has_its_exit_code_and_its_advice(ask, ecu, channel, capsys):
    with pytest.raises(BrakebenchError, match=r"refused: service not supported \(0x11\)") as refused:
        typed("routine", "0x0999", "stop", "--bus", channel, *IDS)
    assert refused.value.exit_code == 1
    assert typed("routine", "0x0999", "stop", "--bus", channel, *IDS, "--json") == 1
    facts = json.loads(capsys.readouterr().out)
    assert (facts["verdict"], facts["result"]) == ("failed", None)
    assert facts["exchanges"][-1]["answer"] == "7f3111"


def test_silence_and_answers_to_something_else(channel, capsys):
    with ForeignEcu(channel, 0x714, 0x77E, silent=True), pytest.raises(BrakebenchError, match="no answer") as error:
        typed("read", "0xF190", "--bus", channel, *IDS, "--timeout", "0.1")
    assert error.value.exit_code == 3
    with (
        ForeignEcu(channel, 0x714, 0x77E),
        pytest.raises(BrakebenchError, match="something else was answered: 62 F1 90"),
    ):
        typed("read", "0x0300", "--bus", channel, *IDS)
    with pytest.raises(BrakebenchError, match="Flow") as error:  # nobody takes a request of several frames
        typed("write", "0x0100", 40 * "55", "--bus", channel, *IDS)
    assert error.value.exit_code == 3


def test_identifiers_of_29_bits_and_to_all(channel, capsys):
    with ForeignEcu(channel, 0x18DA10F1, 0x18DAF110, 0x18DB33F1) as ecu:
        typed("read", "0xF190", "--bus", channel, "--request-id", "18DA10F1")  # its answer follows from it
        ids = ("--request-id", "18DA10F1", "--functional", "18DB33F1")
        typed("read", "0xF190", "--bus", channel, *ids)
        assert capsys.readouterr().out.count("WAUZZZ4M1HA000001") == 2
        with pytest.raises(BrakebenchError, match="to all ECUs; at most 7 fit"):
            typed("write", "0x0100", 40 * "55", "--bus", channel, *ids)
    with ForeignEcu(channel, 0x6F1, 0x6F9) as ecu:
        short = ("--request-id", "6F1", "--response-id", "6F9", "--extended")
        with pytest.raises(BrakebenchError, match="no answer"):  # of 29 bits nobody has them
            typed("read", "0xF190", "--bus", channel, *short, "--timeout", "0.1")
        assert ecu.asked in ([], [b"\x22\xf1\x90"])


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("read", "ecu_serial"), r"expected a name \(ecu_serial_number, "),
        (("read", "0x10000"), "a number up to 0xFFFF"),
        (("write", "0x0100", "xyz"), "expected bytes in hexadecimal"),
        (("read-dtc", "X1"), "no trouble code"),
        (("session", "sport"), "default, programming, extended"),
        (("io", "0x0100", "adjust"), "expected a value"),
        (("io", "0x0100", "return", "01"), "expected no value"),
        (("request", "10"), "no whole request"),
        (("request", "BA01"), "no whole request"),
        (("read", "0xF190", "--timeout", "0"), "expected seconds above 0"),
        (("read", "0xF190", "--functional", "18DB33F1"), "expected an identifier of 11 bits"),
    ],
)
def test_wrong_use_is_told(channel, words, problem):
    with pytest.raises(BrakebenchError, match=problem) as error:
        typed(*words, "--bus", channel, *IDS)
    assert error.value.exit_code == 2


def test_identifiers_that_cannot_be(channel):
    for words in (("--request-id", "714"), ("--request-id", "714", "--response-id", "714")):
        with pytest.raises(BrakebenchError, match="714"):
            typed("read", "0xF190", "--bus", channel, *words)


def test_names_of_our_ecu_are_known(channel):
    with pytest.raises(BrakebenchError, match=r"a name \(pressure_demand_fl, .*\) or 0xF190"):
        typed("io", "presure_demand_fl", "return", "--bus", channel)
    with pytest.raises(BrakebenchError, match=r"a name \(self_test, .*\) or 0x0203"):
        typed("routine", "selftest", "start", "--bus", channel)
    with pytest.raises(BrakebenchError, match="no answer"):
        typed("read", "vehicle_identification_number", "--bus", channel, "--timeout", "0.05")


def test_a_bus_with_hardware_needs_transmit(channel):
    for bus in ("socketcan:can0", "kvaser:0", "slcan:/dev/ttyACM0"):
        with pytest.raises(BrakebenchError, match="add --transmit"):
            typed("read-dtc", "--bus", bus)


def test_missing_libraries_are_named(channel, monkeypatch):
    monkeypatch.setitem(sys.modules, "isotp", None)
    monkeypatch.delitem(sys.modules, "hil.uds.transport", raising=False)
    monkeypatch.delitem(sys.modules, "hil.uds.tester", raising=False)
    with pytest.raises(BrakebenchError, match=r"-m pip install .*(udsoncan|\[diag\])"):
        typed("read-dtc", "--bus", channel)
