import csv
import io
from datetime import UTC
from pathlib import Path

import numpy as np
import pytest
from log_mutants import COLUMNS, assert_alike, mutant, read_both, rows, varied

from hil.log import builder as builder_module
from hil.log.frames import FrameFlag, LogError, LogFacts
from hil.log.read import open_log
from hil.log.text import lines
from hil.log.text.csv_tables import COLUMNS as HEADER
from hil.log.text.csv_tables import OwnRows, PythonCanRows, nanoseconds, write_csv

DATA = Path(__file__).parents[4] / "data" / "logs"
OWN = HEADER + "\n"
GVRET = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
PYTHON_CAN = "timestamp,arbitration_id,extended,remote,error,dlc,data\n"


@pytest.fixture
def read(tmp_path):
    """Frames and account of a text; the careful and the compiled way must agree."""

    def read(text, form=None):
        path = tmp_path / "a.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        careful, compiled = read_both(path, form)
        assert_alike(careful, compiled)
        if isinstance(careful, str):
            raise LogError(path, careful)
        return careful

    return read


FD, BRS, ESI = FrameFlag.FD, FrameFlag.BIT_RATE_SWITCH, FrameFlag.ERROR_STATE


@pytest.mark.parametrize(
    ("line", "row"),
    [
        ("1.5,can0,291,0,,2,1122", (1_500_000_000, "can0", 0x123, False, 0, 2, "1122")),
        ("-0.000000001,can0,291,1,tx,0,", (-1, "can0", 0x123, True, FrameFlag.SENT, 0, "")),
        ("-12,can0,0,0,,0,", (-12_000_000_000, "can0", 0, False, 0, 0, "")),
        ("1700000000.123456789,can0,1,0,,1,aB", (1_700_000_000_123_456_789, "can0", 1, False, 0, 1, "ab")),
        ("1e-06,can0,1,0,,0,", (1000, "can0", 1, False, 0, 0, "")),
        ("1.0000000016,can0,1,0,,0,", (1_000_000_002, "can0", 1, False, 0, 0, "")),
        ("1,can0,1,0,remote tx,8,", (10**9, "can0", 1, False, FrameFlag.REMOTE | FrameFlag.SENT, 8, "")),
        ("1,can0,536870911,0,error,1,07", (10**9, "can0", 0x1FFFFFFF, False, FrameFlag.ERROR, 1, "07")),
        ("1,can0,1,True,fd brs esi,12," + "0" * 24, (10**9, "can0", 1, True, FD | BRS | ESI, 12, "0" * 24)),
        ('1,"bus, front",1,0,,0,', (10**9, "bus, front", 1, False, 0, 0, "")),
        ('1,"the ""big"" one",1,0,,0,', (10**9, 'the "big" one', 1, False, 0, 0, "")),
        ('"1","can0","1","0","","1","05"', (10**9, "can0", 1, False, 0, 1, "05")),
        ("1,bremse ä,1,0,,0,", (10**9, "bremse ä", 1, False, 0, 0, "")),
        ("1,can0,1,0,,1,05\r", (10**9, "can0", 1, False, 0, 1, "05")),
    ],
)
def test_each_kind_of_own_row(read, line, row):
    frames, account = read(OWN + (line + "\n") * 3)
    assert rows(frames) == [row] * 3
    assert account.whole


@pytest.mark.parametrize(
    "line",
    [
        "1,can0,2048,0,,0,",
        "1,can0,536870912,1,,0,",
        "1,can0,1,0,,9,112233445566778899",
        "1,can0,1,0,fd,9,112233445566778899",
        "1,can0,1,0,,2,11",
        "1,can0,1,0,,1,1122",
        "1,can0,1,0,remote,1,11",
        "1,can0,1,0,strange,0,",
        "1,can0,1,2,,0,",
        "1,can0,-1,0,,0,",
        "1,can0,1,0,,1,g0",
        "1,can0,1,0,,2,1 1",
        "1,can0,1,0,,0",
        "1,can0,1,0,,0,,",
        "nan,can0,1,0,,0,",
        "99999999999,can0,1,0,,0,",
        "1e99,can0,1,0,,0,",
        '1,"can0,1,0,,0,',
        "1,can0,1,0,,0,\x00",
        "rubbish",
    ],
)
def test_a_row_that_is_no_frame_is_rejected_alone(read, line):
    good = "1,can0,1,0,,1,05\n"
    frames, account = read(OWN + good + line + "\n" + good)
    assert len(frames) == 2
    assert account.rejected == 1
    assert account.first_rejected[0].offset == len(OWN) + len(good)
    assert account.truncated_at is None


def test_a_row_that_is_cut_off():
    with open_log(DATA / "cut.csv") as log:
        assert rows(log.frames()) == [(10**9, "can0", 1, False, 0, 8, "1122334455667788")]
        assert (log.account.rejected, log.account.truncated_at) == (1, 78)


def test_a_last_row_without_its_line_end_is_whole(read):
    _, account = read(OWN + "1,can0,1,0,,1,05")
    assert account.whole


def test_joined_tables_repeat_their_header(read):
    frames, account = read(b"\xef\xbb\xbf" + (OWN + "1,can0,1,0,,1,05\n").encode() * 2)
    assert len(frames) == 2
    assert account.passed_over == {"header line": 1}


def test_another_header_is_no_table_of_frames(read):
    with pytest.raises(LogError, match="expected the columns time_s,channel,id"):
        read("time,speed\n1,2\n", "csv")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (
            "gvret.csv",
            [
                (973_000, "can0", 0x13B, False, 0, 8, "000008000000004c"),
                (2_009_000, "can1", 0x18FEF100, True, 0, 3, "010203"),
            ],
        ),
        ("gvret_old.csv", [(166_064_000_000, "can0", 0x21A, False, 0, 8, "fe3612fe690507ad")]),
        (
            "savvycan.csv",
            [
                (1_000_000_000, "can0", 0x123, False, 0, 2, "0102"),
                (1_010_000_000, "can1", 0x18DAF110, True, FrameFlag.SENT, 1, "03"),
            ],
        ),
    ],
)
def test_gvret_files(name, expected):
    careful, compiled = read_both(DATA / name, None)
    assert_alike(careful, compiled)
    assert rows(careful[0]) == expected
    assert careful[1].whole


@pytest.mark.parametrize(
    ("line", "row"),
    [
        ("1.5,0x123,FALSE,rx,0,1,AB", (1_500_000_000, "can0", 0x123, False, 0, 1, "ab")),
        ("10,123,true,Tx,7,0", (10_000, "can7", 0x123, True, FrameFlag.SENT, 0, "")),
        ("-10,123,0,Rx,0,2,1,a,", (-10_000, "can0", 0x123, False, 0, 2, "010a")),
        ("10,7FF,false,Rx,0,12" + ",01" * 12 + ",", (10_000, "can0", 0x7FF, False, FD, 12, "01" * 12)),
        ("10,7FF,false,Rx,0,64" + ",01" * 64, (10_000, "can0", 0x7FF, False, FD, 64, "01" * 64)),
        ("10,7FF,false,Rx,0,1,01,00,,00,", (10_000, "can0", 0x7FF, False, 0, 1, "01")),
    ],
)
def test_each_kind_of_gvret_row(read, line, row):
    frames, account = read(GVRET + (line + "\n") * 3)
    assert rows(frames) == [row] * 3
    assert account.whole


@pytest.mark.parametrize(
    "line",
    [
        "10,800,false,Rx,0,0,",
        "10,123,perhaps,Rx,0,0,",
        "10,123,false,Up,0,0,",
        "10,123,false,Rx,256,0,",
        "10,123,false,Rx,0,3,01,02",
        "10,123,false,Rx,0,9" + ",01" * 9,
        "10,123,false,Rx,0,1,0G,",
        "10,123,false,Rx,0,1,01,0000",
        "x,123,false,Rx,0,0,",
        "99999999999999999,123,false,Rx,0,0,",
    ],
)
def test_a_gvret_row_that_is_no_frame_is_rejected(read, line):
    good = "10,123,false,Rx,0,1,01,\n"
    frames, account = read(GVRET + good + line + "\n" + good)
    assert (len(frames), account.rejected) == (2, 1)


def test_python_can_writes_and_we_read(tmp_path):
    can = pytest.importorskip("can")
    messages = [
        can.Message(1.5, 0x123, is_extended_id=False, data=b"\x01\x02\xff"),
        can.Message(1700000000.25, 0x1FFFFFFF, is_extended_id=True, data=bytes(8)),
        can.Message(2.5, 0x7FF, is_extended_id=False, is_remote_frame=True, dlc=4),
        can.Message(3.5, 0x1, is_extended_id=False, is_fd=True, data=bytes(range(48))),
        can.Message(4.5, 0x1, is_extended_id=False, is_error_frame=True, dlc=0),
    ] * 2
    path = tmp_path / "p.csv"
    with can.CSVWriter(path) as writer:
        for message in messages:
            writer(message)
    careful, compiled = read_both(path, None)
    assert_alike(careful, compiled)
    frames, account = careful
    assert account.whole
    assert frames.channels == ("can0",)
    for k, message in enumerate(messages):
        assert frames.time_ns[k] == message.timestamp * 1e9
        assert frames.can_id[k] == message.arbitration_id
        assert frames.length[k] == message.dlc
        assert frames.data[k, : len(message.data)].tobytes() == bytes(message.data)
        assert bool(frames.flags[k] & FrameFlag.REMOTE) == message.is_remote_frame
        assert bool(frames.flags[k] & FrameFlag.ERROR) == message.is_error_frame
        assert bool(frames.flags[k] & FrameFlag.FD) == message.is_fd


@pytest.mark.parametrize(
    "line",
    ["1,0x123,0,0,0,3,AQI=", "1,0x800,0,0,0,0,", "1,0x1,0,0,0,9,AAAAAAAAAAAAAAA", "1,0x1,0,2,0,0,", "1,x,0,0,0,0,"],
)
def test_a_python_can_row_that_is_no_frame_is_rejected(read, line):
    good = "1.5,0x123,0,0,0,2,AQI=\n"
    frames, account = read(PYTHON_CAN + good + line + "\n" + good)
    assert (len(frames), account.rejected) == (2, 1)


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("1", 9, 10**9),
        ("1.", 9, 10**9),
        ("-1.25", 9, -1_250_000_000),
        ("1700000000.1234567", 9, 1_700_000_000_123_456_700),
        ("1.5e-05", 9, 15_000),
        ("0.00000000049", 9, 0),
        ("123", 3, 123_000),
        ("1e3", 9, 10**12),
        ("", 9, None),
        ("inf", 9, None),
        ("1_0", 9, None),
        ("٣", 9, None),
    ],
)
def test_stamps_are_read_exactly(text, unit, expected):
    assert nanoseconds(text, unit) == expected


def written(tables):
    file = io.BytesIO()
    write_csv(file, tables, LogFacts.of(tables), UTC)
    return file.getvalue()


def test_what_is_written_reads_back_exactly(read):
    table = varied(500)
    content = written([table.take(slice(0, 300)), table.take(slice(300, 500))])
    frames, account = read(content)
    assert account.whole
    for column in COLUMNS:
        if column != "channel":
            assert np.array_equal(getattr(frames, column), getattr(table, column)), column
    assert [row[1] for row in rows(frames)] == [row[1] for row in rows(table)]
    assert all(len(row) == 7 for row in csv.reader(io.StringIO(content.decode())))


@pytest.mark.parametrize(
    ("rows_of", "head", "row"),
    [
        (OwnRows, OWN, "1700000000.{k:09d},{name},160,0,,8,7F10000000000000\n"),
        (
            PythonCanRows,
            PYTHON_CAN,
            "1700000000.{k:02d},0xa0,0,0,0,8,fxAAAAAAAAA=\n",
        ),  # a comma where ours has one
        (PythonCanRows, PYTHON_CAN, "1700000000.{k:06d},0x18fef100,1,0,0,8,fxAAAAAAAAA=\n"),
    ],
)
def test_the_compiled_pass_takes_every_plain_row(rows_of, head, row):
    names = ["can0", "can0", "c", "a longer name", "can1", "can12345"]
    builder = builder_module.FrameBuilder()
    reader = rows_of(Path("a.csv"), builder.account)
    text = [row.format(k=k, name=names[k % 6]) for k in range(60)]
    assert reader.line(head.strip().encode(), 0, builder)
    for line in text[:6]:  # the careful way meets the names first
        reader.line(line.strip().encode(), 0, builder)
    buffer = np.frombuffer("".join(text[6:]).encode(), np.uint8)
    assert reader.take(buffer, 0, builder) == len(buffer)
    table = builder.take()
    if rows_of is OwnRows:
        assert [table.channels[c] for c in table.channel] == [names[k % 6] for k in range(60)]


def test_a_very_long_channel_name_bounds_the_memory(read):
    table = varied(40, names=("n" * 3000,))
    frames, _ = read(written([table]))
    assert frames.channels == ("n" * 3000,)
    assert len(frames) == 40


def gvret_rows():
    lines = (f"{k}000,{k + 100:X},false,Rx,{k % 3},{k % 9}" + ",1F" * (k % 9) + ",\n" for k in range(30))
    return (GVRET + "".join(lines)).encode()


def python_can_rows():
    data = ("", "AQ==", "AQI=")
    return (PYTHON_CAN + "".join(f"{k}.25,0x{k + 1:x},1,0,0,{k % 3},{data[k % 3]}\n" for k in range(30))).encode()


MUTATED = {"csv": lambda: written([varied(30)]), "gvret": gvret_rows, "python_can_csv": python_can_rows}


@pytest.mark.slow
@pytest.mark.parametrize("form", MUTATED)
def test_mutants(tmp_path, monkeypatch, form):
    monkeypatch.setattr(lines, "BLOCK_BYTES", 700)
    monkeypatch.setattr(builder_module.FrameBuilder.__init__, "__defaults__", (None, 7))
    content = MUTATED[form]()
    path = tmp_path / "mutant"
    path.write_bytes(content)
    careful, compiled = read_both(path, form)
    assert_alike(careful, compiled)
    assert len(careful[0]) == 30
    for seed in range(2000):
        path.write_bytes(mutant(seed, content))
        assert_alike(*read_both(path, form))
