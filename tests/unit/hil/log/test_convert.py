import weakref

import pytest

from hil.log import convert as convert_module
from hil.log.builder import ROWS
from hil.log.convert import convert
from hil.log.frames import LogError
from hil.log.read import open_log, read_log

TEXT = (
    "(1700000000.000001) vehicle 123#1122\n"
    "(1700000000.000002) bench 1FFFFFFF#1122334455667788\n"
    "(1700000000.000003) vehicle 123#R4\n"
    "(1700000000.000004) vehicle 124##11122334455667788\n"
)
ERROR_LINE = "(1700000000.000005) bench 20000004#0011000000000000\n"


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "in.log"
    path.write_text(TEXT)
    return path


def test_asc_says_what_it_cannot_keep(tmp_path, source):
    source.write_text(TEXT + ERROR_LINE)
    assert any("of the error frame" in note for note in convert(source, tmp_path / "a.asc").notes)


def test_nanoseconds_are_said_to_be_lost(tmp_path, source):
    source.write_text("(1.000000001) can0 123#11\n")
    assert convert(source, tmp_path / "a.trc").notes == ("trc keeps stamps to the microsecond",)
    assert convert(source, tmp_path / "a.blf").notes == ()
    back = convert(tmp_path / "a.blf", tmp_path / "b.log")
    assert back.path.read_text() == "(0000000001.000000001) can0 123#11\n"
    assert any("nine digits" in note for note in back.notes)


def test_an_existing_file_is_replaced_only_when_asked(tmp_path, source):
    target = tmp_path / "out.csv"
    target.write_text("mine")
    with pytest.raises(LogError, match="exists already; use --force"):
        convert(source, target)
    assert target.read_text() == "mine"
    convert(source, target, overwrite=True)
    assert target.read_text().startswith("time_s,")


def test_nothing_is_left_when_the_format_cannot_hold_the_frames(tmp_path, source):
    (tmp_path / "in.csv").write_text("time_s,channel,id,extended,flags,length,data\n-1.0,can0,1,0,,0,\n")
    with pytest.raises(LogError, match="candump cannot hold stamps before 1970"):
        convert(tmp_path / "in.csv", tmp_path / "out.log")
    assert {p.name for p in tmp_path.iterdir()} == {"in.log", "in.csv"}


def test_what_reads_back_differently_is_not_kept(tmp_path, source, monkeypatch):
    def wrong(_tables, _facts, path, _form, _zone):
        path.write_text(TEXT.replace("#1122\n", "#1123\n"))

    monkeypatch.setattr(convert_module, "write_tables", wrong)
    with pytest.raises(LogError, match=r"out\.log: frame 0 reads back with another data"):
        convert(source, tmp_path / "out.log")
    monkeypatch.setattr(convert_module, "write_tables", lambda _t, _f, path, _form, _z: path.write_text(TEXT[:37]))
    with pytest.raises(LogError, match="4 frames were written, 1 read back"):
        convert(source, tmp_path / "out.log")
    assert {p.name for p in tmp_path.iterdir()} == {"in.log"}


def test_the_log_itself_is_never_replaced(tmp_path, source):
    (tmp_path / "same.log").hardlink_to(source)
    for target in (source, tmp_path / "same.log"):
        with pytest.raises(LogError, match="is read by this command too"):
            convert(source, target, overwrite=True)
    assert source.read_text() == TEXT


def test_memory_does_not_hold_the_log(tmp_path, source):
    """Tables are handed on: of a log of many tables no more than a few are alive at once."""
    source.write_text(TEXT * 60_000)
    seen = []
    with open_log(source) as log:
        for table in log.tables():
            seen.append(weakref.ref(table.time_ns))
            assert sum(one() is not None for one in seen) <= 2
            assert len(table) <= ROWS
    assert len(seen) == 4


def test_an_unwritable_place_is_said(tmp_path, source):
    with pytest.raises(LogError, match=r"cannot be written: there is no folder .*; create it"):
        convert(source, tmp_path / "no" / "such" / "folder.log")


def test_rejected_lines_are_left_out_and_counted(tmp_path, source):
    source.write_text("nonsense\n" + TEXT)
    done = convert(source, tmp_path / "a.log")
    assert (done.account.rejected, done.frames_written) == (1, 4)
    assert read_log(done.path).rejected == 0
