from dataclasses import replace
from datetime import UTC
from pathlib import Path
from zoneinfo import ZoneInfo

import can
import pytest
from log_ways import assert_equal, check_mutants, read_both, read_bytes

from hil.log.builder import FrameBuilder
from hil.log.formats import BY_NAME
from hil.log.frames import FrameFlag, LogFacts
from hil.log.write import kept

LOGS = Path(__file__).parents[4] / "data" / "logs"
FD, BRS, ESI = FrameFlag.FD, FrameFlag.BIT_RATE_SWITCH, FrameFlag.ERROR_STATE
REMOTE, ERROR, SENT = FrameFlag.REMOTE, FrameFlag.ERROR, FrameFlag.SENT
START_NS = 1_547_553_600_000_000_000  # 43480.5 days
HEADS = {
    "1.0": ";   Start time: 15.01.2019 12:00:00.000\n",
    "1.1": ";$FILEVERSION=1.1\n;$STARTTIME=43480.5\n;   Start time: 15.01.2018 12:00:00.000.0\n",
    "1.2": ";$FILEVERSION=1.2\n;$STARTTIME=43480.5\n",
    "1.3": ";$FILEVERSION=1.3\n;$STARTTIME=43480.5\n",
    "2.0": ";$FILEVERSION=2.0\n;$STARTTIME=43480.5\n;$COLUMNS=N,O,T,I,d,l,D\n",
    "2.1": ";$FILEVERSION=2.1\n;$STARTTIME=43480.5000000000\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n",
    "2.1 l": ";$FILEVERSION=2.1\n;$STARTTIME=43480.5\n;$COLUMNS=N,O,T,B,I,d,R,l,D\n",
}


@pytest.fixture
def read(tmp_path):
    return lambda content, zone=UTC: read_both(tmp_path / "a.trc", content, "trc", zone)


def frame(log, row=0):
    frames = log.frames
    held = 0 if frames.flags[row] & REMOTE else frames.length[row]
    return (
        int(frames.can_id[row]), bool(frames.extended[row]), int(frames.flags[row]), int(frames.length[row]),
        frames.data[row, :held].tobytes(),
    )  # fmt: skip


TWO = (0x123, False, 0, 2, b"\x11\x22")
LINES = [
    ("1.0", "     1)     1059     0123  2  11 22", TWO),
    ("1.0", "     1)     1059     00000123  2  11 22", (0x123, True, 0, 2, b"\x11\x22")),
    ("1.0", "     1)     1059     0123  3  RTR", (0x123, False, REMOTE, 3, b"")),
    ("1.0", "     1)     1059     0123  0", (0x123, False, 0, 0, b"")),
    ("1.1", "     1)     1059.0  Rx         0123  2  11 22", TWO),
    ("1.1", "123456)     1059.0  Tx         0123  2  11 22 ", (0x123, False, SENT, 2, b"\x11\x22")),
    ("1.1", "     1)     1059.0  Tx         0000  8  RTR", (0, False, REMOTE | SENT, 8, b"")),
    ("1.1", "     1)     1059.0  Error      0008  4  00 19 08 08", (0, False, ERROR, 0, b"")),
    ("1.2", "     1)     1059.000 1  Rx        0123  2  11 22", TWO),
    ("1.3", "     1)     1059.000 1  Rx        0123 -  2    11 22", TWO),
    ("1.3", "     1)     1059.000 1  Rx        0123 -  15   " + "11 " * 8, (0x123, False, 0, 8, b"\x11" * 8)),
    ("2.0", "     1      1059.000 DT     0123 Rx 2  11 22", TWO),
    ("2.0", "     1      1059.000 RR     0123 Rx 2", (0x123, False, REMOTE, 2, b"")),
    (
        "2.0",
        "     1      1059.000 FB 1FFFFFFF Tx 12 " + "aB " * 12,
        (0x1FFFFFFF, True, FD | BRS | SENT, 12, b"\xab" * 12),
    ),
    ("2.1", "     1      1059.000 DT 1     0123 Rx -  2    11 22", TWO),
    ("2.1", "     1\t1059.000\tDT\t1\t0123\tRx\t-\t2\t11 22\r", TWO),
    ("2.1", "     1      1059.000 FD 1     0123 Rx -  9    " + "11 " * 12, (0x123, False, FD, 12, b"\x11" * 12)),
    ("2.1", "     1      1059.000 FE 1     0123 Rx -  15   " + "11 " * 64, (0x123, False, FD | ESI, 64, b"\x11" * 64)),
    ("2.1", "     1      1059.000 BI 1     0123 Rx -  0", (0x123, False, FD | BRS | ESI, 0, b"")),
    ("2.1", "     1      1059.000 DT 1     0123 Rx -  9    " + "11 " * 8, (0x123, False, 0, 8, b"\x11" * 8)),
    ("2.1", "     1      1059.000 RR 1     0123 Rx -  9", (0x123, False, REMOTE, 8, b"")),
    ("2.1", "     1      1059.000 ER 1        - Tx -  5    04 00 02 00 00", (0, False, ERROR | SENT, 0, b"")),
    ("2.1 l", "     1      1059.000 FD 1     0123 Rx -  12   " + "11 " * 12, (0x123, False, FD, 12, b"\x11" * 12)),
]


@pytest.mark.parametrize(("version", "line", "expected"), LINES)
def test_each_kind_of_line(read, version, line, expected):
    log, account = read(HEADS[version] + (line + "\n") * 3)
    assert account.whole
    assert [frame(log, row) for row in range(3)] == [expected] * 3
    assert set(log.frames.time_ns.tolist()) == {START_NS + 1_059_000_000}
    assert (log.frames.channels, account.start_ns, account.local_start) == (("can0",), START_NS, True)


def test_offsets_are_milliseconds_with_any_fraction(read):
    offsets = ("0", "0.1", "1059.90", "1.000001", "-2.5", "999999999999.999")
    log, account = read(HEADS["2.0"] + "".join(f"1 {offset} DT 0123 Rx 0\n" for offset in offsets))
    assert account.whole
    expected = [0, 100_000, 1_059_900_000, 1_000_001, -2_500_000, 999_999_999_999_999_000]
    assert (log.frames.time_ns - START_NS).tolist() == expected


def test_buses_are_channels(read):
    log, _ = read(HEADS["1.2"] + "".join(f"1) 1.0 {bus} Rx 0123 0\n" for bus in (1, 3, 0, 16, 3)))
    assert [log.frames.channels[c] for c in log.frames.channel] == ["can0", "can2", "can0", "can15", "can2"]


@pytest.mark.parametrize(
    ("version", "line", "kind"),
    [
        ("1.0", "     2)     1842     0008  4  ERROR 00 19 08 08", "error"),
        ("1.0", "     3)     1843 FFFFFFFF  4  00 00 00 04  BUSLIGHT", "hardware status"),
        ("1.1", "     2)     1283.2  Rx     FFFFFFFF  4  00 00 00 04   BUSLIGHT", "hardware status"),
        ("1.1", "     3)     1843.0  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY", "warning"),
        ("1.3", "     3)     1843.0 1 Warng  FFFFFFFF - 4  00 00 00 08  BUSHEAVY", "warning"),
        ("2.0", "     3      1843.0 ST      Rx 4  00 00 00 08", "hardware status"),
        ("2.1", "     3      1843.0 EC 1    - Rx - 2  00 00", "error counters"),
        ("2.1", "     3      1843.0 EV 1    user text", "event"),
    ],
)
def test_what_is_no_frame_is_passed_over(read, version, line, kind):
    log, account = read(HEADS[version] + line + "\n")
    assert (len(log.frames), account.rejected, dict(account.passed_over)) == (0, 0, {kind: 1})


@pytest.mark.parametrize(
    ("version", "line"),
    [
        ("1.1", "     1)     1059.0  Rx         0123  3  11 22"),
        ("1.1", "     1)     1059.0  Rx         0123  1  11 22"),
        ("1.1", "     1)     1059.0  Rx         0123  2  11  22"),
        ("1.1", "     1)     1059.0  Rx         0123  2  1122"),
        ("1.1", "     1)     1059.0  Rx         0800  0"),
        ("1.1", "     1)     1059.0  Rx     20000000  0"),
        ("1.1", "     1)     1059.0  Rx    000000123  0"),
        ("1.1", "     1)     1059.0  Qx         0123  0"),
        ("1.1", "     1)     1059.x  Rx         0123  0"),
        ("1.1", "     1)     1059.0  Rx         0123  16 " + "11 " * 16),
        ("1.1", "     x)     1059.0  Rx         0123  0"),
        ("1.1", "     1)"),
        ("1.1", "     1)     1059.0  Rx         0123"),
        ("1.2", "     1)     1059.0 x  Rx         0123 0"),
        ("2.0", "     1      1059.000 XX     0123 Rx 2  11 22"),
        ("2.0", "     1      1059.000 FD     0123 Rx 9  " + "11 " * 9),
        ("2.0", "     1      1059.000 RR     0123 Rx 2  11 22"),
        ("2.1", "     1      1059.000 FD 1   0123 Rx - 16  " + "11 " * 16),
        ("2.1", "     1      1059.000 FD 1   0123 Rx - 3  RTR"),
        ("2.1", "\0" * 100),
        ("2.1", "9" * 5000),
    ],
)
def test_a_bad_line_is_counted_and_ends_nothing(read, version, line):
    good = {"1": "1) 1.0 Rx 0123 0", "2": "1 1.0 DT 0123 Rx 0"}[version[0]]
    head = {"1.2": HEADS["1.2"], "2.1": HEADS["2.1"]}.get(version, HEADS[version])
    good = {"1.2": "1) 1.0 1 Rx 0123 0", "2.1": "1 1.0 DT 1 0123 Rx - 0"}.get(version, good)
    log, account = read(head + line + "\n" + good + "\n")
    assert (len(log.frames), account.rejected, account.truncated_at) == (1, 1, None)
    assert account.first_rejected[0].offset == len(head)


@pytest.mark.parametrize("days", ["1e999999", "9" * 5000, "nan", "-", "", "2000000", "1.2.3", "-9999999.5"])
def test_an_absurd_start_time_is_said(read, days):
    log, account = read(f";$FILEVERSION=1.1\n;$STARTTIME={days}\n1) 1059.9 Rx 0300 1 11\n")
    assert log.frames.time_ns.tolist() == [1_059_900_000]
    assert account.start_ns is None
    assert (len(days) > 4000) == (account.rejected == 1)
    assert account.rejected or "start time" in account.notes[0]


def test_the_zone_is_chosen_by_who_reads(read):
    text = HEADS["1.1"] + "1) 0 Rx 0123 0\n"
    times = [int(read(text, ZoneInfo(zone))[0].frames.time_ns[0]) for zone in ("UTC", "Asia/Tokyo", "Europe/Berlin")]
    assert [(time - times[0]) // 3_600_000_000_000 for time in times] == [0, -9, -1]


def test_a_last_line_without_an_end(read):
    line = "     1)     1059.0  Rx         0123  2  11 22"
    for end in range(1, len(line) - 1):
        if line[:end].strip():
            assert read(HEADS["1.1"] + line[:end])[1].truncated_at == len(HEADS["1.1"])
    assert read(HEADS["1.1"] + line)[1].truncated_at is None


def test_cases(read):
    def case(name):
        return read((LOGS / name).read_bytes())

    log, account = case("fd-types.trc")
    assert log.frames.flags.tolist() == [FD, FD | BRS, FD | ESI, FD | BRS | ESI]
    log, account = case("error-frame.trc")
    assert (log.frames.flags.tolist(), dict(account.passed_over)) == ([0, ERROR], {"hardware status": 1})
    log, account = case("version-1.0.trc")
    assert (account.rejected, log.frames.can_id.tolist(), log.frames.flags.tolist()) == (0, [1, 0x100], [0, REMOTE])
    assert account.start_ns == 1_031_760_020_682_000_000
    log, account = case("start.trc")
    assert (log.frames.time_ns.tolist(), account.rejected) == ([1_059_900_000], 0)
    log, account = case("whole.trc")
    assert (len(log.frames), account.truncated_at) == (1, None)
    assert case("tz.trc")[0].frames.time_ns.tolist() == [1_736_942_401_000_000_000]
    log, account = case("cut.trc")
    assert (len(log.frames), account.rejected, account.truncated_at) == (49, 1, 2919)


def some_frames(start_ns, step_ns=1000):
    builder = FrameBuilder()
    for i in range(300):
        channel, time_ns = ("can0", "can3", "can11")[i % 3], start_ns + i * i * step_ns
        data = bytes((i * 7 + k) % 256 for k in range(64))
        flags = SENT if i % 5 == 0 else FrameFlag(0)
        kind = i % 7
        if kind == 0:
            builder.add(time_ns, channel, 0x80, False, bytes(8), ERROR | flags, 0)
        elif kind == 1:
            builder.add(time_ns, channel, i, bool(i % 2), b"", REMOTE | flags, i % 9)
        elif kind < 4:
            more = (BRS if i % 2 else FrameFlag(0)) | (ESI if i % 11 < 5 else FrameFlag(0))
            size = (64, 48, 12, 8, 0, 32)[i % 6]
            builder.add(time_ns, channel, 0x10000 * i, True, data[:size], FD | flags | more, 0)
        else:
            builder.add(time_ns, channel, i, bool(i % 2), data[: i % 9], flags, 0)
    assert builder.account.whole
    return builder.take()


@pytest.mark.parametrize("zone", ["UTC", "Asia/Tokyo", "America/St_Johns"])
@pytest.mark.parametrize("step_ns", [1, 1000, 999_999_937])
@pytest.mark.parametrize("start_ns", [0, -7_000_000_001, -3_000_000_000_000_000_000, 1_700_000_000_123_456_789])
def test_what_is_written_reads_back(tmp_path, start_ns, step_ns, zone):
    table, form, zone = some_frames(start_ns, step_ns), BY_NAME["trc"], ZoneInfo(zone)
    for stated in (None, start_ns + 5_000_000_321):
        facts = replace(LogFacts.of([table]), start_ns=stated)
        with (tmp_path / "w.trc").open("w+b") as file:
            form.write(file, [table.take(slice(0, 7)), table.take(slice(7, None))], facts, zone)
        log, account = read_both(tmp_path / "a.trc", (tmp_path / "w.trc").read_bytes(), "trc", zone)
        assert account.whole
        assert_equal(log.frames, kept(table, facts, form))
        assert account.start_ns == (start_ns if stated is None else stated) // 10**6 * 10**6


def test_python_can_reads_what_is_written(tmp_path):
    table, form = some_frames(1_700_000_000_123_000_000), BY_NAME["trc"]
    with (tmp_path / "a.trc").open("w+b") as file:
        form.write(file, [table], LogFacts.of([table]), ZoneInfo("UTC"))
    with can.TRCReader(tmp_path / "a.trc") as messages:
        theirs = list(messages)
    rows = [row for row in range(len(table)) if not table.flags[row] & ERROR]  # it leaves error frames out
    assert len(theirs) == len(rows)
    for row, message in zip(rows, theirs, strict=True):
        flags, length = int(table.flags[row]), int(table.length[row])
        assert message.timestamp == pytest.approx(int(table.time_ns[row]) / 1e9, abs=1e-5)
        assert message.is_rx != bool(flags & SENT)
        assert (message.arbitration_id, message.is_extended_id) == (table.can_id[row], table.extended[row])
        assert (message.is_fd, message.is_remote_frame) == (bool(flags & FD), bool(flags & REMOTE))
        assert bytes(message.data) == table.data[row, : 0 if flags & REMOTE else length].tobytes()


HOSTILE = {
    "line": b"1) 1.0 Rx 0123 8 " + b"11 " * 350_000,
    "ends": b"\n" * 1_000_000,
    "returns": b"1) 1.0 Rx 0123 0\r" * 60_000,
    "number": b"9" * 1_000_000,
    "nul": b"\0" * 1_000_000,
    "blanks": b" " * 1_000_000,
    "columns": b";$COLUMNS=" + b"N," * 2000 + b"\n" + b"1 1 1\n" * 160_000,
    "starts": (b";$STARTTIME=" + b"1" * 3000 + b"\n") * 330,
    "short": b"1)\n" * 330_000,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_is_answered(tmp_path, name):
    """Each takes well below a second or two; what is quadratic takes minutes."""
    tables, _ = read_bytes(tmp_path / "a.trc", HOSTILE[name], "trc", True)
    assert sum(len(table) for table in tables) == 0


def mixed(versions):
    return "".join(
        HEADS[version] + "".join(f"{line}\n" for of, line, _ in LINES if of == version) * 2 for version in versions
    )


@pytest.mark.slow
@pytest.mark.parametrize("versions", [("1.0", "1.1", "1.2", "1.3"), ("2.0", "2.1", "2.1 l")])
def test_mutants(tmp_path, monkeypatch, versions):
    check_mutants(tmp_path / "a.trc", mixed(versions).encode(), "trc", 1000, 2, monkeypatch)


MIXED = mixed(HEADS)
