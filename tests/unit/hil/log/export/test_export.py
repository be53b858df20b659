import csv
import json
import math

import pyarrow.parquet
import pytest

from dbc.database import parse_database
from hil.log.export import tables as export_module
from hil.log.export.blocks import Field, Layout, block_of
from hil.log.export.tables import LEAST_ROWS, export, export_blocks, group_rows
from hil.log.frames import LogError
from hil.log.read import read_log
from hil.log.signals.decode import decode_log

DBC = """VERSION ""
BU_: A
BO_ 1 M: 2 A
 SG_ S : 0|8@1+ (0.5,0) [0|0] "km/h" A
 SG_ T : 8|8@1+ (1,0) [0|0] "" A
BO_ 2 N: 1 A
 SG_ U : 0|8@1+ (1,0) [0|0] "bar, gauge" A
VAL_ 1 T 0 "off" 1 "on" ;
"""
LOG = "(1.000001) can0 001#0101\n(1.5) can0 7FF#00\n(2.0) can0 002#09\nbad\n(2.5) can0 001#0300\n"


@pytest.fixture
def decode(tmp_path):
    def decode(text=LOG):
        path = tmp_path / "a.log"
        path.write_text(text)
        return decode_log(read_log(path), parse_database(DBC))

    return decode


@pytest.mark.parametrize("cells_per_batch", [1, 4_000_000])
def test_parquet_has_one_row_a_frame_and_units(tmp_path, decode, monkeypatch, cells_per_batch):
    monkeypatch.setattr(export_module, "CELLS_PER_BATCH", cells_per_batch)
    export(decode(LOG * 600), tmp_path / "a.parquet")
    table = pyarrow.parquet.read_table(tmp_path / "a.parquet")
    assert table.column_names == ["time", "M.S", "M.T", "N.U"]
    assert table.num_rows == 2400
    for start in (0, 2396):
        assert table.slice(start, 4).to_pydict() == {
            "time": [1.000001, 1.5, 2.0, 2.5],
            "M.S": [0.5, None, None, 1.5],
            "M.T": [1, None, None, 0],
            "N.U": [None, None, 9, None],
        }
    assert table.schema.field("time").metadata == {b"unit": b"s"}
    assert table.schema.field("M.S").metadata == {b"unit": b"km/h"}
    assert json.loads(table.schema.field("M.T").metadata[b"values"]) == {"0": "off", "1": "on"}


def test_pieces_of_a_log_become_few_groups_of_rows(tmp_path, decode):
    pieces = [decode(LOG * 25), decode(LOG * 3 + "(3.0) can1 001#0001\n"), *[decode(LOG * 100)] * 12]
    layout = Layout(
        tuple(Field(name.partition(".")[0], c.signal, c.values.dtype) for name, c in pieces[0].columns.items()),
        with_channel=True,
        names=True,
        rows=5000,
    )
    export_blocks(map(block_of, pieces), layout, tmp_path / "a.parquet")
    file = pyarrow.parquet.ParquetFile(tmp_path / "a.parquet")
    groups = [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)]
    assert groups == [LEAST_ROWS] * 4 + [4913 - 4 * LEAST_ROWS]
    table = file.read()
    assert table.column("channel").to_pylist() == ["can0"] * 112 + ["can1"] + ["can0"] * 4800
    numbers, names = table.column("M.T").to_pylist(), table.column("M.T (name)").to_pylist()
    assert names == [None if number is None else ("off", "on")[number] for number in numbers]
    export_blocks(map(block_of, pieces), layout, tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as csv_file:
        rows = list(csv.DictReader(csv_file))
    assert [row["M.T (name)"] or None for row in rows] == names


def test_row_groups_grow_with_the_root_of_the_log():
    assert group_rows(0) == LEAST_ROWS
    assert group_rows(40_000_000) == pytest.approx(2 * group_rows(10_000_000), abs=2)


def test_csv_leaves_cells_empty(tmp_path, decode):
    export(decode(), tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["time", "M.S", "M.T", "N.U"]
    assert rows[2] == ["1.5", "", "", ""]
    assert [float(cell) if cell else math.nan for cell in rows[4][:2]] == [2.5, 1.5]


def test_channels_are_told_apart_where_a_message_came_on_two(tmp_path, decode):
    export(decode(LOG + LOG.replace("can0", "can1")), tmp_path / "a.parquet")
    table = pyarrow.parquet.read_table(tmp_path / "a.parquet")
    assert table.column_names[:2] == ["time", "channel"]
    assert table.column("channel").to_pylist() == ["can0"] * 4 + ["can1"] * 4


def test_a_log_without_frames_is_an_empty_table(tmp_path, decode):
    export(decode("(1.0) can0 1#"), tmp_path / "a.parquet")
    assert pyarrow.parquet.read_table(tmp_path / "a.parquet").shape == (0, 1)
    export(decode("(1.0) can0 1#"), tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text() == "time\n"


def test_another_suffix_is_refused(tmp_path, decode):
    with pytest.raises(LogError, match=r"\.parquet or \.csv, .*; got the suffix '\.xlsx'"):
        export(decode(), tmp_path / "a.xlsx")
