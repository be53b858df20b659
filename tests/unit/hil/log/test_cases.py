"""Logs and databases that readers have stumbled over: what each holds, by the command line and by the library."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet
import pytest
from frame_lines import lines_of
from log_cases import CASES, CROSSED, JANUARY, LOGS, ZONE

from hil.cli.main import main
from hil.log.convert import convert
from hil.log.foreign.database_files import read_database
from hil.log.frames import LogError
from hil.log.read import open_log
from hil.log.source import ReadOptions

ALL = CASES | CROSSED
HOUR_NS = 3600 * 10**9


@pytest.fixture
def said(capsys):
    """Exit code of a command, and what it prints on both streams together."""

    def said(*words):
        code = main([str(word) for word in words])
        captured = capsys.readouterr()
        return code, captured.out + captured.err

    return said


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("name", ALL)
def test_the_library_reads_every_frame(name, fast):
    case = ALL[name]
    with open_log(LOGS / name, options=ReadOptions(fast=fast)) as log:
        read = log.recording()
        assert lines_of(read.frames) == case.frames
        assert (read.format, read.start_ns, read.truncated_at) == (case.format, case.start_ns, case.cut)
        assert read.rejected == len(case.rejected)
        assert tuple((one.offset, one.text) for one in read.first_rejected) == case.rejected
        assert dict(log.account.passed_over) == case.passed
        assert read.notes == case.notes


@pytest.mark.parametrize("name", ALL)
def test_decode_accounts_for_every_frame(name, capsys):
    case = ALL[name]
    assert main(["decode", str(LOGS / name), "--json"]) == case.code
    found = json.loads(capsys.readouterr().out)
    assert found["frames"] == len(case.frames) + len(case.rejected)
    assert found["decoded"] + found["unknown"] + found["rejected"] == found["frames"]
    assert (found["format"], found["truncated_at"]) == (case.format, case.cut)
    assert [(one["offset"], one["text"]) for one in found["first_rejected"]] == list(case.rejected)
    (part,) = found["logs"]
    assert (part["start_ns"], part["passed_over"], part["notes"]) == (case.start_ns, case.passed, list(case.notes))
    for kind, word in (("errors", " error "), ("remote", "#R"), ("fd", " FD"), ("sent", " sent")):
        assert sum(one[kind] for one in found["channels"].values()) == sum(word in line for line in case.frames), kind


@pytest.mark.parametrize("name", ALL)
def test_decode_says_what_is_odd(name, said):
    """In words, too: nothing that is left out or taken for granted is silent."""
    case = ALL[name]
    code, text = said("decode", LOGS / name)
    words = " ".join(text.split())
    assert code == case.code
    assert all(note in words for note in case.notes)
    assert all(f"{count:,} {kind} passed over" in words for kind, count in case.passed.items())
    assert all(f"at byte {offset}: {' '.join(piece.split())}" in words for offset, piece in case.rejected)
    assert (f"is cut off at byte {case.cut}" in words) == (case.cut is not None)
    assert text.replace("\n", "").isprintable()


UNUSABLE = ["rubbish.log", "empty.log", "empty.asc"]


@pytest.mark.parametrize("name", UNUSABLE)
def test_what_is_no_log_is_refused(tmp_path, said, name):
    for command in (["decode"], ["convert"], ["decode", "--out"]):
        words = [command[0], LOGS / name, *command[1:]]
        words += [tmp_path / "out.csv"] if command != ["decode"] else []
        code, text = said(*words)
        assert code == 2
        assert f"brakebench: {LOGS / name}: " in text
        assert "no log" in text
    assert not list(tmp_path.iterdir())
    with pytest.raises(LogError):
        open_log(LOGS / name)


def ethernet():
    """A capture of another bus."""
    content = bytearray((LOGS / "can.pcap").read_bytes())
    content[20:24] = (1).to_bytes(4, "little")
    return bytes(content)


FRAMELESS = {
    "ethernet.pcap": (ethernet, "300 of link type 1"),
    "head.asc": (lambda: b"date Fri May 02 06:24:08.927 2025\nbase hex  timestamps absolute\n", ""),
    "head.blf": (lambda: (LOGS / "e.blf").read_bytes()[:144], ""),
    "damaged.log": (lambda: b"(1.0) can0 12#\n(1.0) can0 123#1\n", "2 pieces that are none"),
}


@pytest.mark.parametrize("name", FRAMELESS)
def test_a_log_without_a_frame_is_unusable(tmp_path, said, name):
    make, holds = FRAMELESS[name]
    path = tmp_path / name
    path.write_bytes(make())
    code, text = said("decode", path, "--out", tmp_path / "out.csv")
    assert code == 2
    assert "no frame could be read" in text or "no CAN frame in it" in text
    code, text = said("convert", path, tmp_path / "out.log")
    assert code == 2
    assert "no frame could be read" in text or "no CAN frame in it" in text
    assert holds in text
    assert [one.name for one in tmp_path.iterdir()] == [name]


DATABASES = {  # log, databases, table of signals, units, what is said of the databases
    "unit in Chinese letters": (
        "dbc-gbk-letters/a.log", ["dbc-gbk-letters/gbk.dbc"],
        'time,M1.a,M1.b,M1.b (name)\n1,7,1,"打开"\n', {"M1.a": "℃", "M1.b": ""},
        ["line 6: text is not Windows-1252; read as Chinese (GB 18030)"],
    ),
    "no receiver": (
        "dbc-no-receiver-silent/a.log", ["dbc-no-receiver-silent/one.dbc"],
        "time,M1.a\n1,35\n", {"M1.a": "-"}, [],
    ),
    "no receiver, more signals": (
        "dbc-no-receiver-silent/a.log", ["dbc-no-receiver-silent/two.dbc"],
        "time,M1.a,M1.b,M1.c\n1,35,15,1160\n", dict.fromkeys(("M1.a", "M1.b", "M1.c"), "-"), [],
    ),
    "factor that begins with a point": (
        "dbc-one-signal-loses-message/a.log", ["dbc-one-signal-loses-message/dot.dbc"],
        "time,M1.a,M1.b\n1,-498.25,3\n", {"M1.a": "NM", "M1.b": ""}, [],
    ),
    "name that begins with a digit": (
        "dbc-one-signal-loses-message/a.log", ["dbc-one-signal-loses-message/digit.dbc"],
        "time,M1.5_SEC,M1.b\n1,7,3\n", {"M1.5_SEC": "", "M1.b": ""}, [],
    ),
    "parameter group of any source": (
        "j1939.log", ["j1939.dbc"],
        "time,EEC1.EngineSpeed,EEC1@17.EngineSpeed,EEC1@FE.EngineSpeed\n1,499.375,,\n1.1,,1000,\n1.2,,,499.375\n",
        dict.fromkeys(("EEC1.EngineSpeed", "EEC1@17.EngineSpeed", "EEC1@FE.EngineSpeed"), "rpm"), [],
    ),
    "transported message": (
        "tp.log", ["tp.dbc"],
        "time,DM1.Lamp,DM1.Last\n1,,\n1.05,,\n1.1,,\n1.15,64,19\n", {"DM1.Lamp": "", "DM1.Last": ""}, [],
    ),
    "multiplexed message in short frames": (
        "short.log", ["short.dbc"],
        "time,MUXED.Sel,MUXED.Long,MUXED.Short\n1,0,67305985,\n1.1,1,,66\n1.2,1,,67\n",
        dict.fromkeys(("MUXED.Sel", "MUXED.Long", "MUXED.Short"), ""), [],
    ),
    "two databases": (
        "two.log", ["one.dbc", "two.dbc"], "time,M1.a\n1,7\n", {"M1.a": ""}, [],
    ),
    "two databases, the other way round": (
        "two.log", ["two.dbc", "one.dbc"], "time,M1.a\n1,7\n", {"M1.a": ""}, [],
    ),
    "names of values": (
        "e.log", ["e.dbc"],
        "time,T.Temp,T.Temp (name),T.Gear,T.Gear (name),T.Neg,T.Neg (name)\n"
        '1.1,87,"error",1,"D",0,"five"\n', {"T.Temp": "degC", "T.Gear": "", "T.Neg": ""}, [],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DATABASES)
def test_signals_of_a_database(tmp_path, capsys, name):
    log, databases, table, units, warnings = DATABASES[name]
    words = [str(LOGS / log), *(word for one in databases for word in ("--dbc", str(LOGS / one)))]
    assert main(["decode", *words, "--json", "--names", "--out", str(tmp_path / "a.csv")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (tmp_path / "a.csv").read_text("utf-8") == table
    assert found["dbc_warnings"] == warnings
    assert (found["unknown"], found["rejected"]) == (0, 0)
    assert {signal: one["unit"] for signal, one in found["signals"].items()} == units
    assert main(["decode", *words, "--out", str(tmp_path / "a.parquet")]) == 0
    schema = pyarrow.parquet.read_schema(tmp_path / "a.parquet")
    assert {field.name: field.metadata[b"unit"].decode() for field in schema} == {"time": "s"} | units


@pytest.mark.parametrize("name", [name for name, case in DATABASES.items() if len(case[1]) == 1])
def test_the_library_decodes_the_same(name):
    log, (database,), table, units, _ = DATABASES[name]
    with open_log(LOGS / log) as opened:
        signals = opened.signals(read_database(LOGS / database))
    head, *rows = [line.split(",") for line in table.splitlines()]
    assert {one: column.signal.unit for one, column in signals.columns.items()} == units
    for signal in units:
        at, named = head.index(signal), head.index(f"{signal} (name)") if f"{signal} (name)" in head else None
        times, values = signals.series(signal)
        expected = [(float(row[0]), float(row[at])) for row in rows if row[at]]
        assert list(zip(times.tolist(), values.tolist(), strict=True)) == expected
        if named is not None:
            assert signals.columns[signal].names().tolist() == [row[named].strip('"') for row in rows if row[at]]


def test_a_transfer_of_a_group_that_the_database_lacks_is_said(said):
    """The transfer announces group FECA; this database has FEC9."""
    code, text = said("decode", LOGS / "tp.log", "--dbc", LOGS / "tp_other_group.dbc")
    assert code == 0
    assert "J1939 transport: no message of the database for can0 PGN 0xfeca (1)" in text


def test_each_database_is_used_and_may_be_of_one_channel(tmp_path, capsys):
    log, out = tmp_path / "a.log", tmp_path / "a.csv"
    log.write_text("(1.0) can0 155#0701\n(1.1) can0 156#0901\n(1.2) can1 156#0B01\n")
    one, two = LOGS / "one.dbc", LOGS / "two.dbc"
    assert main(["decode", str(log), "--dbc", str(one), "--dbc", str(two), "--out", str(out)]) == 0
    assert out.read_text() == 'time,channel,M1.a,M2.b\n1,"can0",7,\n1.1,"can0",,9\n1.2,"can1",,11\n'
    words = ["--dbc", f"can0={one}", "--dbc", f"can1={two}", "--out", str(out), "--force"]
    assert main(["decode", str(log), *words]) == 0
    assert out.read_text() == "time,M1.a,M2.b\n1,7,\n1.1,,\n1.2,,11\n"
    assert "1 unknown" in capsys.readouterr().out


def test_two_messages_of_one_identifier_are_said(said):
    code, text = said("decode", LOGS / "self.csv", "--dbc", LOGS / "self.dbc.csv")
    assert code == 0
    assert "database: line 7: identifier 0x155: M1 and M2 share it; the last one is used" in text


@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize("command", ["decode", "convert"])
@pytest.mark.parametrize("target", ["self.csv", "link.csv", "hard.csv", "self.dbc.csv"])
def test_what_is_read_is_never_replaced(tmp_path, said, monkeypatch, command, target, force):
    monkeypatch.chdir(tmp_path)
    for name in ("self.csv", "self.dbc.csv"):
        shutil.copy(LOGS / name, name)
    Path("link.csv").symlink_to("self.csv")
    Path("hard.csv").hardlink_to("self.csv")
    before = {path: path.read_bytes() for path in Path().iterdir()}
    if command == "decode":
        code, text = said("decode", "self.csv", "--dbc", "self.dbc.csv", "--out", target, *force)
    elif target == "self.dbc.csv":  # no database is read: an existing file, which --force may replace
        code, text = said("convert", "self.csv", target)
    else:
        code, text = said("convert", "self.csv", target, *force)
    assert code == 2
    assert "exists already" in text or "is read by this command too" in text
    assert {path: path.read_bytes() for path in Path().iterdir()} == before


ESCAPES = "\x1b[2J\x1b[31mX\x07\x9b"


def test_control_characters_reach_no_terminal(tmp_path, said, monkeypatch):
    """Whatever they stand in: a channel, a line that is no frame, a database, the name of a file."""
    monkeypatch.chdir(tmp_path)
    Path("good.log").write_text("(1.0) can0 123#11\n(2.0) can0 123#FF\n")
    shutil.copy("good.log", f"{ESCAPES}.log")
    Path(f"{ESCAPES}.txt").write_text("no log")
    Path("odd.dbc").write_text(
        f'VERSION ""\nBU_: A\nBO_ 291 M: 1 A\n SG_ s : 0|8@1+ (1,0) [0|5] "{ESCAPES}" A\n SG_ {ESCAPES} : 0\n'
        f'VAL_ 291 s 17 "{ESCAPES}";\nBO_ {ESCAPES} N: 8 A\n'
    )
    odd = f"{ESCAPES}.log"
    for code, *words in (
        (1, "decode", LOGS / "esc.log"),
        (1, "convert", LOGS / "esc.log", "a.asc"),
        (0, "decode", LOGS / "chan.log"),
        (0, "convert", LOGS / "chan.log", "b.asc"),
        (0, "convert", LOGS / "chan.log", "b.log"),
        (0, "decode", "good.log", "--dbc", "odd.dbc"),
        (0, "decode", "good.log", "--dbc", "odd.dbc", "--json"),
        (0, "decode", odd, "--out", f"{ESCAPES}.csv"),
        (0, "diff", odd, odd, "--dbc", "odd.dbc"),
        (2, "diff", odd, odd),  # no frame of our own messages
        (2, "decode", f"{ESCAPES}.txt"),
        (2, "decode", f"{ESCAPES} none.log"),
        (2, "decode", "good.log", "--dbc", odd),
        (2, "decode", "good.log", "--channel", ESCAPES),
        (2, "convert", odd, f"{ESCAPES}.txt"),
        (2, "convert", odd, odd),
    ):
        got, text = said(*words)
        assert got == code, (words, text)
        assert text.replace("\n", "").isprintable(), words


WALL_CLOCKS = ("tz.asc", "tz.blf", "tz.trc", "wall-clock.asc", "wall-clock.blf")
STAMPS = ["1736942401.000000"] * 3 + ["1727172930.600000"] * 2


@pytest.mark.parametrize("zone", ["Europe/Berlin", "Asia/Tokyo", "America/St_Johns"])
def test_one_wall_clock_is_one_instant_whoever_reads(tmp_path, zone):
    script = (
        "import sys\n"
        "from hil.cli.main import main\n"
        "for path in sys.argv[2:]:\n"
        "    assert main(['convert', '--force', path, sys.argv[1]]) == 0\n"
        "    print(open(sys.argv[1]).read())\n"
    )
    words = [sys.executable, "-c", script, str(tmp_path / "o.log"), *(str(LOGS / name) for name in WALL_CLOCKS)]
    done = subprocess.run(words, env=os.environ | {"TZ": zone}, capture_output=True, text=True, check=True)
    assert [line[1:18] for line in done.stdout.splitlines() if line.startswith("(")] == STAMPS
    assert done.stdout.count(ZONE) == len(WALL_CLOCKS)


@pytest.mark.parametrize(("zone", "hours"), [("Europe/Berlin", 1), ("Asia/Tokyo", 9), ("America/New_York", -5)])
@pytest.mark.parametrize("name", WALL_CLOCKS[:3])
def test_the_zone_of_a_wall_clock_can_be_chosen(tmp_path, said, name, zone, hours):
    code, text = said("convert", LOGS / name, tmp_path / "o.log", "--timezone", zone)
    assert code == 0
    assert f"start time taken as {zone} (the log names no zone)" in text
    with open_log(tmp_path / "o.log") as log:
        assert log.frames().time_ns.tolist() == [JANUARY + 10**9 - hours * HOUR_NS]


def test_an_extended_error_frame_is_a_line_of_candump(tmp_path):
    done = convert(LOGS / "e.blf", tmp_path / "o.log")
    assert done.path.read_text() == "(1746165600.001000) can0 20000123#\n"


@pytest.mark.parametrize("target", ["o.asc", "o.blf", "o.parquet"])
def test_converting_a_log_that_is_cut_off(tmp_path, said, target):
    code, text = said("convert", LOGS / "cut.log", tmp_path / target)
    assert code == 1
    assert "is cut off at byte 9154" in text
    with open_log(tmp_path / target) as log:
        assert lines_of(log.frames()) == CASES["cut.log"].frames
