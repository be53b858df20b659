from datetime import UTC
from zoneinfo import ZoneInfo

import pytest
from log_ways import check_mutants, read_both, read_bytes

from hil.log.frames import FrameFlag
from hil.log.read import open_log

FD, REMOTE, ERROR, SENT = FrameFlag.FD, FrameFlag.REMOTE, FrameFlag.ERROR, FrameFlag.SENT
START_NS = 1_407_498_547_965_000_000  # 2014-08-08 11:49:07.965


def head(base="HEX", mode="SYSTEM", start="8:8:2014 11:49:7:965", protocol="CAN"):
    return f"""***BUSMASTER Ver 2.4.0***
***PROTOCOL {protocol}***
***NOTE: PLEASE DO NOT EDIT THIS DOCUMENT***
***[START LOGGING SESSION]***
***START DATE AND TIME {start}***
***{base}***
***{mode} MODE***
***START CHANNEL BAUD RATE***
***CHANNEL 1 - Kvaser - Kvaser Leaf Light HS #0 (Channel 0), Serial Number- 0 - 500000 bps***
***END CHANNEL BAUD RATE***
***START DATABASE FILES (DBF/DBC)***
C:\\cars\\car.dbf
***END OF DATABASE FILES (DBF/DBC)***
***<Time><Tx/Rx><Channel><CAN ID><Type><DLC><DataBytes>***
"""


FOOT = "***END DATE AND TIME 8:8:2014 11:49:19:190***\n***[STOP LOGGING SESSION]***\n"


@pytest.fixture
def read(tmp_path):
    return lambda content, zone=UTC: read_both(tmp_path / "a.log", content, "busmaster", zone)


def frame(log, row=0):
    frames = log.frames
    held = 0 if frames.flags[row] & REMOTE else frames.length[row]
    return (
        int(frames.can_id[row]), bool(frames.extended[row]), int(frames.flags[row]), int(frames.length[row]),
        frames.data[row, :held].tobytes(),
    )  # fmt: skip


LINES = [
    ("Rx 1 0x023 s 1 40", (0x23, False, 0, 1, b"\x40")),
    ("Tx 1 0x18FEF100 x 2 0A ff", (0x18FEF100, True, SENT, 2, b"\x0a\xff")),
    ("Rx 1 0x460 S 8 03 E0 00 00 C0 00 00 00", (0x460, False, 0, 8, bytes.fromhex("03E00000C0000000"))),
    ("Rx 1 0x100 s 0", (0x100, False, 0, 0, b"")),
    ("Rx 1 0x100 sr 4", (0x100, False, REMOTE, 4, b"")),
    ("Tx 1 0x100 xr 8", (0x100, True, REMOTE | SENT, 8, b"")),
    ("Rx 1 0x100 s-fd 12 " + "01 " * 12, (0x100, False, FD, 12, b"\x01" * 12)),
    ("Rx 1 0x100 x-fd 15 " + "01 " * 64, (0x100, True, FD, 64, b"\x01" * 64)),
    ("Rx 1 0x000 ERR Stuff error", (0, False, ERROR, 0, b"")),
]


@pytest.mark.parametrize(("line", "expected"), LINES)
def test_each_kind_of_line(read, line, expected):
    log, account = read(head() + f"11:49:12:9420 {line}\r\n" * 2 + FOOT)
    assert account.whole
    assert [frame(log, row) for row in range(2)] == [expected] * 2
    assert set(log.frames.time_ns.tolist()) == {START_NS - 965_000_000 + 5_942_000_000}
    assert (log.frames.channels, account.start_ns, account.local_start) == (("can0",), START_NS, True)


def test_decimal(read):
    log, account = read(head("DEC") + "11:49:12:9420 Rx 2 291 s 3 016 255 1\n11:49:12:9420 Rx 2 291 s 1 256\n")
    assert (frame(log), account.rejected, log.frames.channels) == ((291, False, 0, 3, b"\x10\xff\x01"), 1, ("can1",))


def test_the_modes_of_time(read):
    lines = "00:00:01:5000 Rx 1 0x1 s 0\n00:00:02:0001 Rx 1 0x1 s 0\n100:00:00:0000 Rx 1 0x1 s 0\n"
    expected = {
        "ABSOLUTE": [1_500_000_000, 2_000_100_000, 360_000_000_000_000],
        "RELATIVE": [1_500_000_000, 3_500_100_000, 360_003_500_100_000],
    }
    for mode, offsets in expected.items():
        assert (read(head(mode=mode) + lines)[0].frames.time_ns - START_NS).tolist() == offsets


def test_midnight_passes_in_system_mode(read):
    lines = "23:59:59:9999 Rx 1 0x1 s 0\n00:00:00:0001 Rx 1 0x1 s 0\n00:00:00:0000 Rx 1 0x1 s 0\n"
    log, _ = read(head(start="31:12:2014 23:59:58:0") + lines)
    times = (log.frames.time_ns - 1_420_070_400_000_000_000).tolist()  # 2015-01-01
    assert times == [-100_000, 100_000, 0]


def test_sessions_have_a_start_each(read):
    line = "00:00:01:0000 Rx 1 0x1 s 0\n"
    second = head("DEC", "ABSOLUTE", "9:8:2014 11:49:7:965") + line.replace("0x", "")
    log, account = read(head(mode="ABSOLUTE") + line + FOOT + second + FOOT)
    assert (log.frames.time_ns - START_NS).tolist() == [10**9, 86_401 * 10**9]
    assert (account.whole, account.start_ns) == (True, START_NS)


def test_the_zone_is_chosen_by_who_reads(read):
    text = head() + "11:49:12:9420 Rx 1 0x1 s 0\n"
    times = [int(read(text, ZoneInfo(zone))[0].frames.time_ns[0]) for zone in ("UTC", "Asia/Tokyo")]
    assert times[1] - times[0] == -9 * 3600 * 10**9


@pytest.mark.parametrize("start", ["32:8:2014 1:1:1:1", "nonsense", "8:8:9999 1:1:1:1", "9" * 3000])
def test_an_absurd_start_time_is_said(read, start):
    log, account = read(head(start=start) + "00:00:01:0000 Rx 1 0x1 s 0\n")
    assert (log.frames.time_ns.tolist(), account.start_ns) == ([10**9], None)
    assert "start time" in account.notes[0]


def test_j1939_and_lin(read):
    text = head(protocol="J1939") + "11:49:12:9420 1 0x18FEF100 0FEF1 DATA 00 FF 6 Rx 2 11 22\n"
    text += "11:49:12:9420 1 0x18ECFF00 0FECA BAM 00 FF 6 Rx 20 " + "11 " * 20 + "\n11:49:12:9420 1 0x18FEF100 x\n"
    log, account = read(text)
    assert (frame(log), len(log.frames), account.rejected) == ((0x18FEF100, True, 0, 2, b"\x11\x22"), 1, 1)
    assert dict(account.passed_over) == {"J1939 message of several frames": 1}
    log, account = read(head(protocol="LIN") + "11:49:12:9420 Rx 1 0x23 2 11 22 33\n")
    assert (len(log.frames), dict(account.passed_over)) == (0, {"LIN": 1})


@pytest.mark.parametrize(
    "line",
    [
        "11:49:12:9420 Rx 1 0x023 s 2 40",
        "11:49:12:9420 Rx 1 0x023 s 1 40 41",
        "11:49:12:9420 Rx 1 0x800 s 1 40",
        "11:49:12:9420 Rx 1 0x023 s 1 GG",
        "11:49:12:9420 Rx 1 0x023 s 1 140",
        "11:49:12:9420 Rx 1 0x023 q 1 40",
        "11:49:12:9420 Qx 1 0x023 s 1 40",
        "11:49:12:9420 Rx x 0x023 s 1 40",
        "11:49:12:9420 Rx 1 0x023 s 16 " + "40 " * 16,
        "11:49:12:9420 Rx 1 0x023",
        "11:60:12:9420 Rx 1 0x023 s 1 40",
        "11:49:12 Rx 1 0x023 s 1 40",
        "11:49:12:94200 Rx 1 0x023 s 1 40",
        "9999999:49:12:9420 Rx 1 0x023 s 1 40",
        "nonsense",
        "\0" * 100,
        "9" * 5000,
    ],
)
def test_a_bad_line_is_counted_and_ends_nothing(read, line):
    good = "11:49:12:9420 Rx 1 0x023 s 1 40\n"
    log, account = read(head() + line + "\n" + good)
    assert (len(log.frames), account.rejected, account.truncated_at) == (1, 1, None)
    assert account.first_rejected[0].offset == len(head())


def test_a_last_line_without_an_end(read):
    line = "11:49:12:9420 Rx 1 0x023 s 2 40 41"
    assert read(head() + line)[1].truncated_at is None
    assert read(head() + FOOT.strip())[1].truncated_at is None
    for end in range(1, len(line) - 1):
        assert read(head() + line[:end])[1].truncated_at == len(head())


def test_it_is_told_by_its_content(tmp_path):
    (tmp_path / "a.txt").write_text(head() + "11:49:12:9420 Rx 1 0x023 s 1 40\n")
    with open_log(tmp_path / "a.txt") as log:
        assert (log.format.name, len(log.frames())) == ("busmaster", 1)


HOSTILE = {
    "line": head().encode() + b"11:49:12:9420 Rx 1 0x023 s 8 " + b"11 " * 350_000,
    "ends": b"\n" * 1_000_000,
    "stars": b"*" * 1_000_000,
    "headers": b"***\n" * 250_000,
    "number": b"9" * 1_000_000,
    "short": b"1:1:1:1\n" * 125_000,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_is_answered(tmp_path, name):
    """Each takes a second or two at most; what is quadratic takes minutes."""
    tables, _ = read_bytes(tmp_path / "a.log", HOSTILE[name], "busmaster", True)
    assert sum(len(table) for table in tables) == 0


MIXED = head() + "".join(f"11:49:12:9420 {line}\n" for line, _ in LINES) + FOOT


@pytest.mark.slow
def test_mutants(tmp_path, monkeypatch):
    content = (MIXED + MIXED.replace("SYSTEM", "RELATIVE")).encode()
    check_mutants(tmp_path / "a.log", content, "busmaster", 2000, 5, monkeypatch)
