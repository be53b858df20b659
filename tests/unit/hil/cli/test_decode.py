import argparse
import io
import json
import sys

import numba
import pyarrow.csv
import pyarrow.parquet
import pytest

from dbc.contract import encode, spec_of
from dbc.frame import BusName
from dbc.messages import BrakePedal
from hil.cli import decode
from hil.cli.columns import columns, wrapped
from hil.cli.progress import Progress, duration_text
from hil.errors import BrakebenchError

DBC = """VERSION ""
BU_: A
BO_ 1 M: 2 A
 SG_ S : 0|8@1+ (0.5,0) [0|100] "km/h" A
 SG_ T : 8|8@1+ (1,0) [0|0] "" A
BO_ 2 N: 1 A
 SG_ U : 0|8@1+ (1,0) [0|0] "" A
VAL_ 1 T 0 "off" 1 "on" 255 "SNA" ;
"""
LOG = "(1.0) can0 001#0101\n(1.5) can0 7FF#00\nbad\n(2.0) can0 001#01\n(2.5) can0 001#0300\n(3.0) can0 00"
WHOLE = "(1.0) can0 001#0101\n(1.5) can0 7FF#00\n(2.0) can0 002#09\n(2.5) can0 001#FFFF\n"


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


def test_a_page_holds_channels_identifiers_and_signals(log, tmp_path, capsys):
    (tmp_path / "a.dbc").write_text(DBC)
    assert run(log, "--dbc", tmp_path / "a.dbc", "--page", tmp_path / "a.html") == 1
    page = (tmp_path / "a.html").read_text()
    for cell in ("incomplete", "can0", "<td class=s>001</td>", "M.S", "km/h", "can0 0x7ff: 1"):
        assert cell in page
    with pytest.raises(BrakebenchError, match="exists already"):
        run(log, "--page", tmp_path / "a.html")


@pytest.fixture
def whole(tmp_path):
    path = tmp_path / "whole.log"
    path.write_text(WHOLE)
    return path


@pytest.fixture
def dbc(tmp_path):
    path = tmp_path / "a.dbc"
    path.write_text(DBC)
    return path


@pytest.fixture
def result(capsys):
    def result(*words, code=0):
        assert run(*words, "--json") == code
        captured = capsys.readouterr()
        assert captured.out.count("\n") == 1
        return json.loads(captured.out)

    return result


def test_json_is_one_object_alone_on_stdout(log, dbc, tmp_path, result):
    found = result(log, "--dbc", dbc, "--out", tmp_path / "a.parquet", code=1)
    assert (found["frames"], found["decoded"], found["unknown"], found["rejected"]) == (6, 3, 1, 2)
    assert found["truncated_at"] == LOG.index("(3.0)")
    assert found["messages"]["M"]["count"] == 3
    assert found["messages"]["M"]["short"] == 1
    assert found["unknown_ids"] == {"can0 0x7ff": 1}
    assert [one["text"] for one in found["first_rejected"]] == ["bad", "(3.0) can0 00"]
    assert found["rejected_reasons"] == {"not a frame": 2}
    assert found["ids"][0]["lengths"] == [1, 2]
    assert found["ids"][0]["length_changes"] == 2
    assert pyarrow.parquet.read_table(found["out"]).column_names == ["time", "M.S", "M.T"]


def test_text_accounts_for_every_frame(log, dbc, capsys):
    assert run(log, "--dbc", dbc) == 1
    out = capsys.readouterr().out
    assert "6 frames in 1.500 s: 3 decoded, 1 unknown, 2 rejected" in out
    assert "2 not a frame" in out
    assert "at byte 38: bad" in out
    assert "M: frames shorter than the database says" in out
    assert "unknown: can0 7FF (1)" in out
    assert "cut off at byte" in out
    assert "length: can0 001 M changes 2 times between 1, 2 bytes" in out


def test_a_whole_log_ends_with_0_and_names_what_is_odd_in_its_values(whole, dbc, capsys):
    assert run(whole, "--dbc", dbc) == 0
    out = capsys.readouterr().out
    assert "out of range: M.S in 1 of 2 frames (0.5 to 127.5 km/h, stated 0 to 100)" in out
    assert "not available: M.T in 1 of 2 frames" in out


@pytest.mark.parametrize("width", ["80", "100"])
def test_lines_fit_the_width(whole, dbc, capsys, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", width)
    monkeypatch.chdir(whole.parent)  # a long path is not broken
    run(whole.name, "--dbc", dbc)
    assert max(map(len, capsys.readouterr().out.splitlines())) <= int(width)


def test_control_characters_do_not_reach_the_terminal(tmp_path, capsys):
    path = tmp_path / "a.log"
    path.write_bytes(b"(1.0) \x1b[31mcan0 001#00\n\x1b]0;title\x07 line\n(2.0) can0 001#00\n")
    assert run(path) == 1
    assert run(path, "--json") == 1
    assert capsys.readouterr().out.replace("\n", "").isprintable()


def test_without_a_database_ours_are_used_and_their_protection_is_checked(tmp_path, result):
    spec = spec_of(BrakePedal)
    message = BrakePedal(*[0.5 for _ in spec.fields])
    payloads = [bytearray(encode(message, counter)) for counter in (0, 1, 3, 4)]
    payloads[3][7] ^= 0xFF
    lines = [f"({1 + k / 100:.2f}) vehicle {spec.can_id:03X}#{one.hex()}\n" for k, one in enumerate(payloads)]
    (tmp_path / "a.log").write_text("".join(lines) + lines[0].replace("vehicle", "can7").replace("1.00", "1.04"))
    found = result(tmp_path / "a.log")
    assert found["messages"]["BRAKE_PEDAL"]["count"] == 5
    assert found["protection"]["BRAKE_PEDAL"] == {
        "received": 5, "corrupt": 1, "repeated": 0, "lost": 1, "legacy": False
    }  # fmt: skip
    assert found["ids"][1]["cycle"]["stated_ms"] == 10
    assert spec.bus is BusName.VEHICLE


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "cannot be opened"),
        (b"hello", "begins with 'hello'; expected"),
        (b"BO_ 1", "no message|can be used"),
    ],
)
def test_a_bad_database_is_refused_with_its_name(log, tmp_path, content, message):
    path = tmp_path / "bad.dbc"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BrakebenchError, match=rf"bad\.dbc: .*{message}"):
        run(log, "--dbc", path)


KCD = """<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Document/><Bus name="B">
<Message id="0x001" length="2" name="M"><Signal name="S" offset="0" length="8"/></Message></Bus></NetworkDefinition>"""


def test_a_database_of_another_format(log, tmp_path, result):
    path = tmp_path / "a.kcd"
    path.write_text(KCD)
    assert result(log, "--dbc", path, code=1)["signals"]["M.S"]["count"] == 3


def test_a_short_frame_without_any_signal_is_rejected(tmp_path, dbc, result):
    path = tmp_path / "short.log"
    path.write_text("(1.0) can0 001#0101\n(2.0) can0 001#\n")
    found = result(path, "--dbc", dbc, code=1)
    assert (found["decoded"], found["rejected"]) == (1, 1)


def test_groups_of_messages_in_one_mf4_file(whole, dbc, tmp_path):
    asammdf = pytest.importorskip("asammdf")
    out = tmp_path / "o.mf4"
    assert run(whole, "--dbc", dbc, "--out", out) == 0
    with asammdf.MDF(out) as file:
        assert file.get("S").samples.tolist() == [0.5, 127.5]
        assert file.get("S").unit == "km/h"
        names = file.get("T", ignore_invalidation_bits=True)
        assert names.samples.tolist()[0] == b"on"


def test_a_missing_log_is_refused_with_its_name(tmp_path):
    with pytest.raises(BrakebenchError, match=r"none\.log: cannot be opened"):
        run(tmp_path / "none.log")


def test_several_databases_and_one_for_a_channel(tmp_path, dbc, result):
    other = tmp_path / "other.dbc"
    other.write_text(DBC.replace("BO_ 1 M", "BO_ 3 M").replace("VAL_ 1", "VAL_ 3").replace("BO_ 2 N", "BO_ 4 P"))
    path = tmp_path / "two.log"
    path.write_text("(1.0) can0 001#0101\n(1.1) can0 003#0101\n(1.2) can1 001#0101\n(1.3) can1 003#0101\n")
    assert result(path, "--dbc", dbc, "--dbc", other)["decoded"] == 4
    found = result(path, "--dbc", dbc, "--dbc", f"can1={other}")
    assert found["decoded"] == 2
    assert found["unknown_ids"] == {"can0 0x003": 1, "can1 0x001": 1}
    assert set(found["messages"]) == {"M", "M@can1"}


def test_a_database_file_with_an_equals_sign_in_its_name(tmp_path, log, dbc, result):
    path = tmp_path / "x=y.dbc"
    path.write_text(DBC)
    assert result(log, "--dbc", path, code=1)["decoded"] == 3


def test_several_logs_and_a_pattern_are_one_log(tmp_path, dbc, result):
    (tmp_path / "late.log").write_text("(1700000005.0) can1 001#0101\n(1700000009.0) can1 001#0101\n")
    (tmp_path / "early.log").write_text("(1700000001.0) can0 001#0201\n(1700000007.0) can0 001#0401\n")
    out = tmp_path / "out.csv"
    found = result(tmp_path / "late.log", tmp_path / "early.log", "--dbc", dbc, "--out", out)
    assert found["stamps_back"] is None
    assert [part["frames"] for part in found["logs"]] == [2, 2]
    assert pyarrow.csv.read_csv(out)["M.S"].to_pylist() == [1.0, 0.5, 2.0, 0.5]
    assert result(str(tmp_path / "*.log"), "--dbc", dbc)["frames"] == 4
    with pytest.raises(BrakebenchError, match="no file matches"):
        run(str(tmp_path / "*.blf"))


def test_standard_input(whole, dbc, result, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(whole.read_bytes())))
    assert result("-", "--dbc", dbc)["decoded"] == 3


def test_only_some_signals_messages_channels_and_a_span_of_time(whole, dbc, tmp_path, result):
    out = tmp_path / "o.csv"
    result(whole, "--dbc", dbc, "--out", out, "--signals", "M.S,U")
    assert pyarrow.csv.read_csv(out).column_names == ["time", "M.S", "N.U"]
    result(whole, "--dbc", dbc, "--out", out, "--messages", "N*", "--force")
    assert pyarrow.csv.read_csv(out).column_names == ["time", "N.U"]
    assert result(whole, "--dbc", dbc, "--from", "0.5", "--to", "1")["frames"] == 2
    assert result(whole, "--dbc", dbc, "--to", "1970-01-01T00:00:01.5")["frames"] == 2
    assert result(whole, "--dbc", dbc, "--to", "1970-01-01T09:00:01.5", "--timezone", "Asia/Tokyo")["frames"] == 2
    with pytest.raises(BrakebenchError, match=r"called 'Q'; it has M\.S"):
        run(whole, "--dbc", dbc, "--signals", "Q")
    with pytest.raises(BrakebenchError, match="channel can7; its channels are can0"):
        run(whole, "--dbc", dbc, "--channel", "can7")
    with pytest.raises(BrakebenchError, match="is no time"):
        run(whole, "--dbc", dbc, "--from", "noon")


def test_names_stand_beside_the_numbers(whole, dbc, tmp_path):
    out = tmp_path / "o.parquet"
    run(whole, "--dbc", dbc, "--out", out, "--names")
    table = pyarrow.parquet.read_table(out)
    assert table.column_names == ["time", "M.S", "M.T", "M.T (name)", "N.U"]
    assert table["M.T (name)"].to_pylist() == ["on", None, None, None]


def test_a_raster_holds_the_last_value(whole, dbc, tmp_path):
    out = tmp_path / "o.csv"
    run(whole, "--dbc", dbc, "--out", out, "--resample", "0.5")
    table = pyarrow.csv.read_csv(out)
    assert table["time"].to_pylist() == [1.0, 1.5, 2.0, 2.5]
    assert table["M.S"].to_pylist() == [0.5, 0.5, 0.5, 127.5]
    assert table["N.U"].to_pylist() == [None, None, 9, 9]


def test_a_folder_has_a_file_for_each_message(whole, dbc, tmp_path):
    out = tmp_path / "folder"
    run(whole, "--dbc", dbc, "--out", f"{out}/")
    assert sorted(path.name for path in out.iterdir()) == ["M.parquet", "N.parquet"]
    table = pyarrow.parquet.read_table(out / "M.parquet")
    assert table.to_pydict() == {"time": [1.0, 2.5], "S": [0.5, 127.5], "T": [1, None]}
    (out / "mine.txt").write_text("mine")
    with pytest.raises(BrakebenchError, match="--force"):
        run(whole, "--dbc", dbc, "--out", f"{out}/")
    assert run(whole, "--dbc", dbc, "--out", f"{out}/", "--force") == 0
    assert (out / "mine.txt").read_text() == "mine"


def test_an_existing_file_needs_force_and_a_file_that_is_read_is_never_replaced(whole, dbc, tmp_path):
    out = tmp_path / "o.csv"
    out.write_text("mine")
    with pytest.raises(BrakebenchError, match="--force"):
        run(whole, "--dbc", dbc, "--out", out)
    assert out.read_text() == "mine"
    assert run(whole, "--dbc", dbc, "--out", out, "--force") == 0
    log = whole.rename(tmp_path / "log.csv")  # its content tells the format
    with pytest.raises(BrakebenchError, match="read by this command"):
        run(log, "--dbc", dbc, "--out", log, "--force")
    link = tmp_path / "link.csv"
    link.symlink_to(log)
    with pytest.raises(BrakebenchError, match="read by this command"):
        run(log, "--dbc", dbc, "--out", link, "--force")
    table = dbc.rename(tmp_path / "dbc.csv")
    with pytest.raises(BrakebenchError, match="read by this command"):
        run(log, "--dbc", table, "--out", table, "--force")
    assert log.read_text() == WHOLE


def test_a_limit_counts_as_cut_off(whole, dbc, result):
    found = result(whole, "--dbc", dbc, "--limit-mb", "0.00004", code=1)
    assert found["truncated_at"] == 40
    assert (found["decoded"], found["unknown"], found["rejected"]) == (1, 1, 1)  # the begun line is no frame


def test_rubbish_is_unusable(tmp_path):
    path = tmp_path / "a.log"
    path.write_bytes(bytes(range(128, 256)) * 20)
    with pytest.raises(BrakebenchError, match="no log of a known format"):
        run(path)
    path.write_text("(1.0) can0 123#1122334455667788990011\n(1.0) can0 12#\n")
    assert run(path) == 2


def test_bit_rates_give_the_bus_load(tmp_path, dbc, result):
    path = tmp_path / "a.log"
    path.write_text("".join(f"({1 + k / 1000:.3f}) can{k % 2} 001#0102030405060708\n" for k in range(3000)))
    load = result(path, "--dbc", dbc, "--bitrate", "500000", "--bitrate", "can1=250000")["channels"]
    assert load["can0"]["load"] == pytest.approx(500 * 135 / 500_000, rel=0.001)
    assert load["can1"]["load"] == pytest.approx(500 * 135 / 250_000, rel=0.001)
    with pytest.raises(BrakebenchError, match="expected bit/s"):
        run(path, "--bitrate", "fast")


def test_columns_are_cut_to_the_width_and_empty_ones_left_out():
    lines = columns(("name", "empty", "n"), [("a" * 100, "", "1"), ("b", "", "22")], 40)
    assert lines[0] == "name".ljust(36) + "   n"
    assert max(map(len, lines)) == 40
    assert lines[1] == "a" * 12 + "~" + "a" * 23 + "   1"  # the end of a name tells more than its begin
    assert wrapped("  a bb \x1bcc", 8) == ["  a bb", "  \\x1bcc"]


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_tells_the_remaining_time_by_lines_where_it_is_no_terminal(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("hil.cli.progress.monotonic_ns", lambda: int(now[0] * 1e9))
    for stream in (Terminal(), io.StringIO()):
        now[0] = 100.0
        with Progress(2, stream) as progress:
            progress(0.1)
            now[0] += 10
            progress(0.5)
            progress(0.51)
        shown = stream.getvalue()
        line = "reading   25 %, 30 s left"
        assert shown == (f"\r{line}\r{' ' * len(line)}\r" if stream.isatty() else f"{line}\n")
    stream, now[0] = io.StringIO(), 100.0
    with Progress(1, stream) as progress:
        for n in range(1000):  # a quarter of a second each
            now[0] += 0.25
            progress(n / 1000)
        progress.tell("a line")
    assert "\r" not in stream.getvalue()
    assert len(stream.getvalue().splitlines()) == 10
    assert [duration_text(s) for s in (45, 185, 7800)] == ["45 s", "3 min 05 s", "2 h 10 min"]


def test_the_line_of_a_stamp_that_runs_back_is_named(tmp_path, dbc, capsys):
    lines = ["(1.0) can0 001#0101", "bad", "(3.0) can0 001#0101", "", "(2.0) can0 001#0101"]
    (tmp_path / "back.log").write_text("\n".join(lines))
    assert run(tmp_path / "back.log", "--dbc", dbc) == 1
    assert "stamps run back 1 time, first at frame 3 (line 5)" in capsys.readouterr().out
    run(tmp_path / "back.log", "--dbc", dbc, "--json")
    assert json.loads(capsys.readouterr().out)["stamps_back"]["first_line"] == 5


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_a_terminal_is_told_that_something_is_compiled():
    import hil.log.compiled  # noqa: F401 (tells of compilations once it is loaded)

    terminal, file = Terminal(), io.StringIO()
    for stream in (terminal, file):
        with Progress(stream=stream):
            numba.njit(lambda a: a + 1)(1)
    assert terminal.getvalue().startswith("\rcompiling what reads this log, once after installation: some seconds")
    assert terminal.getvalue().endswith(" \r")
    assert file.getvalue() == ""


def test_times_count_from_the_first_frame_of_the_log_whatever_part_is_chosen(tmp_path, dbc, capsys):
    stamps = [100 + k / 10 for k in range(80) if not 40 < k < 50]
    (tmp_path / "gap.log").write_text("".join(f"({t:.6f}) can0 001#0101\n" for t in stamps))
    for words in ((), ("--from", "2"), ("--from", "2", "--to", "6")):
        assert run(tmp_path / "gap.log", "--dbc", dbc, *words) == 0
        out = capsys.readouterr().out
        assert "gap: can0 001 M is silent for 1000 ms (10 cycles of 100 ms) from 4.000 s on" in out


def test_a_log_counts_once_under_whatever_name(log, dbc, tmp_path, result):
    (tmp_path / "link.log").symlink_to(log)
    assert result(log, tmp_path / "link.log", f"{tmp_path}/*.log", "--dbc", dbc, code=1)["frames"] == 6


def test_a_channel_that_only_an_option_knows_is_told(whole, dbc, result):
    words = ["--dbc", dbc, "--dbc", f"can3={dbc}", "--bitrate", "can4=500000", "--bitrate", "250000"]
    notes = result(whole, *words, "--channel", "can0", "--channel", "can5")["notes"]
    assert sorted(notes) == [
        "--bitrate: the log has no channel can4; its channels are can0",
        "--channel: the log has no channel can5; its channels are can0",
        "--dbc: the log has no channel can3; its channels are can0",
    ]


def test_a_log_of_another_car_asks_for_its_database(whole, dbc, capsys):
    hint = "give the database of this log with --dbc"
    assert run(whole) == 0
    assert hint in " ".join(capsys.readouterr().out.split())
    assert run(whole, "--dbc", dbc) == 0
    assert hint not in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], r"a\.dbc: is a database \(DBC\), no log; give a log, and this with --dbc"),
        (["--from", "9"], r"no frame between --from and --to; give times within 0 to 1\.500 s from its first frame$"),
        (["--from", "2", "--to", "1"], "no frame between --from and --to"),
        (["--channel", "can7", "--from", "0"], r"no channel can7; its channels are can0"),
        (["--resample", "0", "--out", "a.csv"], "--resample 0: expected a step above 0 in seconds, 0.01 for 10 ms"),
        (["--limit-mb", "0"], "--limit-mb 0: expected a number of megabytes above 0"),
        (["--out", "no/folder/a.csv"], "there is no folder no/folder; create it, or give another name"),
        (["--out", "a"], "written as .*, or into a FOLDER/ with a slash; got no suffix"),
    ],
)
def test_wrong_use_says_what_to_do(words, message, whole, dbc, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BrakebenchError, match=message):
        run(whole if words else dbc, "--dbc", dbc, *words)


def test_channels_of_databases_are_those_of_the_log(tmp_path, dbc, capsys):
    path = tmp_path / "a.csv"
    path.write_text("time_s,channel,id,extended,flags,length,data\n1.0,my bus,1,0,,2,0101\n1.1,b=c,1,0,,2,0101\n")
    assert run(path, "--dbc", f"my bus={dbc}", "--dbc", f"b=c={dbc}", "--dbc", f"can7={dbc}", "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["decoded"], result["unknown"]) == (2, 0)
    assert result["notes"] == ["--dbc: the log has no channel can7; its channels are my bus, b=c"]
    with pytest.raises(BrakebenchError, match=r"b=none\.dbc: cannot be opened"):
        run(path, "--dbc", "a=b=none.dbc")
