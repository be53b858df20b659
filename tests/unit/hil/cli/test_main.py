"""What the command line as a whole promises: exit codes, whole output, nothing raw on a terminal."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet
import pytest

from hil.cli.main import main

FRAME = "(1700000000.%06d) can0 123#1122334455667788\n"
DBC = """VERSION ""
BU_: E
BO_ 291 M: 8 E
 SG_ A : 0|8@1+ (1,0) [0|255] "u" E
"""
RED = "\x1b[31m"
REPOSITORY = Path(__file__).parents[4]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "a.log").write_text("".join(FRAME % k for k in range(10)))
    (tmp_path / "a.dbc").write_text(DBC)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words):
    try:
        return main(words)
    except SystemExit as error:
        return error.code


def started(*words, **options):
    environment = dict(os.environ, PYTHONPATH=str(REPOSITORY))
    return subprocess.Popen(
        [sys.executable, "-m", "hil.cli.main", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
        **options,
    )


@pytest.mark.parametrize(
    "words",
    [
        ("decode", f"{RED}none.log"),
        ("decode", f"n{RED}.log"),
        ("decode", "a.log", "--dbc", f"{RED}none.dbc"),
        ("decode", "a.log", "--channel", RED),
        ("decode", "a.log", "--bitrate", RED),
        ("decode", "a.log", "--out", RED),
        ("decode", "a.log", f"--{RED}"),
        ("convert", "a.log", f"o{RED}"),
        ("diff", "a.log", "a.log", "--tolerance", RED),
        ("plot", "a.log", "A", "--dbc", "a.dbc", "--out", f"p{RED}.bmp"),
        ("plot", "a.log", "A", "--dbc", "a.dbc", "--out", f"p{RED}.html"),
    ],
)
def test_control_letters_of_the_command_line_reach_no_terminal(folder, capsys, words):
    code = run(*words)
    said = "".join(capsys.readouterr())
    assert code == (0 if words[-1].endswith("html") else 2)
    assert "\x1b" not in said
    assert "[31m" in said


@pytest.mark.parametrize("out", ["a.log/o.csv", "n" * 300 + ".csv", ""])
def test_an_output_that_cannot_be_is_refused(folder, capsys, out):
    assert run("decode", "a.log", "--dbc", "a.dbc", "--out", out) == 2
    assert capsys.readouterr().err.startswith("brakebench: ")


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mf4"])
def test_names_as_long_as_a_file_system_takes_and_names_that_are_no_text(folder, suffix):
    for name in ["n" * (255 - len(suffix)) + suffix, os.fsdecode(b"caf\xe9") + suffix]:
        assert run("decode", "a.log", "--dbc", "a.dbc", "--out", name) == 0
        assert Path(name).stat().st_size > 0
    assert run("decode", "a.log", "--dbc", "a.dbc", "--out", os.fsdecode(b"\xe9/")) == 0
    assert (
        pyarrow.parquet.read_table(
            pyarrow.BufferReader((Path(os.fsdecode(b"\xe9")) / "M.parquet").read_bytes())
        ).num_rows
        == 10
    )


def test_an_output_that_is_a_link_is_written_where_it_leads(folder):
    Path("o.csv").symlink_to("real.csv")
    assert run("decode", "a.log", "--dbc", "a.dbc", "--out", "o.csv") == 0
    assert Path("o.csv").is_symlink()
    assert Path("real.csv").read_text().startswith("time,M.A")
    assert run("decode", "a.log", "--dbc", "a.dbc", "--out", "o.csv") == 2


def test_a_log_without_any_sound_frame_is_converted_to_nothing(folder, capsys):
    Path("bad.log").write_text("(1700000000.1) can0 123#123\n")
    assert run("convert", "bad.log", "o.asc") == 2
    assert "no frame could be read" in capsys.readouterr().err
    assert not Path("o.asc").exists()


def test_diff_of_equal_logs_that_are_not_whole_returns_1(folder, capsys):
    Path("cut.log").write_text(FRAME % 1 + "(1700000000.2) can0 123#11")
    assert run("diff", "cut.log", "cut.log", "--dbc", "a.dbc", "--json") == 1
    result = json.loads(capsys.readouterr().out)
    assert result["equal"]
    assert result["whole"] == [False, False]
    assert run("diff", "a.log", "a.log", "--dbc", "a.dbc") == 0


def test_plot_of_a_log_with_frames_too_short_for_their_message_returns_1(folder):
    Path("short.log").write_text(FRAME % 1 + "(1700000000.2) can0 123#\n")
    assert run("plot", "short.log", "A", "--dbc", "a.dbc", "--out", "p.png") == 1


def test_letters_that_the_output_cannot_encode_are_escaped(folder, monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    process = started("convert", "a.log", "ä.asc")
    out, error = process.communicate()
    assert (process.returncode, error) == (0, b"")
    assert rb"\xe4.asc: 10 frames read" in out


def test_a_reader_that_leaves_early_changes_no_exit_code(folder):
    Path("bad.log").write_text(FRAME % 1 + "rubbish\n")
    process = started("decode", "bad.log")
    process.stdout.close()
    _, error = process.communicate()
    assert (process.returncode, error) == (1, b"")


def test_a_pipe_is_read_like_a_file(folder):
    os.mkfifo("pipe")
    process = started("decode", "pipe", "a.log", "--dbc", "a.dbc", "--json")
    with Path("pipe").open("w") as pipe:
        pipe.write(Path("a.log").read_text())
    out, _ = process.communicate()
    assert process.returncode == 0
    assert json.loads(out)["decoded"] == 20


def test_closed_standard_input_is_said(folder):
    process = started("decode", "-", preexec_fn=lambda: os.close(0))
    _, error = process.communicate()
    assert process.returncode == 2
    assert b"standard input is closed" in error


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("out", ["o.csv", "o/", "o.mf4"])
def test_an_interrupted_command_leaves_nothing(folder, number, code, out):
    Path("long.log").write_text("".join(FRAME % k for k in range(400_000)))
    before = set(Path().iterdir())
    for _ in range(5):
        process = started("decode", "long.log", "--dbc", "a.dbc", "--out", out, "--force")
        while process.poll() is None and set(Path().iterdir()) == before:  # until it writes
            time.sleep(0.001)
        process.send_signal(number)
        _, error = process.communicate()
        if process.returncode:
            break
        shutil.rmtree(out) if out.endswith("/") else Path(out).unlink()  # it ended before the signal
    assert (process.returncode, error) == (code, b"")
    assert set(Path().iterdir()) == before


@pytest.mark.parametrize(("moment", "zone"), [("0001-01-01T00:00", "Asia/Tokyo"), ("9999-12-31T23:59", "America/Lima")])
def test_a_date_beyond_the_calendar_is_refused(folder, capsys, moment, zone):
    assert run("decode", "a.log", "--from", moment, "--timezone", zone) == 2
    assert "is no time" in capsys.readouterr().err


def test_what_a_format_cannot_hold_is_said_of_the_output(folder, capsys):
    Path("old.csv").write_text("time_s,channel,id,extended,flags,length,data\n-5,can0,1,0,,1,01\n")
    assert run("convert", "old.csv", "o.log") == 2
    assert capsys.readouterr().err.startswith("brakebench: o.log: candump cannot hold stamps before 1970")
