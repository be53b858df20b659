"""What a decoded log offers: names, tables; and how several databases go together."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from decoding import as_j1939, database_of, recording

from dbc.database import parse_database
from hil.log.read import read_log
from hil.log.signals.decode import Decoder, decode_log

DATA = Path(__file__).parents[4] / "data" / "logs"


def known(name):
    return parse_database((DATA / name).read_bytes(), name)


@pytest.mark.parametrize("fast", [False, True])
def test_a_frame_too_short_for_its_message_gives_the_signals_it_has(fast):
    log = decode_log(read_log(DATA / "short.log"), known("short.dbc"), fast=fast)
    assert (log.decoded, log.rejected) == (3, 0)
    assert (log.messages["MUXED"].count, log.messages["MUXED"].short) == (3, 2)
    assert log.columns["MUXED.Sel"].values.tolist() == [0, 1, 1]
    assert log.columns["MUXED.Short"].values.tolist() == [0x42, 0x43]
    assert log.columns["MUXED.Long"].values.tolist() == [0x04030201]


@pytest.mark.parametrize("fast", [False, True])
def test_a_signal_needs_all_its_bytes_and_those_of_its_multiplexer(fast):
    database = database_of(
        "BO_ 1 M: 8 A",
        ' SG_ X M : 40|8@1+ (1,0) [0|0] "" A',
        ' SG_ Y m1 : 8|8@1+ (1,0) [0|0] "" A',
        ' SG_ Z : 7|12@0+ (1,0) [0|0] "" A',
    )
    log = decode_log(recording([(1, b"\xab\x10\0\0\0\1"), (1, b"\xab\x10\0\0\0"), (1, b"\xab")]), database, fast=fast)
    assert (log.decoded, log.rejected) == (2, 1)
    assert {name: column.rows.tolist() for name, column in log.columns.items()} == {
        "M.X": [0], "M.Y": [0], "M.Z": [0, 1],
    }  # fmt: skip


@pytest.mark.parametrize("fast", [False, True])
def test_a_signal_that_never_comes_is_an_empty_column(fast):
    database = database_of(
        "BO_ 1 M: 2 A",
        ' SG_ X M : 0|8@1+ (1,0) [0|0] "" A',
        ' SG_ Y m1 : 8|8@1+ (0.5,0) [0|0] "" A',
        ' SG_ Z m2 : 8|8@1+ (1,0) [0|0] "" A',
        'VAL_ 1 Z 255 "SNA" ;',
    )
    log = decode_log(recording([(1, b"\2\xff")]), database, fast=fast)
    assert {name: column.values.tolist() for name, column in log.columns.items()} == {"M.X": [2], "M.Y": [], "M.Z": []}
    assert log.columns["M.Y"].values.dtype == np.float64
    assert log.columns["M.Z"].values.dtype == np.int64
    assert log.signals == {"M.X": (1, 0, 0), "M.Y": (0, 0, 0), "M.Z": (1, 1, 0)}
    assert log.table("M").column("Y").to_pylist() == [None]


def test_frames_of_the_next_can_fd_length_are_not_longer():
    database = database_of("BO_ 1 M: 10 A", ' SG_ S : 72|8@1+ (1,0) [0|0] "" A')
    log = decode_log(recording([(1, b"\1" * 12), (1, b"\2" * 10), (1, b"\3" * 16)]), database)
    assert (log.messages["M"].longer, log.messages["M"].short) == (1, 0)
    assert log.columns["M.S"].values.tolist() == [1, 2, 3]


def test_names_of_values():
    log = decode_log(read_log(DATA / "e.log"), known("e.dbc"))
    assert {name: column.names().tolist() for name, column in log.columns.items()} == {
        "T.Temp": ["error"], "T.Gear": ["D"], "T.Neg": ["five"],
    }  # fmt: skip
    table = log.table("T", names=True)
    assert table.column_names == ["time", "Temp", "Temp.name", "Gear", "Gear.name", "Neg", "Neg.name"]
    assert table.to_pylist()[0]["Temp.name"] == "error"


@pytest.mark.parametrize(
    ("sg", "val", "raw", "names"),
    [
        ("0|8@1+ (0.1,-3)", '3 "c" 7 "g"', [3, 4, 7, 255], ["c", None, "g", None]),
        ("0|8@1- (-2,10)", '-1 "minus" 5 "five" -128 "low"', [255, 5, 128, 0], ["minus", "five", "low", None]),
        ("0|8@1- (1,0)", '-1 "a" 255 "b"', [255], ["a"]),
        ("0|8@1+ (0,1)", '3 "c" 7 "g"', [9], ["c"]),
        ("0|8@1+ (1,0)", "", [9], [None]),
    ],
)
def test_names_go_by_the_raw_value(sg, val, raw, names):
    database = database_of("BO_ 1 M: 8 A", f' SG_ S : {sg} [0|0] "" A', f"VAL_ 1 S {val} ;" if val else "")
    log = decode_log(recording([(1, bytes([r]) + bytes(7)) for r in raw]), database)
    assert log.columns["M.S"].names().tolist() == names
    assert log.columns["M.S"].to_arrow_names().to_pylist() == names


def test_names_of_64_unsigned_bits():
    database = database_of(
        "BO_ 1 M: 8 A", ' SG_ S : 0|64@1+ (1,0) [0|0] "" A', 'VAL_ 1 S 18446744073709551615 "all" -1 "none" 1 "one" ;'
    )
    log = decode_log(recording([(1, b"\xff" * 8), (1, b"\1" + bytes(7)), (1, bytes(8))]), database)
    assert log.columns["M.S"].names().tolist() == ["all", "one", None]


def test_table_of_a_message():
    database = database_of(
        "BO_ 1 M: 2 A",
        ' SG_ X M : 0|8@1+ (1,0) [0|0] "" A',
        ' SG_ Y m1 : 8|8@1+ (0.5,0) [0|0] "km/h" A',
        'VAL_ 1 Y 4 "four" ;',
    )
    log = decode_log(recording([(1, b"\1\4"), (2, b""), (1, b"\2\5"), (1, b"\1\6")]), database)
    table = log.table("M", names=True)
    assert table.schema.field("time").type == pa.timestamp("ns")
    assert table.column("time").cast(pa.int64()).to_pylist() == [0, 20_000_000, 30_000_000]
    assert table.column("X").to_pylist() == [1, 2, 1]
    assert table.column("Y").to_pylist() == [2.0, None, 3.0]
    assert table.column("Y.name").to_pylist() == ["four", None, None]
    assert table.schema.field("Y").metadata == {b"unit": b"km/h"}
    assert log.table("M").column_names == ["time", "X", "Y"]
    assert table.to_pandas()["X"].dtype == np.int64
    with pytest.raises(KeyError):
        log.table("N")


def test_two_databases_for_one_channel():
    log = decode_log(read_log(DATA / "two.log"), [known("one.dbc"), known("two.dbc")])
    assert (log.decoded, log.unknown, log.notes) == (1, 0, ())
    assert log.columns["M1.a"].values.tolist() == [7]


def test_the_first_database_that_knows_an_identifier_is_used():
    one = database_of("BO_ 1 M: 1 A", ' SG_ S : 0|8@1+ (1,0) [0|0] "" A', source="a/one.dbc")
    two = database_of(
        "BO_ 1 N: 1 A", ' SG_ S : 0|8@1+ (2,0) [0|0] "" A',
        "BO_ 2 M: 1 A", ' SG_ S : 0|8@1+ (3,0) [0|0] "" A',
        source="b/two.dbc",
    )  # fmt: skip
    frames = [(1, b"\1"), (2, b"\1"), (1, b"\1", 0, 1)]
    log = decode_log(recording(frames, ("x", "y")), {"x": [one, two], "y": two})
    assert {name: column.values.tolist() for name, column in log.columns.items()} == {
        "M.S": [1], "M@x.S": [3], "N.S": [2],
    }  # fmt: skip
    assert log.notes == ("identifier 0x1: M of a/one.dbc is used, N of b/two.dbc is not",)
    log = decode_log(recording(frames[:2]), [one, two, one])
    assert set(log.columns) == {"M.S", "M@two.S"}
    many = [database_of(*(f'BO_ {i} M{i}: 1 A\n SG_ S : 0|8@1+ ({n},0) [0|0] "" A' for i in range(30))) for n in (1, 2)]
    assert Decoder(many).totals.notes[-1] == "and 10 more identifiers that two databases know"
    assert Decoder([many[0], many[0]]).totals.notes == ()


def test_a_whole_identifier_and_a_group_of_two_databases():
    group = as_j1939(database_of("BO_ 2566834942 DM1: 8 A", ' SG_ S : 0|8@1+ (1,0) [0|0] "" A'))
    whole = database_of("BO_ 2566834689 OWN: 8 A", ' SG_ S : 0|8@1+ (2,0) [0|0] "" A')
    frames = [(0x18FECA01, b"\1" * 8), (0x18FECA02, b"\1" * 8)]
    for databases, messages in (([group, whole], {"DM1": 2}), ([whole, group], {"OWN": 1, "DM1": 1})):
        for fast in (False, True):
            log = decode_log(recording(frames), databases, fast=fast)
            assert {name: m.count for name, m in log.messages.items()} == messages


def test_a_long_chain_of_multiplexers_is_followed():
    depth = 16  # more are not read from a database
    lines = [' SG_ S0 M : 0|1@1+ (1,0) [0|0] "" A']
    lines += [f' SG_ S{i} m1{"M" if i < depth - 1 else ""} : {i}|1@1+ (1,0) [0|0] "" A' for i in range(1, depth)]
    chain = [f"SG_MUL_VAL_ 1 S{i} S{i - 1} 1-1;" for i in range(1, depth)]
    database = database_of("BO_ 1 M: 8 A", *lines, *chain)
    log = decode_log(recording([(1, b"\xff" * 8), (1, b"\xff\xef" + b"\xff" * 6)]), database)
    assert log.columns[f"M.S{depth - 1}"].rows.tolist() == [0]
    assert log.columns["M.S12"].values.tolist() == [1, 0]
