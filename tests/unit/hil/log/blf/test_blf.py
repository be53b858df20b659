import gzip
import struct
import threading
import zlib
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from blf_bytes import START_NS, classical, container, error, error_64, error_ext, fd, fd_64, file_of, marker, one

from hil.log.blf import inflate as blf_inflate
from hil.log.frames import FrameFlag, LogError
from hil.log.read import open_log
from hil.log.source import ReadOptions

DATA = Path(__file__).parents[4] / "data" / "logs"
F = FrameFlag
BRS, ESI = F.BIT_RATE_SWITCH, F.ERROR_STATE


@pytest.fixture(params=[False, True], ids=["careful", "compiled"])
def log_of(tmp_path, request):
    """The frames of a file, one tuple each, and the account."""

    def log_of(content, **options):
        path = content
        if isinstance(content, bytes):
            path = tmp_path / "a.blf"
            path.write_bytes(content)
        with open_log(path, "blf", ReadOptions(fast=request.param, **options)) as log:
            rows = [row for table in log.tables() for row in rows_of(table)]
            return rows, log.account

    return log_of


def rows_of(table):
    for i in range(len(table)):
        held = 0 if table.flags[i] & F.REMOTE else table.length[i]
        assert not table.data[i, held:].any()
        yield (
            int(table.time_ns[i]), table.channels[table.channel[i]], int(table.can_id[i]), bool(table.extended[i]),
            int(table.length[i]), table.data[i, :held].tobytes(), F(int(table.flags[i])),
        )  # fmt: skip


EIGHT, SOME = bytes(range(1, 9)), bytes(range(1, 65))


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (classical(data=EIGHT), ("can0", 0x123, False, 8, EIGHT, F(0))),
        (classical(data=EIGHT, kind=86), ("can0", 0x123, False, 8, EIGHT, F(0))),
        (classical(0x80000123, b"\7", channel=3), ("can2", 0x123, True, 1, b"\7", F(0))),
        (classical(data=b""), ("can0", 0x123, False, 0, b"", F(0))),
        (classical(data=EIGHT, channel=0), ("can0", 0x123, False, 8, EIGHT, F(0))),
        (classical(data=EIGHT, channel=300), ("can299", 0x123, False, 8, EIGHT, F(0))),
        (classical(data=EIGHT, dlc=9), ("can0", 0x123, False, 8, EIGHT, F(0))),
        (classical(data=EIGHT, dlc=15, kind=86), ("can0", 0x123, False, 8, EIGHT, F(0))),
        (classical(data=EIGHT, flags=1), ("can0", 0x123, False, 8, EIGHT, F.SENT)),
        (classical(data=EIGHT, dlc=3), ("can0", 0x123, False, 3, EIGHT[:3], F(0))),
        (classical(data=EIGHT, dlc=5, flags=0x80), ("can0", 0x123, False, 5, b"", F.REMOTE)),
        (classical(data=EIGHT, dlc=12, flags=0x81), ("can0", 0x123, False, 8, b"", F.REMOTE | F.SENT)),
        (fd(data=SOME, dlc=15, kinds=3), ("can0", 0x123, False, 64, SOME, F.FD | BRS)),
        (fd(data=SOME[:12], dlc=9, kinds=5, flags=1), ("can0", 0x123, False, 12, SOME[:12], F.FD | ESI | F.SENT)),
        (fd(data=SOME[:12], held=12), ("can0", 0x123, False, 12, SOME[:12], F.FD)),
        (fd(data=SOME[:12], held=4), ("can0", 0x123, False, 12, SOME[:4] + bytes(4) + bytes(4), F.FD)),
        (fd(data=SOME[:5], dlc=5, kinds=0), ("can0", 0x123, False, 5, SOME[:5], F(0))),
        (fd(data=SOME[:8], dlc=12, kinds=0), ("can0", 0x123, False, 8, SOME[:8], F(0))),
        (fd(data=b"", dlc=10, flags=0x80), ("can0", 0x123, False, 16, b"", F.FD | F.REMOTE)),
        (fd(data=b"", dlc=2, kinds=0, flags=0x80), ("can0", 0x123, False, 2, b"", F.REMOTE)),
        (fd(data=SOME[:10], dlc=9), ("can0", 0x123, False, 12, SOME[:10] + bytes(2), F.FD)),
        (fd_64(data=SOME[:12]), ("can0", 0x123, False, 12, SOME[:12], F.FD)),
        (fd_64(0x80000001, SOME, dlc=15, kinds=0x7000), ("can0", 1, True, 64, SOME, F.FD | BRS | ESI)),
        (fd_64(data=SOME[:8], dlc=8, kinds=0), ("can0", 0x123, False, 8, SOME[:8], F(0))),
        (fd_64(data=SOME[:8], dlc=15, kinds=0), ("can0", 0x123, False, 8, SOME[:8], F(0))),
        (fd_64(data=b"", dlc=4, kinds=0x10), ("can0", 0x123, False, 4, b"", F.REMOTE)),
        (fd_64(data=SOME[:12], direction=1), ("can0", 0x123, False, 12, SOME[:12], F.FD | F.SENT)),
        (fd_64(data=SOME[:4], valid=64, dlc=15), ("can0", 0x123, False, 64, SOME[:4] + bytes(60), F.FD)),
        (fd_64(data=SOME[:6], dlc=9), ("can0", 0x123, False, 12, SOME[:6] + bytes(6), F.FD)),
        (fd_64(data=SOME[:12], dlc=8), ("can0", 0x123, False, 8, SOME[:8], F.FD)),
        (fd_64(data=SOME[:12], valid=60, behind=EIGHT), ("can0", 0x123, False, 12, SOME[:12], F.FD)),
        (fd_64(data=b"LOBJ" + bytes(8)), ("can0", 0x123, False, 12, b"LOBJ" + bytes(8), F.FD)),
        (fd_64(data=SOME[:12], channel=255), ("can254", 0x123, False, 12, SOME[:12], F.FD)),
        (error(), ("can0", 0, False, 0, b"", F.ERROR)),
        (error_ext(0x123, EIGHT), ("can0", 0x123, False, 8, EIGHT, F.ERROR)),
        (error_ext(0x9FFFFFFF, EIGHT, dlc=0x5D), ("can0", 0x1FFFFFFF, False, 8, EIGHT, F.ERROR)),
        (error_ext(flags=0x4000), ("can0", 0x123, False, 0, b"", F.ERROR | F.SENT)),
        (error_64(data=EIGHT), ("can0", 0x123, False, 8, EIGHT, F.ERROR)),
        (error_64(data=SOME[:12], dlc=9, kinds=0xC0), ("can0", 0x123, False, 12, SOME[:12], F.ERROR | F.FD | BRS)),
        (error_64(0x80001234, flags=0x4000, kinds=0xA0),
         ("can0", 0x1234, False, 0, b"", F.ERROR | F.FD | ESI | F.SENT)),
    ],
)  # fmt: skip
def test_each_kind_of_frame(log_of, given, expected):
    for content in (given, container(given), container(given, 0), container(marker() + given) + given):
        rows, account = log_of(file_of(content))
        assert rows[0] == (START_NS, *expected)
        assert account.whole
        assert not account.notes[1:]  # only the zone
        assert set(rows) == {rows[0]}


@pytest.mark.parametrize(
    ("more", "time_ns"),
    [
        ({"stamp": 1}, 1),
        ({"stamp": -2_000_000_000}, -2_000_000_000),
        ({"stamp": 7, "unit": 1}, 70_000),
        ({"stamp": -7, "unit": 1}, -70_000),
        ({"stamp": 5, "version": 2}, 5),
        ({"stamp": 5, "unit": 1, "version": 2}, 50_000),
        ({"stamp": 2**62}, 2**62),
        ({"stamp": 2**63 - 1 - START_NS}, 2**63 - 1 - START_NS),
        ({"stamp": -(2**63)}, -(2**63)),
    ],
)
def test_stamps(log_of, more, time_ns):
    for given in (classical(**more), fd_64(**more)):
        rows, account = log_of(file_of(container(given)))
        assert [row[0] for row in rows] == [START_NS + time_ns]
        assert account.whole


@pytest.mark.parametrize(
    "bad",
    [
        classical(0x800),
        classical(0x7FFFFFFF),
        classical(dlc=16),
        classical(version=3),
        classical(stamp=2**63 - START_NS),
        classical(stamp=2**61, unit=1),
        classical(stamp=-(2**61), unit=1),
        fd_64(dlc=16),
        one(1, bytes(15)),
        one(86, bytes(15)),
        one(73, bytes(31)),
        one(100, bytes(19)),
        one(101, bytes(39)),
        one(104, bytes(43)),
        one(2, bytes(3)),
        one(1, bytes(81)),
        one(1, bytes(16), header_size=28),
        one(1, bytes(16), header_size=68),
        one(1, bytes(16), size=16),
        one(1, bytes(16), size=0),
        one(1, bytes(16), size=2**32 - 1),
        one(96, bytes(16), size=8),
        one(96, bytes(16), size=17 * 2**20),
        one(96, bytes(16))[:4] + b"\x64" + one(96, bytes(16))[5:],
        b"no object at all",
        b"LOBX" + bytes(44),
        classical(size=48 + 48),  # reaches over the next one
        marker(size=60),
    ],
    ids=lambda bad: repr(bad[8:40]),
)
@pytest.mark.parametrize("copies", [1, 30])
def test_a_bad_object_is_one_rejected_piece_and_loses_no_frame(log_of, bad, copies):
    good = classical(data=EIGHT)
    bad += bytes(-len(bad) % 4)
    for content in (container(good + (bad + good) * copies), good + (bad + good) * copies):
        rows, account = log_of(file_of(content))
        assert len(rows) == 1 + copies
        assert account.rejected == copies
        assert len(account.first_rejected) == min(copies, 10)
        assert account.first_rejected[0].offset == (144 if content[12] == 10 else 144 + 48)
        assert account.truncated_at is None


def test_what_is_no_frame_is_counted_by_type(log_of):
    content = (
        marker() * 3 + classical() + one(72, bytes(40)) + one(300, bytes(8)) + one(256, bytes(8)) + one(3, bytes(8))
    )
    content += classical(flags=2) + fd_64(direction=2) + one(10, bytes(16))
    rows, account = log_of(file_of(container(content)))
    assert len(rows) == 1
    assert account.whole
    assert account.passed_over == {
        "objects of type 96": 3, "objects of type 72": 1, "objects of unknown type": 2, "objects of type 3": 1,
        "requests to send": 2, "objects of type 10": 1,
    }  # fmt: skip


@pytest.mark.parametrize("size", [1, 7, 47, 48, 49, 100, 131])
@pytest.mark.parametrize("method", [0, 2])
def test_objects_cross_containers(log_of, size, method):
    objects = b"".join(
        classical(can_id=i, data=bytes([i]), stamp=i)
        + fd_64(i, bytes(13)[: i % 8], dlc=i % 8, kinds=0)
        + bytes(i % 8 % 4)
        for i in range(40)
    )
    pieces = [container(objects[at : at + size], method) for at in range(0, len(objects), size)]
    rows, account = log_of(file_of(*pieces))
    assert account.whole
    assert [row[2] for row in rows] == [i for i in range(40) for _ in range(2)]


@pytest.mark.parametrize("padding", range(8))
def test_padding_up_to_seven_bytes(log_of, padding):
    objects = (classical() + b"\0" * padding) * 3
    stored = container(classical() * 3, 0)
    for content in (objects, container(objects), stored + b"\0" * padding + stored):
        rows, account = log_of(file_of(content, size=0))
        assert account.rejected == 0
        assert len(rows) in (3, 6)


def damaged(packed):
    half = len(packed) // 2
    return packed[:half] + bytes([packed[half] ^ 0x55]) + packed[half + 1 :]


NOISE = b"".join(classical(data=np.random.default_rng(i).bytes(8), stamp=i) for i in range(50))


PART = NOISE[164:1000]  # torn objects at both ends


@pytest.mark.parametrize(
    ("bad", "kept"),
    [
        (container(PART, packed=damaged(zlib.compress(PART))), 0),
        (container(PART, size=100), 0),
        (container(PART, size=2**32 - 1), 0),
        (container(PART, 1), 0),
        (container(PART, packed=zlib.compress(PART)[:-4]), 17),
        (container(PART, 0, size=len(PART) + 48), 17),
        (one(10, b"", header_size=16, size=20)[:20], 0),
    ],
    ids=["damaged", "too-small", "huge", "unknown", "short", "short-stored", "no-header"],
)
def test_a_damaged_container_is_one_rejected_piece(log_of, bad, kept):
    first = container(NOISE[:164])
    rows, account = log_of(file_of(first, bad, container(NOISE[1000:])))
    assert account.rejected == 1
    assert account.first_rejected[0].offset == 144 + len(first)
    assert account.truncated_at is None
    assert [row[0] - START_NS for row in rows] == [*range(3), *range(3, 3 + kept), *range(21, 50)]


@pytest.mark.parametrize("stated", [4, -4, 100, 10_000_000, 63 * 2**20])
def test_a_container_of_wrong_size_loses_nothing(log_of, stated):
    packed = container(NOISE)
    wrong = packed[:8] + struct.pack("<L", struct.unpack_from("<L", packed, 8)[0] + stated) + packed[12:]
    rows, account = log_of(file_of(packed, wrong, packed, packed))
    assert len(rows) >= 150 + (0 if stated == -4 else 50)
    assert account.rejected <= 2


def test_a_deflate_bomb_ends_at_the_stated_size(log_of, monkeypatch):
    bomb = container(bytes(20_000_000), size=1000)
    rows, account = log_of(file_of(container(classical()), bomb, container(classical())))
    assert (len(rows), account.rejected) == (2, 1)
    monkeypatch.setattr(blf_inflate, "FREE_BYTES", 100_000)
    monkeypatch.setattr(blf_inflate, "MAX_RATIO", 2)
    rows, account = log_of(
        file_of(container(classical()), *[container(classical() * 20_000)] * 3, container(classical()))
    )
    assert account.rejected == 3
    assert len(rows) == 2


@pytest.mark.parametrize("cut", range(1, 48 * 3, 5))
def test_a_cut_log_keeps_all_whole_frames(log_of, cut):
    for content in (classical() * 3, container(classical() * 3, 0)):
        rows, account = log_of(file_of(content[: len(content) - cut], size=1000))
        head = len(content) - 48 * 3
        left = 48 * 3 - cut
        assert len(rows) == left // 48
        assert account.truncated_at == (144 if head else 144 + left // 48 * 48 if left % 48 > 3 else 144 + left)
        assert account.rejected == (left % 48 >= 16)


def test_a_log_cut_at_each_byte(log_of):
    whole = file_of(container(NOISE[:1200]), container(NOISE[1200:]))
    for at in range(150, len(whole) - 3, 7):
        rows, account = log_of(whole[:at])
        assert len(rows) <= 50
        assert account.truncated_at is not None
        assert account.rejected <= 1


def test_a_killed_writer_is_noted(log_of):
    rows, account = log_of(file_of(container(classical()), size=144))
    assert len(rows) == 1
    assert account.truncated_at is not None
    assert "killed" in account.notes[0]
    rows, account = log_of(file_of(container(classical()), size=5000))
    assert account.truncated_at == 144 + len(container(classical()))


@pytest.mark.parametrize("content", [b"", b"LOGG", b"LOGG" + bytes(60), b"LOG" + bytes(200), b"LOBJ" + bytes(200)])
def test_no_blf_file(log_of, content):
    with pytest.raises(LogError):
        log_of(content)


def test_a_header_alone_holds_nothing(log_of):
    rows, account = log_of(file_of())
    assert (rows, account.whole) == ([], True)


@pytest.mark.parametrize("header_size", [72, 100, 144, 200])
def test_header_sizes(log_of, header_size):
    rows, account = log_of(file_of(container(classical()), header_size=header_size))
    assert (len(rows), account.whole) == (1, True)


def test_start_time_is_a_wall_clock(log_of):
    tokyo = ZoneInfo("Asia/Tokyo")
    rows, account = log_of(file_of(classical()), timezone=tokyo)
    assert rows[0][0] == account.start_ns == START_NS - 9 * 3_600_000_000_000
    assert account.local_start
    assert account.notes == ["start time taken as Asia/Tokyo (the log names no zone)"]


@pytest.mark.parametrize(
    "start", [(0,) * 8, (2024, 13, 0, 1, 0, 0, 0, 0), (9999, 1, 0, 1, 0, 0, 0, 0), (1601, 1, 0, 1, 0, 0, 0, 0)]
)
def test_no_start_time(log_of, start):
    rows, account = log_of(file_of(classical(stamp=5), start=start))
    assert rows[0][0] == 5
    assert (account.start_ns, account.local_start) == (None, False)
    assert account.notes == (
        ["the start time in the header cannot be read: stamps count from 1970"] if any(start) else []
    )


def test_channels_are_numbered_as_they_come(log_of):
    rows, _ = log_of(file_of(container(b"".join(classical(channel=c) for c in (9, 1, 0, 9, 2, 1)))))
    assert [row[1] for row in rows] == ["can8", "can0", "can0", "can8", "can1", "can0"]


def test_more_data_bytes_in_the_middle_of_a_table(log_of):
    rows, _ = log_of(file_of(container(classical(data=EIGHT) * 5 + fd(data=SOME, dlc=15) + classical(data=EIGHT))))
    assert [row[5] for row in rows] == [EIGHT] * 5 + [SOME, EIGHT]


CASES = {
    "errkinds.blf": [(1_000_000, 0x123, 2, 0), (1_500_000, 0, 0, 2), (1_600_000, 0, 8, 2), (2_000_000, 0x123, 2, 0)],
    "dlc13.blf": [(1_000_000, 0x123, 8, 0), (2_000_000, 0x124, 8, 0), (3_000_000, 0x125, 8, 0)],
    "dlc13only.blf": [(2_000_000, 0x124, 8, 0)],
    "e.blf": [(1_000_000, 0x123, 0, 2)],
    "blf.asc": [(0, 0x123, 2, 0)],
    "channel-1.blf": [(10, 0x123, 2, 0)],
    "dlc-over-8.blf": [(10, 0x123, 8, 0), (20, 0x123, 8, 0), (30, 0xFF, 8, 2)],
    "error-frames.blf": [(10, 0x123, 2, 0), (20, 0, 0, 2), (30, 0x123, 8, 2), (40, 0, 0, 2)],
    "nanoseconds.blf": [(456789, 0x123, 2, 0), (10457110, 0x123, 2, 0), (20457431, 0x123, 2, 0),
                        (30457752, 0x123, 2, 0)],
    "pre-trigger.blf": [(-2_000_000_000, 0x123, 2, 0), (-1_000_000, 0x123, 2, 0), (1_000_000, 0x123, 2, 0)],
    "wall-clock.blf": [(100_000_000, 0x123, 1, 0)],
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_what_other_tools_wrote(log_of, name):
    rows, account = log_of(DATA / name)
    assert [(row[0] - account.start_ns, row[2], row[4], int(row[6])) for row in rows] == CASES[name]
    assert {row[1] for row in rows} == {"can0"}
    assert account.whole


def test_a_cut_container_keeps_its_frames(log_of):
    rows, account = log_of(DATA / "cut.blf")
    assert (len(rows), account.truncated_at, account.rejected) == (355, 144, 1)


def test_small_logs_are_read_without_the_compiled_pass_and_large_ones_with_it(tmp_path, monkeypatch):
    from hil.log.blf.objects import ObjectStream

    used = []
    original = ObjectStream._pass
    monkeypatch.setattr(ObjectStream, "_pass", lambda self, *a: used.append(1) or original(self, *a))
    path = tmp_path / "a.blf"
    for copies, compiled in ((100, False), (20_000, True)):
        path.write_bytes(file_of(container(classical() * copies)))
        with open_log(path) as log:
            assert sum(map(len, log.tables())) == copies
        assert bool(used) == compiled


@pytest.mark.parametrize(
    "bad",
    [container(NOISE, packed=damaged(zlib.compress(NOISE))), container(NOISE, size=100), container(NOISE)[:-100]],
    ids=["damaged", "too-small", "cut"],
)
def test_without_isal_the_frames_are_the_same(log_of, monkeypatch, bad):
    content = file_of(container(NOISE), bad, container(NOISE))
    rows, account = log_of(content)
    monkeypatch.setattr(blf_inflate, "INFLATE", zlib)
    again, other = log_of(content)
    assert rows[:50] == again[:50]
    assert rows[-50:] == again[-50:]
    assert (account.rejected, account.truncated_at) == (other.rejected, other.truncated_at)


def test_packed_with_gzip_and_limited(tmp_path):
    path = tmp_path / "a.blf.gz"
    content = file_of(container(NOISE), container(NOISE), container(NOISE))
    path.write_bytes(gzip.compress(content))
    with open_log(path) as log:
        assert log.format.name == "blf"
        assert (len(log.frames()), log.account.whole) == (150, True)
    limit = 144 + len(container(NOISE)) + 100
    with open_log(path, limit_bytes=limit) as log:
        assert 50 <= len(log.frames()) < 100
        assert log.account.truncated_at == limit


def test_reading_may_end_early(tmp_path):
    path = tmp_path / "a.blf"
    path.write_bytes(file_of(*[container(classical() * 3000)] * 60))
    threads = threading.active_count()
    with open_log(path) as log:
        tables = log.tables()
        assert len(next(tables)) == 65_536
        tables.close()
    assert threading.active_count() == threads
    with open_log(path) as log:
        assert len(log.frames()) == 180_000


def test_a_log_of_many_tables_has_one_channel_numbering(tmp_path):
    path = tmp_path / "a.blf"
    content = b"".join(classical(channel=1 + k // 1000 % 200, can_id=k % 2048, stamp=k) for k in range(140_000))
    path.write_bytes(file_of(*(container(content[at : at + 131_072]) for at in range(0, len(content), 131_072))))
    with open_log(path) as log:
        frames = log.frames()
    assert frames.time_ns.tolist() == list(range(START_NS, START_NS + 140_000))
    assert (frames.can_id == np.arange(140_000) % 2048).all()
    assert [frames.channels[i] for i in frames.channel[::1000]] == [f"can{k}" for k in range(140)]
