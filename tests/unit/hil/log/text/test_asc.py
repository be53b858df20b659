from dataclasses import replace
from datetime import UTC
from pathlib import Path
from zoneinfo import ZoneInfo

import can
import numpy as np
import pytest
from log_ways import assert_equal, check_mutants, read_both, read_bytes

from hil.log.builder import FrameBuilder
from hil.log.formats import BY_NAME
from hil.log.frames import FrameFlag, LogError, LogFacts
from hil.log.read import open_log
from hil.log.write import kept

LOGS = Path(__file__).parents[4] / "data" / "logs"
HEAD = "date Tue Nov 14 10:13:20.123 pm 2023\nbase hex  timestamps absolute\n"
START_NS = 1_700_000_000_123_000_000
FD, BRS, ESI = FrameFlag.FD, FrameFlag.BIT_RATE_SWITCH, FrameFlag.ERROR_STATE
REMOTE, ERROR, SENT = FrameFlag.REMOTE, FrameFlag.ERROR, FrameFlag.SENT
TAIL = " 130000  130 {flags} 0 46500250 460a0250 20011736 20010205"


@pytest.fixture
def read(tmp_path):
    return lambda content, zone=UTC: read_both(tmp_path / "a.asc", content, "asc", zone)


def frame(log, row=0):
    frames = log.frames
    held = 0 if frames.flags[row] & REMOTE else frames.length[row]
    return (
        int(frames.can_id[row]), bool(frames.extended[row]), int(frames.flags[row]), int(frames.length[row]),
        frames.data[row, :held].tobytes(),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("0.1 1  123             Rx   d 2 11 ff", (0x123, False, 0, 2, b"\x11\xff")),
        ("0.1 1  123x            Tx   d 2 11 FF", (0x123, True, SENT, 2, b"\x11\xff")),
        ("0.1 1 7FF Rx d 0", (0x7FF, False, 0, 0, b"")),
        ("0.1 1 1FFFFFFFX rx D 1 1", (0x1FFFFFFF, True, 0, 1, b"\x01")),
        ("0.1 1 123 Rx d 8 0 1 2 3 4 5 6 7", (0x123, False, 0, 8, bytes(range(8)))),
        ("0.1 1 123 Rx d 2 11 22  Length = 121950 BitCount = 64 ID = 291", (0x123, False, 0, 2, b"\x11\x22")),
        ("0.1 1 EngineData Rx d 2 11 22  Length = 1 BitCount = 64 ID = 291", (0x123, False, 0, 2, b"\x11\x22")),
        ("0.1 1 Data_1 Tx d 1 11 Length = 1 BitCount = 64 ID = 18219x", (0x472B, True, SENT, 1, b"\x11")),
        ("0.1 1 Data_1 Rx d 1 11 Length = 1 BitCount = 64 ID = 2147483939x", (0x123, True, 0, 1, b"\x11")),
        ("0.1 1 EngineData Rx r 8 Length = 0 BitCount = 55 ID = 291", (0x123, False, REMOTE, 8, b"")),
        ("0.1\t1\t123\tRx\td\t1\t11\r", (0x123, False, 0, 1, b"\x11")),
        ("0.1 1 123 Rx d e 00 01 02 03 04 05 06 07", (0x123, False, 0, 8, bytes(range(8)))),
        ("0.1 1 123 Rx d 9 " + "0A " * 12, (0x123, False, FD, 12, b"\x0a" * 12)),
        ("0.1 1 123 Rx d 15 " + "0A " * 64, (0x123, False, FD, 64, b"\x0a" * 64)),
        ("0.1 1 123 Rx r", (0x123, False, REMOTE, 0, b"")),
        ("0.1 1 123 Tx r 4", (0x123, False, REMOTE | SENT, 4, b"")),
        ("0.1 1 123x Rx r f", (0x123, True, REMOTE, 8, b"")),
        ("0.1 1 123 Rx r Length = 56 BitCount = 30", (0x123, False, REMOTE, 0, b"")),
        ("0.1 1  ErrorFrame", (0, False, ERROR, 0, b"")),
        ("0.1 1  ErrorFrame  Flags = 0xe CodeExt = 0x20a2 Code = 0x82 ID = 0", (0, False, ERROR, 0, b"")),
        ("0.1 CANFD 1 Tx ErrorFrame Not Acknowledge error 0 0 0", (0, False, ERROR | SENT, 0, b"")),
        ("0.1 CANFD   1 Rx        4EE                  0 1 f 64 " + "01 " * 64 + TAIL.format(flags=0),
         (0x4EE, False, FD | ESI, 64, b"\x01" * 64)),
        ("0.1 CANFD   1 Tx  11x  msgCanFdFr1                      1 0 a 16 " + "59 " * 16 + TAIL.format(flags=223040),
         (0x11, True, FD | BRS | SENT, 16, b"\x59" * 16)),
        ("0.1 CANFD   1 Rx  11  e1 0 0 2 2 01 02" + TAIL.format(flags=1000), (0x11, False, FD, 2, b"\1\2")),
        ("0.1 CANFD   1 Rx  11  0 0 2 2 01 02", (0x11, False, FD, 2, b"\1\2")),
        ("0.1 CANFD   1 Rx  11  0 0 2  2 01 02" + TAIL.format(flags=0), (0x11, False, 0, 2, b"\1\2")),
        ("0.1 CANFD   1 Rx  11  1 0 2  2 01 02" + TAIL.format(flags=0), (0x11, False, FD | BRS, 2, b"\1\2")),
        ("0.1 CANFD   1 Tx 123  0 0 5  0  " + TAIL.format(flags=200050), (0x123, False, REMOTE | SENT, 5, b"")),
        ("0.1 CANFD   1 Rx 123x  Name 0 0 e  0  " + TAIL.format(flags=10), (0x123, True, REMOTE, 8, b"")),
    ],
)  # fmt: skip
def test_each_kind_of_line(read, line, expected):
    log, account = read(HEAD + ("   " + line + "\n") * 3)
    assert account.whole
    assert [frame(log, row) for row in range(3)] == [expected] * 3
    assert set(log.frames.time_ns.tolist()) == {START_NS + 100_000_000}
    assert log.frames.channels == ("can0",)


@pytest.mark.parametrize(
    "line",
    [
        "0.1 1  123             Rx   d 3 11 22",
        "0.1 1  123             Rx   d 1 11 22",
        "0.1 1  3FFFFFFFx       Rx   d 1 11",
        "0.1 1  800             Rx   d 1 11",
        "0.1 1  123             Rx   d 1 GG",
        "0.1 1  123             Rx   d 1 1FF",
        "0.1 1  123             Rx   d 16 " + "11 " * 16,
        "0.1 1  123             Rx   d 9 " + "11 " * 9,
        "0.1 1  123             Rx   d",
        "0.1 1  123             Rx   q 1 11",
        "0.1 1  123             Qx   d 1 11",
        "0.1 1  123             Rx   r zz",
        "0.1 12345  123         Rx   d 1 11",
        "0.1 1x  123            Rx   d 1 11",
        "0.1234567890 1 123     Rx   d 1 11",
        "12345678901.1 1 123    Rx   d 1 11",
        "x0.1 1 123 Rx d 1 11",
        "0.1 CANFD 1 Rx 123 1 0 f 64 11 22",
        "0.1 CANFD 1 Rx 123 1 0 9 9 " + "11 " * 9,
        "0.1 CANFD 1 Rx 123 1 0 2 2 11 22 0 0 xyz 0",
        "0.1 CANFD 1 Rx 123 2 0 2 2 11 22" + TAIL.format(flags=0),
        "0.1 CANFD 1 Rx",
        "0.1 CANFD x",
        "0.1 CANXL   2 Rx   CBFF   243215   176      432  msgCanCCTest1 2 2 e1 89 f1 174 00000000 00000000",
        "0.1",
        "\0\1\2",
        "1" * 4000,
        "0." + "1" * 10_000 + " 1 123 Rx d 1 11",
    ],
)
def test_a_bad_line_is_counted_and_ends_nothing(read, line):
    good = "0.1 1  123             Rx   d 1 11\n"
    log, account = read(HEAD + line + "\n" + good)
    assert (len(log.frames), account.rejected, account.truncated_at) == (1, 1, None)
    assert account.first_rejected[0].offset == len(HEAD)


def test_what_is_no_frame_is_passed_over(read):
    lines = """// version 8.2.1
internal events logged
no internal events logged
Begin Triggerblock Tue Nov 14 10:13:20.123 pm 2023
   0.000000 Start of measurement
   0.015991 CAN 1 Status:chip status error active
   1.015991 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   0.2 1 J1939TP FEE3p 6 0 0 - Rx d 23 A0 0F A6 60
   1.1 L1 30 Tx 6 00 00 00 00 00 00 checksum = 70
   1.2 SV: 2 0 1 ::Variable = 1
   1.2 _variable := 1
   1.2 // a comment
   1.2 1  OverloadFrame
   1.3 1  123             TxRq d 1 01
   1.4 CANFD 1 TxRq 123 1 0 1 1 01
End TriggerBlock

"""
    log, account = read(HEAD + lines)
    assert (len(log.frames), account.rejected, account.truncated_at) == (0, 0, None)
    assert account.passed_over == {"TxRq": 2, "event": 9}


def test_relative_stamps_count_from_the_line_before(read):
    head = "date Tue Nov 14 22:13:20 2023\nbase dec  timestamps relative\n"
    lines = (
        "0.1 1  291  Rx   d 2 16 255  Length = 1\n0.2 1  Statistic: D 0\n0.3 2  291x  Tx   d 1 7\n0.4 1 2047 TxRq d 0\n"
    )
    log, account = read(head + lines + "0.5 1 1 Rx d 0\n" + "-0.5 1 1 Rx d 0\n")
    start = 1_700_000_000_000_000_000
    assert account.start_ns == start
    assert ((log.frames.time_ns - start) // 10**8).tolist() == [1, 6, 15, 10]
    assert [frame(log, row)[:2] for row in range(2)] == [(291, False), (291, True)]
    assert log.frames.data[:2, :2].tolist() == [[16, 255], [7, 0]]
    assert log.frames.channels == ("can0", "can1")


def test_decimal_bytes_and_ids_are_checked(read):
    lines = "".join(f"0.1 1 {line}\n" for line in ("256 Rx d 1 256", "2048 Rx d 1 1", "7FF Rx d 0", "1 Rx d 1 1 22"))
    assert read("base dec  timestamps absolute\n" + lines)[1].rejected == 4


def test_stamps_before_the_trigger(read):
    log, account = read(HEAD + "-2.000000 1 123 Rx d 0\n -0.000001 1 123 Rx d 0\n0.000000001 1 123 Rx d 0\n")
    assert account.whole
    assert (log.frames.time_ns - START_NS).tolist() == [-2_000_000_000, -1000, 1]


@pytest.mark.parametrize(
    ("date", "start_ns"),
    [
        ("Tue Sep 24 10:15:30.500 am 2024", 1_727_172_930_500_000_000),
        ("Tue Sep 24 10:15:30.500 2024", 1_727_172_930_500_000_000),
        ("Die Sep 24 10:15:30 2024", 1_727_172_930_000_000_000),
        ("Tue Sep 24 12:15:30.5 am 2024", 1_727_136_930_500_000_000),
        ("Tue Sep 24 12:15:30 PM 2024", 1_727_180_130_000_000_000),
        ("Tue Sep 24 10:15:30.123456789 pm 2024", 1_727_216_130_123_456_789),
        ("Mit Mär 13 14:05:06.700 2024", 1_710_338_706_700_000_000),
        ("Mit Mai 1 00:00:00.000 2024", 1_714_521_600_000_000_000),
        ("Die Okt 1 00:00:00.000 2024", 1_727_740_800_000_000_000),
        ("Die Dez 31 23:59:59.999 1968", -31_536_000_001_000_000),
    ],
)
def test_dates(read, date, start_ns):
    for encoding in ("utf-8", "cp1252"):
        text = f"date {date}\nbase hex  timestamps absolute\n0.0 1 123 Rx d 0\n"
        log, account = read(text.encode(encoding))
        assert (account.start_ns, account.local_start, account.notes) == (start_ns, True, [])
        assert log.frames.time_ns.tolist() == [start_ns]


@pytest.mark.parametrize(
    "date", ["Tue Xyz 24 10:15:30 2024", "Tue Feb 30 10:15:30 2024", "24.9.2024", "Tue Sep 24 30:15:30 2024"]
)
def test_a_date_that_cannot_be_read_is_said(read, date):
    log, account = read(f"date {date}\n0.5 1 123 Rx d 0\n")
    assert account.start_ns is None
    assert "cannot be read" in account.notes[0]
    assert log.frames.time_ns.tolist() == [500_000_000]


def test_the_zone_is_chosen_by_who_reads(read):
    text = "date Tue Sep 24 10:15:30.500 am 2024\n0.0 1 123 Rx d 0\n"
    times = [int(read(text, ZoneInfo(zone))[0].frames.time_ns[0]) for zone in ("UTC", "Asia/Tokyo", "Europe/Berlin")]
    assert [(time - times[0]) // 3_600_000_000_000 for time in times] == [0, -9, -2]


def test_the_measurement_starts_with_the_trigger_block_that_says_so(read):
    """python-can writes the time of writing in the header, and that of the first message with the trigger block."""
    text = "date Tue Sep 24 10:15:30.500 2024\nBegin Triggerblock Mon Sep 23 10:15:30.500 2024\n"
    assert read(text + "0.0 1 1 Rx d 0\n")[1].start_ns == 1_727_172_930_500_000_000
    assert read(text + "0.000000 Start of measurement\n")[1].start_ns == 1_727_086_530_500_000_000
    only = "Begin Triggerblock Mon Sep 23 10:15:30.500 2024\n0.0 1 1 Rx d 0\n"
    assert read(only)[1].start_ns == 1_727_086_530_500_000_000


WHOLE = [
    "0.1 1 123 Rx d 2 11 22",
    "0.1 1 123 Rx d 0",
    "0.1 1 123 Rx r 4",
    "0.1 1 ErrorFrame",
    "0.1 CANFD 1 Rx 123 1 0 2 2 11 22 0 0 1000 0",
    "0.1 1 123 Rx d 2 11 22 Length",
    "End TriggerBlock",
]
OPEN = [
    "0.1 1 123 Rx d 2 11 2",
    "0.1 1 Data Rx d 1 11 Length = 1 BitCount = 64 ID = 29",
    "0.1 1 123 Rx r",
    "0.1 CANFD 1 Rx 123 1 0 2 2 11 22 0 0 1000",
    "0.1 1 123 Rx d 2 11",
    "0.1",
]


def test_a_last_line_without_an_end(read):
    for line in WHOLE:
        assert read(HEAD + line)[1].truncated_at is None
    for line in OPEN:
        assert read(HEAD + line)[1].truncated_at == len(HEAD)
    assert read("base dec\n0.1 1 123 Rx d 2 11 22")[1].truncated_at == 9


def test_cases(read, tmp_path):
    def case(name):
        return read((LOGS / name).read_bytes())

    log, _ = case("fd.asc")
    assert (len(log.frames), frame(log)[2:]) == (1, (FD | ESI, 64, bytes(range(64))))
    log, _ = case("long.asc")
    assert [frame(log, k)[2:4] for k in range(2)] == [(FD, 12), (FD, 64)]
    log, _ = case("canfd-remote.asc")
    assert [frame(log, k) for k in range(3)] == [
        (0x123, False, REMOTE | SENT, 5, b""), (0x18DAF110, True, REMOTE, 8, b""), (0x124, False, 0, 0, b""),
    ]  # fmt: skip
    assert frame(case("dlc-over-8.asc")[0])[2:] == (0, 8, bytes(range(8)))
    log, account = case("txrq.asc")
    assert (len(log.frames), account.passed_over["TxRq"], log.frames.flags.tolist()) == (2, 2, [SENT, SENT])
    assert case("channel-1.asc")[0].frames.channels == ("can0",)
    assert case("wall-clock.asc")[0].frames.time_ns.tolist() == [1_727_172_930_600_000_000]
    assert case("tz.asc")[0].frames.time_ns.tolist() == [1_736_942_401_000_000_000]
    log, account = case("cut.asc")
    assert (len(log.frames), account.rejected, account.truncated_at) == (49, 1, 3287)


@pytest.mark.parametrize("name", ["rubbish.log", "empty.asc"])
def test_what_is_no_log_is_refused(name):
    with pytest.raises(LogError), open_log(LOGS / name):
        pass


def test_a_binary_log_read_as_asc_is_all_rejected(read):
    log, account = read((LOGS / "blf.asc").read_bytes())
    assert (len(log.frames), account.rejected > 0, account.truncated_at is not None) == (0, True, True)


def some_frames(start_ns, step_ns=1000, errors=True):
    builder = FrameBuilder()
    for i in range(300):
        channel, time_ns = ("can0", "can3", "can11")[i % 3], start_ns + i * i * step_ns
        data = bytes((i * 7 + k) % 256 for k in range(64))
        flags = SENT if i % 5 == 0 else FrameFlag(0)
        kind = i % 7
        if kind == 0 and errors:
            builder.add(time_ns, channel, 0, False, b"", ERROR | flags, 0)
        elif kind == 1:
            builder.add(time_ns, channel, i, bool(i % 2), b"", REMOTE | flags, i % 9)
        elif kind < 4:
            more = (BRS if i % 2 else FrameFlag(0)) | (ESI if i % 11 < 5 else FrameFlag(0))
            builder.add(
                time_ns, channel, 0x10000 * i, True, data[: (64, 48, 12, 8, 0, 32)[i % 6]], FD | flags | more, 0
            )
        else:
            builder.add(time_ns, channel, i, bool(i % 2), data[: i % 9], flags, 0)
    assert builder.account.whole
    return builder.take()


@pytest.mark.parametrize("zone", ["UTC", "Asia/Tokyo", "America/St_Johns"])
@pytest.mark.parametrize("step_ns", [1, 1000, 999_999_937])
@pytest.mark.parametrize("start_ns", [0, -7_000_000_001, 1_700_000_000_123_456_789, 46_408_000_000_000])
def test_what_is_written_reads_back(tmp_path, start_ns, step_ns, zone):
    table, form, zone = some_frames(start_ns, step_ns), BY_NAME["asc"], ZoneInfo(zone)
    for stated in (None, start_ns + 5_000_000_321):
        facts = replace(LogFacts.of([table]), start_ns=stated)
        with (tmp_path / "w.asc").open("w+b") as file:
            form.write(file, [table.take(slice(0, 7)), table.take(slice(7, None))], facts, zone)
        log, account = read_both(tmp_path / "a.asc", (tmp_path / "w.asc").read_bytes(), "asc", zone)
        assert account.whole
        assert_equal(log.frames, kept(table, facts, form))
        assert account.start_ns == (start_ns if stated is None else stated) // 10**6 * 10**6


def test_a_start_in_the_hour_that_comes_twice_keeps_its_stamps(tmp_path):
    start_ns, zone, form = 1_729_990_800_000_000_000, ZoneInfo("Europe/Berlin"), BY_NAME["asc"]  # 02:00, the second one
    for step in range(4):
        table = some_frames(start_ns + step * 1_000_000_000_000)
        with (tmp_path / "w.asc").open("w+b") as file:
            form.write(file, [table], LogFacts.of([table]), zone)
        log, _ = read_both(tmp_path / "a.asc", (tmp_path / "w.asc").read_bytes(), "asc", zone)
        np.testing.assert_array_equal(log.frames.time_ns, table.time_ns)


def test_python_can_reads_what_is_written(tmp_path):
    table, form = some_frames(1_700_000_000_123_000_000), BY_NAME["asc"]
    with (tmp_path / "a.asc").open("w+b") as file:
        form.write(file, [table], LogFacts.of([table]), ZoneInfo("UTC"))
    with can.ASCReader(tmp_path / "a.asc") as messages:
        theirs = list(messages)
    assert len(theirs) == len(table)
    for row, message in enumerate(theirs):
        flags, length = int(table.flags[row]), int(table.length[row])
        assert message.timestamp == pytest.approx((int(table.time_ns[row]) - START_NS) / 1e9, abs=1e-9)
        assert message.is_error_frame == bool(flags & ERROR)
        if flags & ERROR:
            continue
        assert message.is_rx != bool(flags & SENT)
        assert (message.arbitration_id, message.is_extended_id) == (table.can_id[row], table.extended[row])
        assert (message.is_fd, message.bitrate_switch) == (bool(flags & FD), bool(flags & BRS))
        if not flags & FD or length:  # python-can 4.6.1 takes a CAN FD frame of 0 bytes for a remote frame
            assert (message.is_remote_frame, message.dlc) == (bool(flags & REMOTE), length)
            assert bytes(message.data) == table.data[row, : 0 if flags & REMOTE else length].tobytes()


HOSTILE = {
    "line": b"0.1 1 123 Rx d 8 " + b"11 " * 350_000,
    "ends": b"\n" * 1_000_000,
    "returns": b"0.1 1 123 Rx d 1 11\r" * 50_000,
    "number": b"9" * 1_000_000,
    "nul": b"\0" * 1_000_000,
    "blanks": b" " * 1_000_000,
    "words": b"a " * 500_000,
    "dates": b"date " + b"a " * 500_000,
    "short": b"0.1 1\n" * 170_000,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_is_answered(tmp_path, name):
    """Each takes well below a second; what is quadratic takes minutes."""
    tables, _ = read_bytes(tmp_path / "a.asc", HOSTILE[name], "asc", True)
    assert sum(len(table) for table in tables) == 0


MIXED = HEAD + "Begin Triggerblock Tue Nov 14 10:13:20.123 pm 2023\n0.000000 Start of measurement\n" + "".join(
    f"{i / 7:.6f} {line}\n"
    for i, line in enumerate(
        [
            "1  123             Rx   d 2 11 ff", "1  123x            Tx   d 8 11 22 33 44 55 66 77 88",
            "CANFD   1 Rx        4EE                  0 1 f 64 " + "01 " * 64 + TAIL.format(flags=0),
            "CANFD   2 Tx  11x  msgCanFdFr1                      1 0 a 16 " + "59 " * 16 + TAIL.format(flags=223040),
            "CANFD   1 Rx 123x  Name 0 0 e  0  " + TAIL.format(flags=10), "1 123 Rx r 4", "2 ErrorFrame",
            "1 123 TxRq d 0",
            "1 123 Rx d 2 11 22  Length = 121950 BitCount = 64 ID = 291", "1  Statistic: D 0 R 0", "CAN 1 Status:x",
            "3 7FF Rx d 9 " + "0A " * 12, "1 123 Rx d 0",
        ] * 2
    )
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("head", ["", "base dec  timestamps relative\n"])
def test_mutants(tmp_path, monkeypatch, head):
    check_mutants(tmp_path / "a.asc", (head + MIXED).encode(), "asc", 1000, 1, monkeypatch)
