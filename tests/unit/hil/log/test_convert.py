import sys

import pytest

from hil.log import convert as convert_module
from hil.log.candump import read_candump
from hil.log.convert import convert
from hil.log.frames import LogError

TEXT = (
    "(1700000000.000001) vehicle 123#1122\n"
    "(1700000000.000002) bench 1FFFFFFF#1122334455667788\n"
    "(1700000000.000003) vehicle 123#R4\n"
    "(1700000000.000004) vehicle 124##11122334455667788\n"
)
ERROR_LINE = "(1700000000.000005) bench 20000004#0011000000000000\n"
FORMATS = [".log", ".asc", ".blf", ".trc", ".mf4", ".csv", ".parquet"]


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "in.log"
    path.write_text(TEXT)
    return path


@pytest.mark.parametrize("form", FORMATS)
def test_there_and_back(tmp_path, source, form):
    there = convert(source, tmp_path / f"there{form}")
    assert there.frames_written == len(there.source.frames) == 4
    back = convert(there.path, tmp_path / "back.log")
    expected = TEXT
    if form in (".asc", ".blf", ".trc", ".mf4"):
        assert any("vehicle is channel 1, bench is channel 2" in note for note in there.notes)
        expected = TEXT.replace("vehicle", "can0").replace("bench", "can1")
    text = back.path.read_text()
    assert sorted(text.splitlines()) == sorted(expected.splitlines())
    assert {p.name for p in tmp_path.iterdir()} == {"in.log", f"there{form}", "back.log"}


def test_asc_says_what_it_cannot_keep(tmp_path, source):
    source.write_text(TEXT + ERROR_LINE)
    assert any("1 error frames" in note for note in convert(source, tmp_path / "a.asc").notes)


def test_nanoseconds_are_said_to_be_lost(tmp_path, source):
    source.write_text("(1.000000001) can0 123#11\n")
    assert convert(source, tmp_path / "a.trc").notes == (".trc keeps stamps to the microsecond",)
    assert convert(source, tmp_path / "a.blf").notes == ()
    back = convert(tmp_path / "a.blf", tmp_path / "b.log").path
    assert back.read_text() == "(0000000001.000000001) can0 123#11\n"


def test_an_existing_file_is_replaced_only_when_asked(tmp_path, source):
    target = tmp_path / "out.csv"
    target.write_text("mine")
    with pytest.raises(LogError, match="exists already; use --force"):
        convert(source, target)
    assert target.read_text() == "mine"
    convert(source, target, overwrite=True)
    assert target.read_text().startswith("time_s,")


def test_nothing_is_left_when_the_format_cannot_hold_the_frames(tmp_path, source):
    source.write_text(TEXT + ERROR_LINE)
    with pytest.raises(LogError, match="TRC cannot hold"):
        convert(source, tmp_path / "out.trc")
    assert {p.name for p in tmp_path.iterdir()} == {"in.log"}


def test_what_reads_back_differently_is_not_kept(tmp_path, source, monkeypatch):
    def wrong(frames, path):
        lines = TEXT.replace("#1122\n", "#1123\n")
        path.write_text(lines)

    monkeypatch.setattr(convert_module, "write_log", wrong)
    with pytest.raises(LogError, match=r"out\.log: frame 0 reads back with another data \(1 frames differ\)"):
        convert(source, tmp_path / "out.log")
    monkeypatch.setattr(convert_module, "write_log", lambda frames, path: path.write_text(TEXT[:40]))
    with pytest.raises(LogError, match="4 frames were written, 1 read back"):
        convert(source, tmp_path / "out.log")
    assert {p.name for p in tmp_path.iterdir()} == {"in.log"}


def test_an_unwritable_place_is_said(tmp_path, source):
    with pytest.raises(LogError, match="cannot be written"):
        convert(source, tmp_path / "no" / "such" / "folder.log")


def test_mf4_without_its_package_says_what_to_install(tmp_path, source, monkeypatch):
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(LogError, match=r"pip install 'brakebench\[mdf\]'"):
        convert(source, tmp_path / "a.mf4")


def test_rejected_lines_are_left_out_and_counted(tmp_path, source):
    source.write_text("nonsense\n" + TEXT)
    done = convert(source, tmp_path / "a.log")
    assert (done.source.rejected, done.frames_written) == (1, 4)
    assert read_candump(done.path).rejected == 0
