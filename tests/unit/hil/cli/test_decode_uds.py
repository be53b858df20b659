"""`decode --uds` as it is typed: every format, told and found identifiers, what is missing, JSON."""

import argparse
import json

import pytest
from uds_logs import MS, candump_of, exchange

from dbc.contract import spec_of
from dbc.isotp import segment
from dbc.messages import BrakeStatus
from hil.cli import decode
from hil.errors import BrakebenchError
from hil.log.convert import convert

VIN_REQUEST, VIN = b"\x22\xf1\x90", b"\x62\xf1\x90WAUZZZ4M1HA000001"
SESSION = sorted(
    exchange(0x7E0, 0x7E8, b"\x10\x03", b"\x50\x03\x00\x32\x01\xf4", 0, padding=0xAA)
    + exchange(0x7E0, 0x7E8, VIN_REQUEST, VIN, 100 * MS)
    + exchange(0x714, 0x77E, b"\x19\x02\x0d", b"\x59\x02\xff\x10\x01\x00\x09", 105 * MS)
    + [(k * 10 * MS, 0x0A0, bytes((k, k + 1, 3, 4, 5, 6, 7, 8))) for k in range(20)]
)
FD = sorted(
    exchange(0x18DA10F1, 0x18DAF110, VIN_REQUEST, VIN, 0, 64)
    + exchange(0x18DA10F1, 0x18DAF110, b"\x22\x01\x00", b"\x62\x01\x00" + bytes(4200), 20 * MS, 64)
)


def run(*words):
    parser = argparse.ArgumentParser()
    decode.add_parser(parser.add_subparsers())
    args = parser.parse_args(["decode", *map(str, words)])
    return args.run(args)


@pytest.fixture
def session(tmp_path):
    path = tmp_path / "session.log"
    path.write_text(candump_of(SESSION))
    return path


def test_a_session_in_words(session, capsys):
    assert run(session, "--uds") == 0
    lines = capsys.readouterr().out.splitlines()
    words = [line.split(maxsplit=3) for line in lines[1:7]]
    assert [one[:3] for one in words] == [
        ["0.000000", "can0", "7E0"],
        ["0.010000", "can0", "7E8"],
        ["0.100000", "can0", "7E0"],
        ["0.105000", "can0", "714"],
        ["0.110000", "can0", "7E8"],
        ["0.115000", "can0", "77E"],
    ]
    assert words[1][3] == (
        "answer        10.0  DiagnosticSessionControl, extended, P2 50 ms, P2* 5000 ms  [50 03 00 32 01 F4]"
    )
    assert 'VIN = "WAUZZZ4M1HA000001"  [62 F1 90 57' in words[4][3]
    assert "20 bytes]" in words[4][3]
    assert lines[8] == "3 requests, 3 answers"
    assert "can0 77E (with 714): 1 messages" in lines


@pytest.mark.parametrize("suffix", ["asc", "blf", "trc", "mf4", "csv", "pcapng", "parquet"])
def test_every_format_says_the_same(session, suffix, tmp_path, capsys):
    other = tmp_path / f"other.{suffix}"
    convert(session, other)
    said = []
    for path in (session, other):
        assert run(path, "--uds") == 0
        said.append(capsys.readouterr().out.splitlines())
    assert said[0] == said[1]


@pytest.mark.parametrize("suffix", ["log", "asc", "blf", "mf4"])
def test_single_frames_of_can_fd_and_first_frames_of_32_bits(suffix, tmp_path, capsys):
    path = tmp_path / "fd.log"
    path.write_text(candump_of(FD))
    if suffix != "log":
        convert(path, tmp_path / f"fd.{suffix}")
    assert run(tmp_path / f"fd.{suffix}", "--uds", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert [one["length"] for one in facts["uds"]] == [3, 20, 3, 4203]
    assert bytes.fromhex(facts["uds"][1]["data"]) == VIN
    assert facts["uds"][3]["data"] == "620100" + 4200 * "00"
    assert facts["messages"] == {"request": 2, "answer": 2, "refusal": 0, "pending": 0, "other": 0}


def test_identifiers_that_are_told(session, tmp_path, capsys):
    assert run(session, "--uds", "--uds-ids", "714:77E", "--json") == 0
    assert [one["id"] for one in json.loads(capsys.readouterr().out)["uds"]] == [0x714, 0x77E]
    lone = tmp_path / "lone.log"
    lone.write_text(candump_of([(0, 0x714, b"\x02\x10\x03")]))
    assert run(lone, "--uds") == 0
    assert "no message of diagnostics; name their identifiers with --uds-ids" in capsys.readouterr().out
    assert run(lone, "--uds", "--uds-ids", "714:77E") == 0
    assert "1 requests without an answer" in capsys.readouterr().out


def test_what_is_missing_is_said_and_is_the_exit_code(tmp_path, capsys):
    first, second, third = segment(VIN)
    frames = [
        (0, 0x7E8, first),
        (MS, 0x7E8, third),
        (2 * MS, 0x7E8, second),
        (3 * MS, 0x7E8, b"\x99"),
        (4 * MS, 0x7E8, first),
    ]
    path = tmp_path / "broken.log"
    path.write_text(candump_of(frames))
    assert run(path, "--uds") == 1
    out = capsys.readouterr().out
    assert (
        "broken              6 of 20 bytes of ReadDataByIdentifier: consecutive frame with a wrong sequence number"
        in out
    )
    assert "1 consecutive frames without a first frame" in out
    assert "1 frames that are not ISO-TP" in out
    assert out.count("6 of 20 bytes") == 2  # also the one that is open at the end
    path.write_text(candump_of(SESSION) + "(17")
    assert run(path, "--uds") == 1
    assert "pieces are no frames" in capsys.readouterr().err
    assert run(path, "--uds", "--json") == 1
    assert json.loads(capsys.readouterr().out)["truncated_at"] is not None


def test_a_part_of_a_log(session, capsys):
    assert run(session, "--uds", "--from", "0.1", "--to", "0.102", "--json") == 0
    assert [one["id"] for one in json.loads(capsys.readouterr().out)["uds"]] == [0x7E0]
    with pytest.raises(BrakebenchError, match="no channel can7"):
        run(session, "--uds", "--channel", "can7")


def test_wrong_use(session, tmp_path):
    with pytest.raises(BrakebenchError, match="give --uds as well"):
        run(session, "--uds-ids", "7E0:7E8")
    for words in (("--out", "a.csv"), ("--signals", "*"), ("--dbc", "a.dbc")):
        with pytest.raises(BrakebenchError, match=f"leave {words[0]} out"):
            run(session, "--uds", *words)
    (tmp_path / "none.log").write_text("(1.0) can0 7E0#R\n")
    assert run(tmp_path / "none.log", "--uds") == 0


def test_our_names_are_for_our_ecu(tmp_path, capsys):
    """The same identifiers on a bus of another car mean something else."""
    said = exchange(0x7A0, 0x7A8, b"\x22\xf2\x06", b"\x62\xf2\x06\x07\x41\x20\x00\x00", 0)
    periodic = [(50 * MS, 0x7A9, b"\x06\x08\x41\x20\x00\x00\xcc\xcc")]
    ours = [(60 * MS, spec_of(BrakeStatus).can_id, bytes(8))]
    others = [(70 * MS, 0x316, b"\x05\x20\xea\x0a\x20\x1a\x00\x7f")]
    path = tmp_path / "a.log"
    for frames, mine in ((said + periodic, True), (said + ours + others, True), (said + others, False)):
        path.write_text(candump_of(frames))
        assert run(path, "--uds") == 0
        out = capsys.readouterr().out
        assert ("0xF206 speed = 10 m/s" in out) is mine
        assert ("0xF206 = 07 41 20 00 00" in out) is not mine
        assert ("periodic data, 0xF206 speed" in out) is (periodic[0] in frames)
