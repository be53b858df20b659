import gzip
import io
from dataclasses import replace
from datetime import UTC

import fenced_children
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from log_mutants import COLUMNS, assert_possible, rows, varied

from hil.errors import BrakebenchError
from hil.log.account import Account
from hil.log.foreign import fence, parquet_columns
from hil.log.foreign.fence import BYTES, Limits, fenced_bytes
from hil.log.foreign.parquet import frames_of, write_parquet
from hil.log.frames import FrameTable, LogError, LogFacts
from hil.log.read import open_log


def written(tables, start_ns=None):
    file = io.BytesIO()
    write_parquet(file, tables, replace(LogFacts.of(tables), start_ns=start_ns), UTC)
    return file.getvalue()


def read(path, content=None):
    if content is not None:
        path.write_bytes(content)
    with open_log(path) as log:
        return log.recording()


def in_old_layout(table, **changed):
    words = [" ".join(w for k, w in enumerate(parquet_columns.WORDS) if f >> k & 1) for f in table.flags.tolist()]
    columns = {
        "time_s": pa.array(table.time_ns / 1e9),
        "channel": pa.array([table.channels[c] for c in table.channel.tolist()]),
        "id": pa.array(table.can_id),
        "extended": pa.array(table.extended),
        "flags": pa.array(words),
        "length": pa.array(table.length),
        "data": pa.array([row[6].upper() for row in rows(table)]),
    }
    file = io.BytesIO()
    pq.write_table(pa.table({**columns, **changed}), file)
    return file.getvalue()


def test_what_is_written_reads_back_exactly(tmp_path):
    table = varied(500)
    content = written([table.take(slice(0, 300)), table.take(slice(300, 500))], start_ns=-(10**18))
    log = read(tmp_path / "a.parquet", content)
    assert log.start_ns == -(10**18)
    assert log.rejected == 0
    for column in COLUMNS:
        if column != "channel":
            assert np.array_equal(getattr(log.frames, column), getattr(table, column)), column
    assert [row[1] for row in rows(log.frames)] == [row[1] for row in rows(table)]


def test_the_file_is_a_table_as_any_other(tmp_path):
    table = varied(100)
    (tmp_path / "a.parquet").write_bytes(written([table, table]))
    file = pq.ParquetFile(tmp_path / "a.parquet")
    assert file.num_row_groups == 2
    found = file.read()
    assert found.column_names == ["time", "channel", "id", "extended", "length", "flags", "data"]
    assert found.schema.field("time").type == pa.timestamp("ns")
    assert [data.hex() for data in found["data"].to_pylist()] == [row[6] for row in rows(table)] * 2


def test_no_frame_and_no_start_time(tmp_path):
    frames, account = taken(written([]), tmp_path / "a.parquet")
    assert len(frames) == 0
    assert account.start_ns is None


def test_the_other_layout(tmp_path):
    table = varied(200)
    table.time_ns[:] = np.where(np.abs(table.time_ns) < 10**17, table.time_ns, table.time_ns // 1000 * 1000)
    frames, account = taken(in_old_layout(table), tmp_path / "a.parquet")
    assert account.rejected == 0
    assert np.abs(frames.time_ns - table.time_ns).max() <= 1000
    assert rows(frames) == [(int(frames.time_ns[k]), *row[1:]) for k, row in enumerate(rows(table))]


def test_seconds_are_rounded_as_finely_as_they_are_known(tmp_path):
    table = FrameTable.empty(3, channels=("a",))
    seconds = pa.array([1_700_000_000.123457, 12.000000001, -0.5])
    frames, _ = taken(in_old_layout(table, time_s=seconds), tmp_path / "a.parquet")
    assert frames.time_ns.tolist() == [1_700_000_000_123_457_000, 12_000_000_001, -500_000_000]


def taken(content, path):
    """Frames and account without the fence."""
    path.write_bytes(content)
    account = Account()
    tables = list(frames_of(parquet_columns.batches(path), account))
    return FrameTable.joined(tables, tables[-1].channels if tables else ()), account


@pytest.mark.parametrize(
    ("column", "values"),
    [
        ("time_s", pa.array([0.0, np.nan, 1.0])),
        ("time_s", pa.array([0.0, 1e12, 1.0])),
        ("id", pa.array([1, 0x800, 1])),
        ("id", pa.array([1, -1, 1])),
        ("id", pa.array([1, 2**64 - 1, 1], pa.uint64())),
        ("length", pa.array([0, 9, 0])),
        ("length", pa.array([0, None, 0], pa.int8())),
        ("flags", pa.array(["", "strange", ""])),
        ("flags", pa.array(["", None, ""])),
        ("data", pa.array(["", "1", ""])),
        ("data", pa.array(["", "GG", ""])),
        ("data", pa.array(["", "11", ""])),
        ("data", pa.array([b"", b"x" * 65, b""])),
        ("channel", pa.array(["a", "n" * 2000, "a"])),
        ("channel", pa.array(["a", None, "a"]).dictionary_encode()),
    ],
)
def test_a_row_that_is_no_frame_is_rejected_alone(tmp_path, column, values):
    table = FrameTable.empty(3, channels=("a",))
    table.time_ns[:] = (0, 1, 10**9)
    frames, account = taken(in_old_layout(table, **{column: values}), tmp_path / "a.parquet")
    assert frames.time_ns.tolist() == [0, 10**9]
    assert account.rejected == 1
    assert account.first_rejected[0].offset == 1


def test_many_rejected_rows_are_all_counted(tmp_path):
    table = varied(1000)
    table.can_id[:] = 0xFFFFFFFF
    frames, account = taken(written([table]), tmp_path / "a.parquet")
    assert (account.rejected, len(account.first_rejected), len(frames)) == (1000, 10, 0)


def test_names_need_not_be_sound_utf8(tmp_path):
    name = pa.array([b"a\xff"]).view(pa.string())
    frames, _ = taken(in_old_layout(FrameTable.empty(1, channels=("a",)), channel=name), tmp_path / "a.parquet")
    assert frames.channels == ("a\\xff",)


def test_coarser_stamps(tmp_path):
    stamps = pa.array([1, -5, None, 2**62], pa.timestamp("ms", tz="UTC"))
    table = FrameTable.empty(4, channels=("a",)).to_arrow().set_column(0, "time", stamps)
    file = io.BytesIO()
    pq.write_table(table, file)
    frames, account = taken(file.getvalue(), tmp_path / "a.parquet")
    assert frames.time_ns.tolist() == [1_000_000, -5_000_000]
    assert account.rejected == 2


def test_another_table_says_what_is_missing(tmp_path):
    pq.write_table(pa.table({"time": [1.0], "speed": [2.0]}), tmp_path / "a.parquet")
    with pytest.raises(LogError, match=r"a\.parquet: no table of frames: columns channel, id, .* are missing"):
        read(tmp_path / "a.parquet")
    table = FrameTable.empty(1, channels=("a",)).to_arrow()
    pq.write_table(table.set_column(0, "time", pa.array(["x"])), tmp_path / "a.parquet")
    with pytest.raises(BrakebenchError, match=r"column time is string, expected timestamp\[ns\]"):
        list(parquet_columns.batches(tmp_path / "a.parquet"))


@pytest.mark.parametrize("size", [100])
def test_a_file_that_is_cut_off_is_one_error(tmp_path, size):
    with pytest.raises(LogError, match="Parquet reader cannot read it"):
        read(tmp_path / "a.parquet", written([varied(100)])[:size])


def test_packed_and_limited(tmp_path):
    path = tmp_path / "a.parquet.gz"
    path.write_bytes(gzip.compress(written([varied(100)])))
    assert len(read(path).frames) == 100
    (tmp_path / "a.parquet").write_bytes(written([varied(100)]))
    with open_log(tmp_path / "a.parquet", limit_bytes=1000) as log, pytest.raises(LogError, match="as a whole"):
        log.frames()


def test_a_file_that_unpacks_to_far_too_many_rows(tmp_path, monkeypatch):
    content = written([FrameTable.empty(50_000, channels=("a",))])
    assert len(content) < 5_000
    assert len(taken(content, tmp_path / "a.parquet")[0]) == 50_000
    monkeypatch.setattr(parquet_columns, "FREE_ROWS", 20_000)
    with pytest.raises(BrakebenchError, match=r"rows in \d+ bytes: no log"):
        taken(content, tmp_path / "a.parquet")


@pytest.mark.slow
def test_mutants(tmp_path, monkeypatch):
    """All in one process behind the fence, which is begun anew where the library takes it down."""
    monkeypatch.setattr(fence, "ENTRY", ("-P", fenced_children.__file__))
    (tmp_path / "mutant").write_bytes(written([varied(600)]))
    read_well, next_seed, ends = 0, 0, 0
    while next_seed < 2000:
        pieces = fenced_bytes(
            "__main__:parquet_mutants", tmp_path / f"mutant.{next_seed}", "reader", Limits(BYTES, 200)
        )
        try:
            for piece in pieces:
                if piece.isdigit():
                    next_seed = int(piece) + 1
                elif piece.startswith(b"{"):
                    account = Account()
                    start = piece
                elif not piece.startswith(b"!"):
                    for frames in frames_of(iter([start, piece]), account):
                        assert_possible(frames)
                        assert len(frames) + account.rejected == 600
                        read_well += 1
        except LogError:
            ends += 1
    assert read_well > 100
    assert ends < 200
