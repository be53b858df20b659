import gc
import os
from pathlib import Path

import fenced_children
import pytest

from hil.log.foreign import fence
from hil.log.foreign.fence import BYTES, SECONDS, Limits, fenced_bytes
from hil.log.frames import LogError

MEBIBYTE = 1 << 20


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Pieces of one of the functions of fenced_children, for a file of three bytes."""
    monkeypatch.setattr(fence, "ENTRY", ("-P", fenced_children.__file__))
    path = tmp_path / "in"
    path.write_bytes(b"abc")

    def run(name, **limits):
        return fenced_bytes(f"__main__:{name}", path, "strange reader", Limits(**limits) if limits else None)

    return run


def children():
    return set(Path(f"/proc/self/task/{os.getpid()}/children").read_text().split())


def test_pieces_arrive_whole_and_nothing_printed_among_them(run):
    assert [len(piece) for piece in run("well")] == [3, 0, 3_000_000]


def test_a_descriptor_is_read_instead_of_a_path(run, tmp_path, monkeypatch):
    with (tmp_path / "other").open("w+b") as file:
        file.write(b"defg")
        file.flush()
        (tmp_path / "other").unlink()
        pieces = fenced_bytes("__main__:well", tmp_path / "in", "strange reader", descriptor=file.fileno())
        assert next(pieces) == b"defg"
        pieces.close()


@pytest.mark.parametrize(
    ("name", "limits", "message"),
    [
        ("takes_memory", {"more_bytes": 100 * MEBIBYTE}, "strange reader wanted more than 100 MiB"),
        ("sleeps", {"seconds": 0.2}, r"strange reader took longer than 0\.2 s"),
        ("spins", {"seconds": 0.2}, r"strange reader took longer than 0\.2 s"),
        ("killed", {}, r"strange reader crashed \(SIGSEGV, limit 256 MiB\)"),
        ("leaves", {}, r"strange reader crashed \(exit code 3, limit 256 MiB\)"),
        ("raises", {}, r"strange reader cannot read it \(ValueError: first line\\x1b\[31m\)"),
    ],
)
def test_what_goes_wrong_is_one_error(run, name, limits, message):
    before = children()
    with pytest.raises(LogError, match=message) as caught:
        list(run(name, **limits))
    assert "\n" not in str(caught.value)
    assert children() == before


def test_processor_time_is_limited_where_nobody_waits(run):
    """The child has a limit of its own: its parent may have no time to look."""
    pieces = run("spins", more_bytes=BYTES, seconds=0)
    with pytest.raises(LogError, match="took longer than 0 s"):
        list(pieces)


def test_who_stops_reading_leaves_no_process(run):
    before = children()
    pieces = run("without_end")
    assert len(next(pieces)) == 100_000
    assert children() != before
    pieces.close()
    assert children() == before
    pieces = run("without_end")
    next(pieces)
    del pieces
    gc.collect()
    assert children() == before


def test_only_known_functions_run(tmp_path):
    with pytest.raises(LogError, match="os:system may not run behind the fence; known are"):
        list(fenced_bytes("os:system", tmp_path, "reader", Limits()))


def test_nothing_is_imported_from_the_current_folder(tmp_path, monkeypatch):
    (tmp_path / "pyarrow.py").write_text("raise SystemExit")
    (tmp_path / "a.parquet").write_bytes(b"PAR1 and no more")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LogError, match="Arrow"):
        list(fenced_bytes("hil.log.foreign.parquet_columns:batches", Path("a.parquet"), "Parquet reader"))


def test_limits_grow_with_the_file_from_a_megabyte_on():
    assert Limits.for_size(0) == Limits.for_size(1_000_000) == Limits(BYTES, SECONDS)
    assert Limits.for_size(10_000_000) == Limits(10 * BYTES, 10 * SECONDS)
