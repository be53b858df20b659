from datetime import UTC
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest
from log_ways import check_mutants, read_both, read_bytes

from hil.log.frames import FrameFlag
from hil.log.read import open_log

LOGS = Path(__file__).parents[4] / "data" / "logs"
FD, BRS, ESI = FrameFlag.FD, FrameFlag.BIT_RATE_SWITCH, FrameFlag.ERROR_STATE
REMOTE, ERROR, SENT = FrameFlag.REMOTE, FrameFlag.ERROR, FrameFlag.SENT
STAMP = " (1700000000.000100)  "
BYTES = "00 01 02 03 04 05 06 07 "


@pytest.fixture
def read(tmp_path):
    return lambda content, zone=UTC: read_both(tmp_path / "a.log", content, "candump_screen", zone)


def frame(log, row=0):
    frames = log.frames
    held = 0 if frames.flags[row] & REMOTE else frames.length[row]
    return (
        int(frames.can_id[row]), bool(frames.extended[row]), int(frames.flags[row]), int(frames.length[row]),
        frames.data[row, :held].tobytes(),
    )  # fmt: skip


LINES = [
    ("can0  123   [2]  11 22", (0x123, False, 0, 2, b"\x11\x22")),
    ("can0       123   [2]  11 22", (0x123, False, 0, 2, b"\x11\x22")),
    ("can0  18FEF100   [8]  11 22 33 44 55 66 77 88", (0x18FEF100, True, 0, 8, bytes.fromhex("1122334455667788"))),
    ("can0  123   [0] ", (0x123, False, 0, 0, b"")),
    ("can0  123   [0]", (0x123, False, 0, 0, b"")),
    ("can0  7FF   [2]  11 22                     '.\"'", (0x7FF, False, 0, 2, b"\x11\x22")),
    ("can0  7FF   [2]  31 20                     '1 '", (0x7FF, False, 0, 2, b"1 ")),
    ("can0  7FF   [0]                            ''", (0x7FF, False, 0, 0, b"")),
    ("can0  123   [8]  remote request", (0x123, False, REMOTE, 8, b"")),
    ("can0  00000123   [0]  remote request", (0x123, True, REMOTE, 0, b"")),
    (
        "can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME",
        (4, False, ERROR, 8, bytes([0, 4, 0, 0, 0, 0, 0, 0])),
    ),
    ("can0  123  [02]  11 22", (0x123, False, FD, 2, b"\x11\x22")),
    ("can0  123  [64]  " + BYTES * 8, (0x123, False, FD, 64, bytes(range(8)) * 8)),
    ("can0  RX - -  123   [1]  11", (0x123, False, 0, 1, b"\x11")),
    ("can0  TX - -  123   [1]  11", (0x123, False, SENT, 1, b"\x11")),
    ("can0  TX B E  123  [01]  11", (0x123, False, FD | BRS | ESI | SENT, 1, b"\x11")),
    ("can0  RX B -  12345678  [12]  " + "11 " * 12, (0x12345678, True, FD | BRS, 12, b"\x11" * 12)),
    ("can0  RX - E  123  [01]  11", (0x123, False, FD | ESI, 1, b"\x11")),
    ("can0  TX - -  123   [3]  remote request", (0x123, False, REMOTE | SENT, 3, b"")),
    ("can0  123   {F}  11 22 33 44 55 66 77 88", (0x123, False, 0, 8, bytes.fromhex("1122334455667788"))),
    ("can0  123   [2]  00010001 00100010", (0x123, False, 0, 2, b"\x11\x22")),
    ("can0  123   [2]  22`11", (0x123, False, 0, 2, b"\x11\x22")),
    ("can0  123   [2]  00100010`00010001", (0x123, False, 0, 2, b"\x11\x22")),
    ('can0  123   [2]  22`11                     `".`', (0x123, False, 0, 2, b"\x11\x22")),
    ("\x1b[1m\x1b[34mcan0\x1b[0m  123   [1]  11\x1b[0m", (0x123, False, 0, 1, b"\x11")),
    ("can0  123   [1]  11\r", (0x123, False, 0, 1, b"\x11")),
]


@pytest.mark.parametrize(("line", "expected"), LINES)
def test_each_kind_of_line(read, line, expected):
    log, account = read((STAMP + line + "\n") * 3)
    assert account.whole
    assert [frame(log, row) for row in range(3)] == [expected] * 3
    assert set(log.frames.time_ns.tolist()) == {1_700_000_000_000_100_000}
    assert log.frames.channels == ("can0",)
    assert account.notes == ([] if not expected[2] & FD or "X" in line else [account.notes[0]])


@pytest.mark.parametrize(
    "line",
    [
        "can0  123   [2]  11",
        "can0  123   [2]  11 22 33",
        "can0  123   [2]  11 2",
        "can0  123   [2]  11 GG",
        "can0  123   [9]  " + "11 " * 9,
        "can0  123  [09]  " + "11 " * 9,
        "can0  800   [1]  11",
        "can0  FFFFFFFF   [1]  11",
        "can0  1234   [1]  11",
        "can0  123   [x]  11",
        "can0  123   11",
        "123   [1]  11",
        "can0  QX - -  123   [1]  11",
        "nonsense",
        "\0" * 50,
        "9" * 5000,
    ],
)
def test_a_bad_line_is_counted_and_ends_nothing(read, line):
    good = STAMP + "can0  123   [1]  11\n"
    log, account = read(good + STAMP + line + "\n" + good)
    assert (len(log.frames), account.rejected, account.truncated_at) == (2, 1, None)
    assert account.first_rejected[0].offset == len(good)


def test_times_from_the_first_frame(read):
    log, account = read("".join(f" ({t})  can0  123   [0] \n" for t in ("000.000000", "000.010000", "1000.020001")))
    assert log.frames.time_ns.tolist() == [0, 10_000_000, 1_000_020_001_000]
    assert account.notes == ["the log has no dates: its times count from the first frame on (candump -tz)"]


def test_times_from_frame_to_frame_are_added_up(read):
    log, account = read("".join(f" ({t})  can0  123   [0] \n" for t in ("000.000000", "000.010000", "000.009999")))
    assert log.frames.time_ns.tolist() == [0, 10_000_000, 19_999_000]
    assert account.notes == ["the log has no dates: its times count from frame to frame (candump -td), added up"]


def test_dates_are_wall_clock(read):
    text = " (2023-11-14 22:13:20.000100)  can0  123   [1]  11\n (2023-11-14 23:59:59.999999999)  can0  123   [1]  11\n"
    log, account = read(text)
    assert log.frames.time_ns.tolist() == [1_700_000_000_000_100_000, 1_700_006_399_999_999_999]
    assert (account.local_start, account.notes) == (True, [])
    assert read(text, ZoneInfo("Asia/Tokyo"))[0].frames.time_ns[0] == 1_699_967_600_000_100_000
    assert read(" (2023-13-14 22:13:20.000100)  can0  123   [1]  11\n")[1].rejected == 1


def test_without_times(read):
    log, account = read("  can0  123   [1]  11\n  vcan0  124  [01]  11\n")
    assert log.frames.time_ns.tolist() == [0, 0]
    assert (log.frames.channels, len(account.notes)) == (("can0", "vcan0"), 2)


def test_error_text_is_passed_over(read):
    text = STAMP + "can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME\n"
    text += "\tcontroller-problem{rx-error-warning}\n\terror-counter-tx-rx{{96}{0}}\n"
    text += "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n"
    log, account = read(text)
    assert (len(log.frames), account.rejected) == (1, 0)
    assert dict(account.passed_over) == {"error text": 2, "dropped frames": 1}


def test_a_last_line_without_an_end(read):
    line = STAMP + "can0  123   [2]  11 22"
    assert read(line)[1].truncated_at is None
    for end in range(1, len(line)):
        assert (read(line[:end])[1].truncated_at == 0) == bool(line[:end].strip())


@pytest.mark.parametrize(("name", "flags"), [("view.log", [0, ERROR, 0, FD, REMOTE]), ("screen.log", [0, 0])])
def test_cases(read, name, flags):
    log, account = read((LOGS / name).read_bytes())
    assert (log.frames.flags.tolist(), account.whole) == (flags, True)
    with open_log(LOGS / name) as opened:
        assert opened.format.name == "candump_screen"


HOSTILE = {
    "line": STAMP.encode() + b"can0  123   [8]  " + b"11 " * 350_000,
    "ends": b"\n" * 1_000_000,
    "number": b"(" + b"9" * 1_000_000,
    "blanks": b" " * 1_000_000,
    "returns": b" (1.0)  can0  123   [1]  11\r" * 35_000,
    "short": b"a b\n" * 250_000,
    "colours": b"\x1b[" * 2000 + b"\n" + b"\x1b[1m\n" * 200_000,
    "words": (b"x " * 2000 + b"\n") * 250,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_is_answered(tmp_path, name):
    """Each takes a second or two at most; what is quadratic takes minutes."""
    tables, _ = read_bytes(tmp_path / "a.log", HOSTILE[name], "candump_screen", True)
    assert sum(len(table) for table in tables) == 0


MIXED = "".join(STAMP + line + "\n" for line, _ in LINES) + "".join(
    f" ({t})  can{k % 2}  123   [1]  {k:02X}\n" for k, t in enumerate(("000.0000", "000.0100", "000.009999", "12.5"))
)


@pytest.mark.slow
def test_mutants(tmp_path, monkeypatch):
    check_mutants(tmp_path / "a.log", MIXED.encode("latin-1"), "candump_screen", 2000, 4, monkeypatch)


def test_a_log_of_length_codes_alone_is_told(tmp_path):
    path = tmp_path / "a.log"
    path.write_text(" (1700000000.000100)  can0  123   {D}  11 22 33 44 55 66 77 88\n")
    with open_log(path) as log:
        assert (log.format.name, len(log.frames())) == ("candump_screen", 1)
