import argparse
import json

import pyarrow.parquet
import pytest

from dbc.contract import encode, spec_of
from dbc.frame import BusName
from dbc.messages import BrakePedal
from hil.cli import decode
from hil.errors import BrakebenchError

DBC = 'VERSION ""\nBU_: A\nBO_ 1 M: 2 A\n SG_ S : 0|8@1+ (0,5) [0|0] "" A\n'
LOG = "(1.0) can0 001#0101\n(1.5) can0 7FF#00\nbad\n(2.0) can0 001#01\n(2.5) can0 001#0300\n(3.0) can0 00"


def run(*words):
    parser = argparse.ArgumentParser()
    decode.add_parser(parser.add_subparsers())
    args = parser.parse_args(["decode", *map(str, words)])
    return args.run(args)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "a.log"
    path.write_text(LOG)
    return path


@pytest.fixture
def dbc(tmp_path):
    path = tmp_path / "a.dbc"
    path.write_text(DBC)
    return path


def test_json_is_one_object_alone_on_stdout(log, dbc, tmp_path, capsys):
    assert run(log, "--dbc", dbc, "--out", tmp_path / "a.parquet", "--json") == 0
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert captured.out.count("\n") == 1
    assert (result["frames"], result["decoded"], result["unknown"], result["rejected"]) == (6, 2, 1, 3)
    assert result["truncated_at"] == LOG.index("(3.0)")
    assert result["messages"] == {"M": {"count": 2, "rate_hz": pytest.approx(1 / 1.5)}}
    assert result["unknown_ids"] == {"can0 0x7ff": 1}
    assert [r["text"] for r in result["first_rejected"]] == ["bad", "(3.0) can0 00"]
    assert "factor 0" in result["dbc_warnings"][0]
    assert "cut off at byte" in captured.err
    assert pyarrow.parquet.read_table(result["out"]).column_names == ["time", "M.S"]


def test_text_accounts_for_every_frame(log, dbc, capsys):
    assert run(log, "--dbc", dbc) == 0
    out = capsys.readouterr().out
    assert "M                2      0.7 Hz" in out
    assert "6 frames in 1.5 s (channels: can0): 2 decoded, 1 unknown, 3 rejected" in out
    assert "rejected: 2 not a frame" in out
    assert "rejected: 1 shorter than the message in the DBC" in out
    assert "unknown: can0 0x7ff (1)" in out


def test_without_a_database_ours_are_used(tmp_path, capsys):
    spec = spec_of(BrakePedal)
    message = BrakePedal(*[0.5 for _ in spec.fields])
    line = f"(1.0) vehicle {spec.can_id:03X}#{encode(message).hex()}\n"
    (tmp_path / "a.log").write_text(line + line.replace("vehicle", "can7"))
    assert run(tmp_path / "a.log", "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert result["messages"]["BRAKE_PEDAL"]["count"] == 2
    assert spec.bus is BusName.VEHICLE


@pytest.mark.parametrize(
    ("content", "message"), [(None, "cannot be opened"), (b"hello", "no message in it"), (b"\0\0", "zero bytes")]
)
def test_a_bad_database_is_refused_with_its_name(log, tmp_path, content, message):
    path = tmp_path / "bad.dbc"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BrakebenchError, match=rf"bad\.dbc: .*{message}"):
        run(log, "--dbc", path)


def test_a_missing_log_is_refused_with_its_name(tmp_path):
    with pytest.raises(BrakebenchError, match=r"none\.log: cannot be opened"):
        run(tmp_path / "none.log")
