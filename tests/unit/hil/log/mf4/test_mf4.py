import struct
import zlib
from dataclasses import replace
from datetime import UTC
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from mdf_made import Cg, Cn, Made, frame, record, time

from hil.log.formats import BY_NAME
from hil.log.frames import FD_CODES, FrameFlag, FrameTable, LogError, LogFacts
from hil.log.mf4 import mf4
from hil.log.mf4 import packed as mdf_packed
from hil.log.mf4 import unsorted as mdf_unsorted
from hil.log.read import open_log
from hil.log.source import ReadOptions
from hil.log.write import kept, write_tables

LOGS = Path(__file__).parents[4] / "data" / "logs"
START = 1_700_000_000_123_456_789
KINDS = ("CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame")


@pytest.fixture
def read(tmp_path):
    """Reads bytes or a path; the account and the frames."""

    def read(content, **options):
        path = content
        if not isinstance(content, Path):
            path = tmp_path / "made.mf4"
            path.write_bytes(bytes(content))
        with open_log(path, "mf4", ReadOptions(**options)) as log:
            frames = log.frames()
        return log.account, frames

    return read


def some_frames(n=1000, kinds="classical", seed=1, channels=3):
    rng = np.random.default_rng(seed)
    fd = "fd" in kinds
    table = FrameTable.empty(n, 64 if fd else 8, tuple(f"can{i}" for i in range(channels)))
    table.time_ns[:] = START + np.cumsum(rng.integers(0, 400_000, n))
    table.channel[:] = rng.integers(0, channels, n)
    table.channel[:channels] = np.arange(channels)[:n]
    table.extended[:] = rng.random(n) < 0.4
    table.can_id[:] = np.where(table.extended, rng.integers(0, 2**29, n), rng.integers(0, 2**11, n))
    table.length[:] = rng.integers(0, 9, n)
    table.flags[:] = np.where(rng.random(n) < 0.3, int(FrameFlag.SENT), 0)
    if fd:
        is_fd = rng.random(n) < 0.5
        table.length[is_fd] = rng.choice(FD_CODES, is_fd.sum())
        table.flags[is_fd] |= np.uint8(FrameFlag.FD)
        table.flags[is_fd & (rng.random(n) < 0.5)] |= np.uint8(FrameFlag.BIT_RATE_SWITCH)
        table.flags[is_fd & (rng.random(n) < 0.2)] |= np.uint8(FrameFlag.ERROR_STATE)
    if "remote" in kinds:
        remote = (rng.random(n) < 0.1) & ((table.flags & FrameFlag.FD) == 0)
        table.flags[remote] |= np.uint8(FrameFlag.REMOTE)
    if "error" in kinds:
        error = (rng.random(n) < 0.1) & ((table.flags & (FrameFlag.FD | FrameFlag.REMOTE)) == 0)
        table.flags[error] |= np.uint8(FrameFlag.ERROR)
        table.extended[error] = False
        table.can_id[error] = rng.integers(0, 2**29, error.sum())
    table.data[:] = rng.integers(0, 256, table.data.shape)
    table.data[np.arange(table.data.shape[1]) >= table.length[:, None]] = 0
    table.data[(table.flags & FrameFlag.REMOTE) != 0] = 0
    return table


def write(frames, path, start_ns=None):
    facts = replace(LogFacts.of([frames]), start_ns=start_ns)
    write_tables([frames], facts, path, BY_NAME["mf4"])
    return kept(frames, facts, BY_NAME["mf4"])


def of_kind(frames, k):
    return frames.take((frames.flags & 3) == k)


def assert_equal(got, wanted):
    assert len(got) == len(wanted)
    for column in ("time_ns", "can_id", "extended", "length", "flags"):
        np.testing.assert_array_equal(getattr(got, column), getattr(wanted, column), column)
    names = [np.array(t.channels or ("",))[t.channel] for t in (got, wanted)]
    np.testing.assert_array_equal(*names)
    np.testing.assert_array_equal(got.widened(64).data, wanted.widened(64).data)


def rows(frames):
    """One tuple a frame: time, channel, id, extended, flags, data."""
    return [
        (t, frames.channels[c], i, x, f, d[:n].tobytes() if not f & 1 else n)
        for t, c, i, x, n, d, f in zip(
            frames.time_ns.tolist(), frames.channel.tolist(), frames.can_id.tolist(), frames.extended.tolist(),
            frames.length.tolist(), frames.data, frames.flags.tolist(), strict=True,
        )
    ]  # fmt: skip


# -- cases -----------------------------------------------------------------------------------------------------------


def test_fd_frames_without_a_length_have_that_of_their_code(read):
    account, frames = read(LOGS / "fd.mf4")
    assert account.whole
    assert frames.length.tolist() == [64, 12]
    assert frames.flags.tolist() == [4, 4]
    assert frames.data[1, :13].tolist() == [*range(12), 0]
    assert frames.time_ns.tolist() == [1746165600100000000, 1746165600200000000]


def test_bus_channel_1_is_can0(read):
    account, frames = read(LOGS / "channel-1.mf4")
    assert account.whole
    assert rows(frames) == [(1727172930000000010, "can0", 0x123, False, 0, b"\x01\x02")]


# -- our files -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kinds", ["classical", "classical remote error", "fd", "fd remote error"])
@pytest.mark.parametrize("n", [0, 1, 5000])
def test_what_is_written_reads_back_equal(tmp_path, read, kinds, n, monkeypatch):
    monkeypatch.setattr("hil.log.mf4.frames.BLOCK_BYTES", 4096)  # many blocks, several lists
    frames = some_frames(n, kinds) if n else FrameTable.empty()
    wanted = write(frames, tmp_path / "a.mf4")
    account, got = read(tmp_path / "a.mf4")
    assert account.whole
    assert account.notes == []
    assert account.start_ns == (int(frames.time_ns.min()) if n else 0)
    for k in (0, 1, 2):
        assert_equal(of_kind(got, k), of_kind(wanted, k))
    assert (np.diff(got.time_ns) >= 0).all()


@pytest.mark.parametrize("start_ns", [0, 1, START + 2_000_000_000, 4_102_444_800_999_999_999])
def test_start_time_and_stamps_before_it_are_kept_to_the_nanosecond(tmp_path, read, start_ns):
    frames = some_frames(50)
    write(frames, tmp_path / "a.mf4", start_ns)
    account, got = read(tmp_path / "a.mf4")
    assert account.start_ns == start_ns
    np.testing.assert_array_equal(got.time_ns, frames.time_ns)


def test_stamps_that_run_back_stay_in_place(tmp_path, read):
    frames = some_frames(100, "classical remote")
    frames.time_ns[50] -= 10**9
    wanted = write(frames, tmp_path / "a.mf4")
    _, got = read(tmp_path / "a.mf4")
    for k in (0, 1):
        assert_equal(of_kind(got, k), of_kind(wanted, k))


@pytest.mark.parametrize("kinds", ["classical remote error", "fd remote error"])
def test_python_can_reads_what_we_write(tmp_path, kinds):
    import can

    frames = some_frames(400, kinds)
    write(frames, tmp_path / "a.mf4")
    with can.LogReader(tmp_path / "a.mf4") as reader:
        messages = list(reader)
    assert len(messages) == len(frames)
    wanted = np.concatenate([np.flatnonzero((frames.flags & 3) == k) for k in (0, 1, 2)])
    kind = [2 if m.is_error_frame else int(m.is_remote_frame) for m in messages]
    for k, row in zip(np.argsort(kind, kind="stable"), wanted.tolist(), strict=True):
        m, flags, length = messages[k], int(frames.flags[row]), int(frames.length[row])
        assert abs(m.timestamp - frames.time_ns[row] / 1e9) < 2e-6
        assert (m.channel, m.arbitration_id) == (frames.channel[row] + 1, frames.can_id[row])
        assert m.is_extended_id == frames.extended[row]
        assert (m.is_rx, m.is_remote_frame, m.is_error_frame) == (not flags & 32, bool(flags & 1), bool(flags & 2))
        assert (m.is_fd, m.bitrate_switch, m.error_state_indicator) == tuple(bool(flags & b) for b in (4, 8, 16))
        assert m.dlc == length if flags & 1 else bytes(m.data) == frames.data[row, :length].tobytes()


def test_asammdf_reads_what_we_write(tmp_path):
    import asammdf

    frames = some_frames(3000, "fd remote error")
    write(frames, tmp_path / "a.mf4", START)
    dbc = tmp_path / "a.dbc"
    dbc.write_text('VERSION ""\nBU_: A\nBO_ 291 M: 2 A\n SG_ S : 0|16@1+ (0.5,1) [0|0] "km" A\n')
    frames.can_id[:900:3], frames.extended[:900:3] = 291, False
    frames.length[:900:3] = 8
    write(frames, tmp_path / "a.mf4", START)
    data = of_kind(frames, 0)
    with asammdf.MDF(tmp_path / "a.mf4") as mdf:
        assert round(mdf.header.start_time.timestamp()) == START // 10**9
        frame = mdf.get("CAN_DataFrame")
        np.testing.assert_allclose(frame.timestamps * 1e9, data.time_ns - START, atol=1)
        np.testing.assert_array_equal(frame["CAN_DataFrame.ID"], data.can_id)
        np.testing.assert_array_equal(frame["CAN_DataFrame.DataBytes"], data.data)
        with mdf.extract_bus_logging({"CAN": [(str(dbc), 1)]}) as signals:  # of channel 1
            signal = signals.get("S")
    mine = data.take((data.can_id == 291) & ~data.extended & (data.channel == 0))
    raw = mine.data[:, 0] + 256.0 * mine.data[:, 1]
    np.testing.assert_allclose(signal.samples, raw * 0.5 + 1)
    assert signal.unit == "km"


# -- files of others -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kinds", ["classical remote error", "fd"])
def test_what_python_can_writes(tmp_path, read, kinds):
    import can

    frames = some_frames(200, kinds, channels=2)
    frames.extended[(frames.flags & 2) != 0] = True  # it keeps the identifier of an error frame
    writer = can.MF4Writer(tmp_path / "a.mf4")
    for t, channel, i, x, f, d in rows(frames):
        writer(
            can.Message(
                timestamp=t / 1e9, channel=channel, arbitration_id=i, is_extended_id=x, is_rx=not f & 32,
                is_remote_frame=bool(f & 1), is_error_frame=bool(f & 2), is_fd=bool(f & 4), bitrate_switch=bool(f & 8),
                error_state_indicator=bool(f & 16), data=None if f & 1 else d, dlc=d if f & 1 else len(d),
            )
        )  # fmt: skip
    writer.stop()
    account, got = read(tmp_path / "a.mf4")
    assert account.rejected == 0
    assert got.channels == ("can0", "can1")  # it counts from 0
    frames.extended[(frames.flags & 2) != 0] = False
    for k in (0, 1, 2):
        mine, theirs = of_kind(frames, k), of_kind(got, k)
        np.testing.assert_allclose(theirs.time_ns, mine.time_ns, rtol=0, atol=2000)
        assert [r[1:] for r in rows(theirs)] == [r[1:] for r in rows(mine)]


@pytest.mark.parametrize("version", ["4.00", "4.10", "4.11", "4.20"])
@pytest.mark.parametrize("compression", [0, 1, 2])
def test_what_asammdf_saves(tmp_path, read, version, compression):
    import asammdf

    frames = some_frames(3000, "fd remote error")
    write(frames, tmp_path / "a.mf4")
    with asammdf.MDF(tmp_path / "a.mf4") as mdf, mdf.convert(version) as converted:
        converted.configure(write_fragment_size=4096)
        converted.save(tmp_path / "b.mf4", compression=compression)
    account, got = read(tmp_path / "b.mf4")
    assert account.rejected == 0
    got.time_ns[:] += frames.time_ns[0] - account.start_ns  # it keeps the start time as a floating-point number
    for k in (0, 1, 2):
        assert_equal(of_kind(got, k), of_kind(frames, k))


# -- layouts made by hand --------------------------------------------------------------------------------------------


def plain(n=300, width=8, seed=3):
    """Rows (time ns, channel number, id, extended, sent, fd bits, data) of plain records."""
    rng = np.random.default_rng(seed)
    lengths = FD_CODES if width == 64 else range(9)
    made, t = [], 0
    for _ in range(n):
        t += int(rng.integers(1, 10**6)) * 1000
        extended = bool(rng.random() < 0.3)
        size = int(rng.choice(lengths))
        fd = 1 | int(rng.integers(0, 4)) << 1 if size > 8 or (width == 64 and rng.random() < 0.5) else 0
        can_id = int(rng.integers(0, 2**29 if extended else 2**11))
        channel, sent = int(rng.integers(1, 4)), bool(rng.random() < 0.3)
        made.append((t, channel, can_id, extended, sent, fd, rng.integers(0, 256, size, np.uint8).tobytes()))
    return made


def records(made, width=8):
    return [
        record(t / 1e9, c, i, d, width, extended=x, sent=s, fd=fd) for t, c, i, x, s, fd, d in made
    ]  # fmt: skip


def expected(made, start_ns=START, kind=0):
    return [(start_ns + t, f"can{c - 1}", i, x, fd << 2 | s << 5 | kind, d) for t, c, i, x, s, fd, d in made]


def simple(made, width=8, start_ns=START, **facts):
    """A file of one sorted group, its data not yet entered."""
    file = Made(start_ns=start_ns, **facts)
    group = Cg([time(), frame(width=width)], 15 + width, len(made))
    dg, _, _ = file.group([group])
    return file, dg + 24 + 16


@pytest.mark.parametrize("way", ["plain", "deflate", "transposed"])
@pytest.mark.parametrize("piece", [None, 1000, 23 * 10])
@pytest.mark.parametrize("equal", [False, True])
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("held", [True, False])
def test_each_way_of_storing(read, way, piece, equal, width, held, monkeypatch):
    if not held:  # as blocks too large for the memory are
        monkeypatch.setattr(mdf_packed, "WHOLE_BYTES", 0)
        monkeypatch.setattr(mdf_packed, "INPUT_BYTES", 64)
        monkeypatch.setattr(mdf_packed, "inflater", zlib.decompressobj)
    made = plain(width=width)
    file, link = simple(made, width)
    file.patch(link, file.data(b"".join(records(made, width)), piece, way, 15 + width, equal))
    account, frames = read(file)
    assert account.whole
    assert rows(frames) == expected(made)


@pytest.mark.parametrize("id_bytes", [1, 2, 4, 8])
@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("piece", [None, 700])
def test_unsorted_groups_with_values_in_a_group_of_their_own(read, id_bytes, compiled, piece, monkeypatch):
    monkeypatch.setattr(mdf_unsorted, "BLOCK_BYTES", 1000)
    file, made = unsorted(id_bytes, piece)
    account, frames = read(file, fast=compiled)
    assert account.whole
    assert account.passed_over == {"LIN groups": 1}
    assert rows(frames) == made


def test_asammdf_agrees_on_an_unsorted_file(tmp_path, read):
    import asammdf

    file, _ = unsorted(n=60)
    (tmp_path / "u.mf4").write_bytes(bytes(file))
    _, frames = read(tmp_path / "u.mf4")
    frames = of_kind(frames, 0)
    with asammdf.MDF(tmp_path / "u.mf4") as mdf:
        theirs = mdf.get("CAN_DataFrame")
        np.testing.assert_array_equal(theirs["CAN_DataFrame.ID"], frames.can_id)
        np.testing.assert_array_equal(theirs["CAN_DataFrame.DataBytes"], frames.data)
        np.testing.assert_allclose(theirs.timestamps * 1e9, frames.time_ns - START, atol=1)


def unsorted(id_bytes=1, piece=None, unfinalised=None, offsets=True, n=300, way="plain"):
    """Data frames whose values stand in a group of their own, remote frames and LIN, all in one stream."""
    made, remote = plain(n, 64), plain(n // 3, seed=5)
    file = Made(start_ns=START, unfinalised=unfinalised)
    open_end = unfinalised is not None
    groups = [
        Cg([time(), frame(payload="vlsd")], 23, 0 if open_end else len(made), 1),
        Cg([], 0 if open_end else sum(4 + len(row[-1]) for row in made), 0 if open_end else len(made), 2, flags=1),
        Cg([time(), frame("CAN_RemoteFrame", payload="none", prefix=False)], 15, 0 if open_end else len(remote), 200),
        Cg([time(), Cn("LIN_Frame", 8, 0, 8)], 9, 0 if open_end else 10, 7),
    ]
    dg, places, channels = file.group(groups, 0, id_bytes)
    file.patch(channels[0]["CAN_DataFrame.DataBytes"] + 24 + 5 * 8, places[1])

    def ident(number):
        return number.to_bytes(id_bytes, "little")

    pieces, at = [], 0
    for t, c, i, x, s, fd, d in made:
        value = struct.pack("<I", len(d)) + d
        head = record(t / 1e9, c, i, at if offsets else 0, None, extended=x, sent=s, fd=fd, length=len(d))
        pieces.append((t, ident(1) + head + ident(2) + value))
        at += len(value)
    for t, c, i, x, s, _, d in remote:
        pieces.append((t, ident(200) + record(t / 1e9, c, i, b"", 0, extended=x, sent=s, dlc=len(d), length=len(d))))
    pieces += [(k * 10**7, ident(7) + bytes(9)) for k in range(10)]
    pieces.sort(key=lambda p: p[0])
    content = b"".join(p for _, p in pieces)
    file.patch(dg + 24 + 16, file.data(content, piece, way))
    wanted = expected(made)
    wanted += [(*row[:5], len(row[5])) for row in expected(remote, kind=1)]
    return file, sorted(wanted, key=lambda row: (row[0], row[4] & 1))


@pytest.mark.parametrize("way", ["plain", "deflate"])
@pytest.mark.parametrize("piece", [None, 500])
def test_values_in_signal_data(read, way, piece):
    made = plain(width=64)
    file = Made(start_ns=START)
    values = b"".join(struct.pack("<I", len(row[-1])) + row[-1] for row in made)
    at = np.cumsum([0] + [4 + len(row[-1]) for row in made]).tolist()
    data = file.data(values, piece, way, ident=b"SD")
    heads = [
        record(t / 1e9, c, i, offset, None, extended=x, sent=s, fd=fd, length=len(d))
        for (t, c, i, x, s, fd, d), offset in zip(made, at, strict=False)
    ]
    group = Cg([time(), frame(payload="vlsd", data=data)], 23, len(made))
    file.group([group], file.data(b"".join(heads)))
    account, frames = read(file)
    assert account.whole
    assert rows(frames) == expected(made)


def test_a_value_that_is_not_there_is_rejected(read):
    file = Made(start_ns=START)
    data = file.data(struct.pack("<I", 3) + b"abc", ident=b"SD")
    heads = [record(0.5, 1, 0x10, at, None, length=3) for at in (0, 2, 5, 2**60)]
    file.group([Cg([time(), frame(payload="vlsd", data=data)], 23, 4)], file.data(b"".join(heads)))
    account, frames = read(file)
    assert account.rejected == 3
    assert [row[-1] for row in rows(frames)] == [b"abc"]


@pytest.mark.parametrize("payload", ["fixed", "mlsd"])
@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("prefix", [False, True])
def test_members_of_any_order_of_bytes_with_or_without_prefix(read, payload, big, prefix):
    members = [("BusChannel", 8, 0, 16), ("ID", 10, 0, 32), ("IDE", 14, 7, 1), ("DataLength", 15, 0, 24)]
    channel = frame(members=members, payload=payload, prefix=prefix, data_byte=18)
    for member in channel.members[:-1]:
        member.data_type = int(big)
    order = ">" if big else "<"
    raw = struct.pack(f"{order}dHIB", 1.25, 2, 0x18FEF100, 0x80)
    raw += (3).to_bytes(3, "big" if big else "little") + b"abc\xff\xff\xff\xff\xff"
    file = Made(start_ns=START)
    file.group([Cg([time(data_type=5 if big else 4), channel], 26, 1)], file.data(raw))
    account, frames = read(file)
    assert account.whole
    assert rows(frames) == [(START + 1_250_000_000, "can1", 0x18FEF100, True, 0, b"abc")]


def test_members_that_are_missing_have_defaults(read):
    channel = frame(members=[("ID", 8, 0, 32), ("DLC", 12, 0, 4)], data_byte=13)
    raw = b"".join(
        struct.pack("<dIB", t, i, dlc) + b"12345678"
        for t, i, dlc in ((1, 0x7FF, 3), (2, 0x8000_0001, 15), (3, 0x800, 8))
    )
    file = Made(start_ns=START)
    file.group([Cg([time(), channel], 21, 3)], file.data(raw))
    account, frames = read(file)
    assert account.whole
    assert [row[1:] for row in rows(frames)] == [
        ("can0", 0x7FF, False, 0, b"123"),
        ("can0", 1, True, 0, b"12345678"),
        ("can0", 0x800, True, 0, b"12345678"),
    ]


def test_the_name_of_a_group_tells_its_channel_where_its_frames_do_not(read):
    file = Made(start_ns=START)
    raw = struct.pack("<dIB8s", 1, 0x10, 1, b"1")
    for name in ("CAN2", "CAN 3 Data", "Scan4", ""):
        channel = frame(members=[("ID", 8, 0, 32), ("DLC", 12, 0, 4)], data_byte=13)
        _, places, _ = file.group([Cg([time(), channel], 21, 1)], file.data(raw))
        file.patch(places[0] + 24 + 16, file.text(name))
    account, frames = read(file)
    assert account.whole
    assert [row[1] for row in rows(frames)] == ["can1", "can2", "can0", "can0"]


def test_a_constant_bus_channel_is_a_virtual_channel(read):
    channel = frame(members=[("ID", 8, 0, 32), ("DLC", 12, 0, 4)], data_byte=13)
    channel.members.append(Cn("CAN_DataFrame.BusChannel", 0, 0, 0, kind=6, linear=(3.0, 0.0)))
    file = Made(start_ns=START)
    raw = struct.pack("<dIB8s", 1, 0x10, 1, b"1") * 3
    file.group([Cg([time(), channel], 21, 3)], file.data(raw))
    account, frames = read(file)
    assert (account.whole, frames.channels, len(frames)) == (True, ("can2",), 3)


@pytest.mark.parametrize(
    ("master", "stamp", "raw", "ns"),
    [
        (time(), "<d", 1.000000001, 1_000_000_001),
        (time(32), "<f", 0.5, 500_000_000),
        (time(64, 5), ">d", -0.25, -250_000_000),
        (time(64, 0, (0.0, 1e-9)), "<Q", 123_456_789_012_345_679, 123_456_789_012_345_679),
        (time(64, 2, (0.0, 1e-9)), "<q", -3, -3),
        (time(64, 3, (0.0, 1e-9)), ">q", -3, -3),
        (time(32, 0, (0.0, 1e-7)), "<I", 2**32 - 1, (2**32 - 1) * 100),
        (time(40, 0, (0.0, 1e-6)), "<Q", 2**40 - 1, (2**40 - 1) * 1000),
        (time(64, 0, (0.5, 1e-10)), "<Q", 25, 500_000_003),
        (time(64, 0, (0.0, 4e-8)), "<Q", 3, 120),
        (time(64, 4, (1.0, 0.001)), "<d", 1500.0, 2_500_000_000),
        (time(64, 0), "<Q", 7, 7_000_000_000),
    ],
)
def test_each_kind_of_time(read, master, stamp, raw, ns):
    row = record(raw, 1, 0x10, b"1", stamp=stamp).ljust(23, b"\0")
    shift = 8 - struct.calcsize(stamp)
    row = row[: 8 - shift] + bytes(shift) + record(raw, 1, 0x10, b"1", stamp=stamp)[8 - shift :]
    file = Made(start_ns=START)
    file.group([Cg([master, frame()], 23, 1)], file.data(row))
    account, frames = read(file)
    assert account.whole
    assert frames.time_ns.tolist() == [START + ns]


@pytest.mark.parametrize("raw", [float("nan"), float("inf"), 1e30])
def test_a_time_that_is_none_is_rejected(read, raw):
    file = Made(start_ns=START)
    content = record(raw, 1, 0x10, b"1") + record(1.0, 1, 0x11, b"1")
    file.group([Cg([time(), frame()], 23, 2)], file.data(content))
    account, frames = read(file)
    assert (account.rejected, account.first_rejected[0].offset) == (1, bytes(file).index(content))
    assert frames.can_id.tolist() == [0x11]


def test_the_time_may_stand_in_another_group(read):
    file = Made(420, START)
    _, places, _ = file.group([Cg([time()], 8, 2, flags=0)], file.data(struct.pack("<2d", 0.5, 1.5)))
    inner = frame()
    content = b"".join(record(9.0, 1, 0x10 + k, b"1")[8:].ljust(15, b"\0") for k in range(2))
    for channel in (inner, *inner.members):
        channel.byte -= 8
    dv = file.data(content, ident=b"DV")
    ld = file.block(b"LD", [0, dv], struct.pack("<IIQ", 1, 1, 2))
    file.group([Cg([inner], 15, 2, flags=6 | 8, master=places[0])], ld)
    account, frames = read(file)
    assert account.whole
    assert [(t - START, i) for t, _, i, *_ in rows(frames)] == [(500_000_000, 0x10), (1_500_000_000, 0x11)]


def test_lists_of_values_with_their_invalidation_bits_apart(read):
    made = plain(90)
    file, link = simple(made, version=420)
    content = b"".join(records(made))
    parts = [content[i : i + 23 * 30] for i in range(0, len(content), 23 * 30)]
    values = [file.data(part, None, way, 23, ident=b"DV") for part, way in zip(parts, WAYS_TO_PACK, strict=True)]
    bits = [file.data(bytes(30), ident=b"DI") for _ in parts]
    second = file.block(b"LD", [0, values[2], bits[2]], struct.pack("<IIQ", 0x8000_0001, 1, 30))
    first = file.block(b"LD", [second, *values[:2], *bits[:2]], struct.pack("<IIQ", 0x8000_0001, 2, 30))
    file.patch(link, first)
    struct.pack_into("<I", file.raw, file.raw.index(b"##CG") + 24 + 48 + 28, 1)  # one byte of invalidation bits
    account, frames = read(file)
    assert account.whole
    assert rows(frames) == expected(made)


def test_a_frame_marked_invalid_is_rejected(read):
    channel = frame()
    channel.flags, channel.invalid = 2, 3
    content = b"".join(record(k, 1, k, b"1").ljust(23, b"\0") + bytes([8 if k == 1 else 0xF7]) for k in range(3))
    file = Made(start_ns=START)
    file.group([Cg([time(), channel], 23, 3, inval_bytes=1)], file.data(content))
    account, frames = read(file)
    assert (frames.can_id.tolist(), account.rejected) == ([0, 2], 1)


def test_what_is_newer_than_the_reader_is_said(read):
    made = plain(3)
    file, link = simple(made, version=430)
    file.patch(link, file.data(b"".join(records(made))))
    account, frames = read(file)
    assert rows(frames) == expected(made)
    assert "MDF version 4.30" in account.notes[0]
    at = file.packed(b"".join(records(made)))
    file.raw[at + 24 + 2] = 2  # another way of packing
    file.patch(link, at)
    account, frames = read(file)
    assert len(frames) == 0
    assert "packed in way 2 (MDF 4.3)" in account.first_rejected[0].text


def test_a_local_start_time_is_read_in_the_chosen_zone(read):
    made = plain(1)
    file, link = simple(made, time_flags=1)
    file.patch(link, file.data(records(made)[0]))
    account, frames = read(file, timezone=ZoneInfo("Europe/Berlin"))
    assert account.local_start
    assert account.start_ns == START - 3600 * 10**9
    assert frames.time_ns[0] == account.start_ns + made[0][0]
    assert read(file, timezone=UTC)[0].start_ns == START


# -- several groups --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bounded", [False, True])
def test_groups_are_merged_by_time(read, bounded, monkeypatch):
    if bounded:
        monkeypatch.setattr(mf4, "MERGED_ROWS", 40)
        monkeypatch.setattr(mf4, "LEAST_ROWS", 4)
    rng = np.random.default_rng(4)
    file, wanted = Made(start_ns=START), []
    for k, n in enumerate((500, 3, 200, 0, 77)):
        times = np.sort(rng.integers(0, 300, n)) * 1_000_000
        made = [(int(t), k + 1, j, False, False, 0, bytes([k])) for j, t in enumerate(times)]
        file.group([Cg([time(), frame()], 23, n)], file.data(b"".join(records(made))))
        wanted += [(t, k, row) for (t, *_), row in zip(made, expected(made), strict=True)]
    account, frames = read(file)
    assert account.whole
    wanted.sort(key=lambda w: w[:2])  # stable: equal stamps by the order of the groups
    assert rows(frames) == [row for *_, row in wanted]


def test_groups_without_can_frames_are_passed_over_and_counted(read):
    file = Made(start_ns=START)
    for name in ("Speed", "LIN_Frame", "FLX_Frame", "Torque"):
        file.group([Cg([time(), Cn(name, 8)], 16, 1)], file.data(bytes(16)))
    with pytest.raises(LogError, match="it holds 2 signal groups, 1 LIN groups, 1 FlexRay groups; give a bus log"):
        read(file)
    made = plain(3)
    file.group([Cg([time(), frame()], 23, 3)], file.data(b"".join(records(made))))
    account, frames = read(file)
    assert rows(frames) == expected(made)
    assert account.passed_over == {"signal groups": 2, "LIN groups": 1, "FlexRay groups": 1}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            b"MDF     3.30    ".ljust(28, b"\0") + struct.pack("<H", 330) + bytes(600),
            r"MDF version 3\.30; 4\.00 to 4\.20 are read: convert it",
        ),
        (b"MDF     4.10    ".ljust(40, b"\0"), "no header of MDF 4: 64 bytes should stand here"),
        (b"MDF     4.10    ".ljust(400, b"\0"), "no header of MDF 4: a block should stand here"),
        (bytes(Made()), "it holds no groups"),
    ],
)
def test_what_is_no_bus_log_is_refused(read, content, message):
    with pytest.raises(LogError, match=message):
        read(content)


# -- unfinalised files -----------------------------------------------------------------------------------------------

WAYS_TO_PACK = ("plain", "deflate", "transposed")
ALL_OPEN = 0x1 | 0x4 | 0x10 | 0x20


@pytest.mark.parametrize("stated", [0, 24, 24 + 46])
@pytest.mark.parametrize("rest", [0, 5])
@pytest.mark.parametrize("flags", [ALL_OPEN, 0])
def test_an_open_block_reaches_to_the_end(read, stated, rest, flags):
    made = plain(20)
    file, link = simple(made, unfinalised=flags)
    content = b"".join(records(made))
    file.patch(link, file.block(b"DT", (), content + bytes(range(1, rest + 1)), stated))
    cycles = bytes(file).index(b"##CG") + 24 + 48 + 8
    file.patch(cycles, 0)
    account, frames = read(file)
    assert rows(frames) == expected(made)
    assert account.rejected == (rest > 0)
    assert account.truncated_at == (len(file.raw) - rest if rest else None)
    assert any("unfinalised" in note for note in account.notes)


def test_space_that_was_set_aside_is_no_frame(read):
    made = plain(20)
    file, link = simple(made, unfinalised=ALL_OPEN)
    file.patch(link, file.block(b"DT", (), b"".join(records(made)) + bytes(23 * 4), 0))
    account, frames = read(file)
    assert rows(frames) == expected(made)
    assert account.rejected == 4


@pytest.mark.parametrize("entered", [0, 1, 4])
def test_blocks_that_were_not_yet_entered_in_the_list_are_found(read, entered):
    made = plain(100)
    file, link = simple(made, unfinalised=ALL_OPEN)
    content = b"".join(records(made))
    at = file.block(b"DL", [0] * 6, struct.pack("<B3xIQ", 1, 5, 460))
    file.patch(link, at)
    blocks = [file.block(b"DT", (), content[i : i + 460]) for i in range(0, len(content), 460)]
    for k in range(entered):
        file.patch(at + 24 + 8 + 8 * k, blocks[k])
    account, frames = read(file)
    assert account.whole
    assert rows(frames) == expected(made)


@pytest.mark.parametrize("offsets", [True, False])
@pytest.mark.parametrize("compiled", [True, False])
def test_an_unfinalised_unsorted_file(read, offsets, compiled, monkeypatch):
    monkeypatch.setattr(mdf_unsorted, "BLOCK_BYTES", 1000)
    file, made = unsorted(unfinalised=ALL_OPEN | (0 if offsets else 0x40), offsets=offsets)
    at = bytes(file).rindex(b"##DT")
    file.patch(at + 8, 0)
    account, frames = read(file, fast=compiled)
    assert account.whole
    assert rows(frames) == made
    whole = bytes(file)
    last = whole.rindex(b"\1" + struct.pack("<d", (made[-1][0] - START) / 1e9))  # the last frame, then its value
    size = len(made[-1][-1])
    for cut in (1, size, size + 2, size + 4, size + 5, size + 5 + 20):
        account, frames = read(whole[:-cut], fast=compiled)
        assert (account.rejected, account.truncated_at) == (1, last)
        assert rows(frames) == made[:-1]


# -- damage ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", [0.3, 0.5, 0.77, 0.999])
@pytest.mark.parametrize("way", ["plain", "deflate", "transposed"])
def test_a_cut_file_is_read_up_to_there(read, part, way):
    made = plain(1000)
    file, link = simple(made)
    begin = len(file.raw)
    at = file.block(b"DL", [0] * 24, struct.pack("<B3xI23Q", 0, 23, *[k * 1011 for k in range(23)]))
    file.patch(link, at)
    content = b"".join(records(made))
    for k in range(23):
        file.patch(at + 32 + 8 * k, file.data(content[k * 1011 : (k + 1) * 1011], None, way, 23))
    file = bytes(file)
    cut = int(begin + 450 + part * (len(file) - begin - 450))
    account, frames = read(file[:cut])
    assert account.truncated_at is not None
    assert account.truncated_at <= cut
    wanted = expected(made)
    got = rows(frames)
    assert got == wanted[: len(got)]
    if way == "plain":
        assert abs(len(got) - 1000 * (cut - begin - 450) / (len(file) - begin - 450)) < 30
    elif part > 0.4:
        assert len(got) > 100


def test_our_own_file_is_read_as_far_as_it_goes(tmp_path, read, monkeypatch):
    monkeypatch.setattr("hil.log.mf4.frames.BLOCK_BYTES", 4096)
    frames = some_frames(5000)
    write(frames, tmp_path / "a.mf4")
    whole = (tmp_path / "a.mf4").read_bytes()
    for part in (0.3, 0.6, 0.9):
        account, got = read(whole[: int(part * len(whole))])
        assert account.truncated_at is not None
        assert 0.7 * part * 5000 < len(got) < part * 5000 + 200
        assert_equal(got, replace(frames.take(slice(0, len(got))), channels=frames.channels))


def test_a_damaged_packed_block_costs_its_own_frames_only(read):
    made = plain(1000)
    file, link = simple(made)
    file.patch(link, file.data(b"".join(records(made)), 1000, "deflate", per_list=30))
    places = [k for k in range(len(file.raw)) if file.raw[k : k + 4] == b"##DZ"]
    file.raw[places[5] + 80] ^= 0xFF
    account, frames = read(file)
    assert account.rejected >= 1
    assert account.first_rejected[0].offset == places[5]
    got = set(rows(frames))
    assert got < set(expected(made))
    assert len(got) >= 1000 - 46


def test_records_that_are_no_frames_are_rejected_with_their_place(read):
    good = [record(k / 10, 1, 0x100 + k, b"12") for k in range(8)]
    bad = [
        record(0.1, 1, 0x800, b""),  # no standard identifier
        record(0.1, 1, 0x1, b"", dlc=1, length=9),  # a length that no classical frame has
        record(0.1, 1, 0x1, b"", fd=1, dlc=9, length=12),  # more than the 8 bytes that are there
    ]
    content = b"".join(good[:4] + bad + good[4:])
    file = Made(start_ns=START)
    file.group([Cg([time(), frame()], 23, 11)], file.data(content))
    account, frames = read(file)
    assert frames.can_id.tolist() == [0x100 + k for k in range(8)]
    first = bytes(file).index(content)
    assert [r.offset for r in account.first_rejected] == [first + 23 * k for k in (4, 5, 6)]
    assert account.first_rejected[0].text.startswith("CAN_DataFrame ")


@pytest.mark.parametrize("stated", [0, 5, 2**63])
def test_a_number_of_records_that_is_not_that_of_the_data_is_said(read, stated):
    made = plain(10)
    file = Made(start_ns=START)
    file.group([Cg([time(), frame()], 23, stated)], file.data(b"".join(records(made))))
    account, frames = read(file)
    assert rows(frames) == expected(made)
    assert f"{stated} records are stated, the data hold 10" in account.first_rejected[0].text


def test_loops_of_links_end(read):
    made = plain(10)
    file, link = simple(made)
    dt = file.data(b"".join(records(made)))
    dl = file.block(b"DL", [0, dt, dt], struct.pack("<B3xI2Q", 0, 2, 0, 230))
    file.patch(dl + 24, dl)  # the list follows itself
    file.patch(link, dl)
    file.patch(file.link_at, link - 24 - 16)  # the data group follows itself
    account, frames = read(file)
    assert rows(frames) == expected(made)
    assert account.rejected == 3


def test_data_that_two_groups_share_are_read_once(read):
    made = plain(10)
    file, link = simple(made)
    data = file.data(b"".join(records(made)))
    file.patch(link, data)
    file.group([Cg([time(), frame()], 23, 10)], data)
    account, frames = read(file)
    assert rows(frames) == expected(made)
    assert not account.whole


@pytest.mark.parametrize("ident", [b"##DG", b"##CG", b"##CN", b"##DT", b"##TX", b"##CC"])
@pytest.mark.parametrize("field", [8, 16])
@pytest.mark.parametrize("value", [0, 7, 2**31, 2**64 - 1])
def test_absurd_lengths_and_counts(read, ident, field, value):
    made = plain(10)
    file = Made(start_ns=START)
    channels = [time(64, 0, (0.0, 1e-9)), frame()]
    content = b"".join(record(t, *row, stamp="<Q") for t, *row in [(r[0], r[1], r[2] & 0x7FF, r[6]) for r in made])
    file.group([Cg(channels, 23, 10)], file.data(content))
    raw = bytearray(bytes(file))
    struct.pack_into("<Q", raw, raw.index(ident) + field, value)
    try:
        account, frames = read(raw)
    except LogError:
        return
    assert set(frames.can_id.tolist()) <= {r[2] & 0x7FF for r in made}
    assert len(frames) == 10 or not account.whole


def two_groups(n, per_block, aligned=True):
    """Unsorted data of two groups in blocks; the file, and where each block begins."""
    file = Made(start_ns=START)
    groups = [Cg([time(), frame()], 23, n // 2, k) for k in (1, 2)]
    dg, _, _ = file.group(groups, 0, 1)
    content = b"".join(bytes([1 + k % 2]) + record(k * 0.001, 1 + k % 2, k, b"1").ljust(23, b"\0") for k in range(n))
    file.patch(dg + 40, file.data(content, 24 * per_block - (not aligned)))
    raw = bytearray(bytes(file))
    return raw, [k + 24 for k in range(len(raw)) if raw[k : k + 4] == b"##DT"]


@pytest.mark.parametrize("small", [False, True])
def test_a_damaged_record_of_an_unsorted_stream_costs_the_rest_of_its_block(read, small, monkeypatch):
    if small:
        monkeypatch.setattr(mdf_unsorted, "BLOCK_BYTES", 100)
    raw, blocks = two_groups(100, 10)
    raw[blocks[3] + 24 * 4] = 99  # no group has this id
    account, frames = read(raw)
    assert frames.can_id.tolist() == [*range(34), *range(40, 100)]
    assert account.rejected == 1
    assert account.first_rejected[0].offset == blocks[3] + 24 * 4
    assert "no record: 63" in account.first_rejected[0].text


def test_groups_that_share_a_record_id_or_have_records_of_no_bytes_are_said(read):
    raw, _ = two_groups(10, 10)
    at = raw.rindex(b"##CG") + 24 + 48
    for field, value in ((0, 2), (24, 0)):  # record id, bytes of a record
        damaged = bytearray(raw)
        struct.pack_into("<Q", damaged, at + field, value)
        account, _ = read(damaged)
        assert any("records of no bytes" in piece.text for piece in account.first_rejected)


def test_where_records_cross_blocks_all_behind_a_damaged_one_are_lost(read):
    raw, blocks = two_groups(100, 10, aligned=False)
    raw[blocks[3] + 3 + 24 * 4] = 99
    account, frames = read(raw)
    assert frames.can_id.tolist() == list(range(34))
    assert any("nobody knows" in note for note in account.notes)


def test_no_value_is_given_to_the_wrong_frame_behind_lost_bytes(read):
    file, made = unsorted(piece=400, n=60)
    raw = bytearray(bytes(file))
    blocks = [k for k in range(len(raw)) if raw[k : k + 4] == b"##DT"]
    raw[blocks[4]] = 0  # no block of data any more
    account, frames = read(raw)
    assert not account.whole
    assert set(rows(frames)) <= set(made)
    assert len(frames) > 10


def test_unsorted_groups_are_put_in_order_within_bounded_memory(read, monkeypatch):
    monkeypatch.setattr(mf4, "MERGED_ROWS", 64)
    monkeypatch.setattr(mdf_unsorted, "BLOCK_BYTES", 240)
    file = Made(start_ns=START)
    dg, _, _ = file.group([Cg([time(), frame()], 23, 100, k) for k in (1, 2)], 0, 1)
    # the second group is written 10 records late
    pieces = [(k + 20 * g, g, k) for g in (0, 1) for k in range(100)]
    content = b"".join(
        bytes([1 + g]) + record(k * 0.001, 1 + g, k, b"1").ljust(23, b"\0") for _, g, k in sorted(pieces)
    )
    file.patch(dg + 40, file.data(content))
    account, frames = read(file)
    assert account.whole
    assert [row[1:3] for row in rows(frames)] == [(f"can{g}", k) for k in range(100) for g in (0, 1)]


def test_a_part_of_a_log_and_a_packed_one(tmp_path, read):
    import gzip

    made = plain(100)
    file, link = simple(made)
    file.patch(link, file.data(b"".join(records(made))))
    (tmp_path / "a.mf4.gz").write_bytes(gzip.compress(bytes(file)))
    with open_log(tmp_path / "a.mf4.gz") as log:
        assert log.format.name == "mf4"
        assert rows(log.frames()) == expected(made)
    path = tmp_path / "a.mf4"
    path.write_bytes(bytes(file))
    with open_log(path, limit_bytes=len(file.raw) - 23 * 50) as log:
        assert rows(log.frames()) == expected(made)[:50]
        assert log.account.truncated_at == len(file.raw) - 23 * 50


def test_memory_does_not_grow_with_the_log(tmp_path):
    import tracemalloc

    def tables():
        for k in range(12):
            table = some_frames(60_000, "classical remote")
            table.time_ns[:] += k * 60 * 10**9
            yield table

    facts = LogFacts.of(tables())
    tracemalloc.start()
    try:
        write_tables(tables(), facts, tmp_path / "a.mf4", BY_NAME["mf4"])
        written = tracemalloc.get_traced_memory()[1]
        tracemalloc.reset_peak()
        with open_log(tmp_path / "a.mf4") as log:
            assert sum(len(table) for table in log.tables()) == 720_000
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert written < 60e6
    assert peak < 60e6


@pytest.mark.parametrize("columns", [0, 23])
def test_a_small_file_that_unpacks_to_much_is_read_in_bounded_memory(tmp_path, columns):
    import tracemalloc

    n = 1_500_000
    file = Made(start_ns=START)
    dg, _, _ = file.group([Cg([time(), frame()], 23, n)])
    file.patch(dg + 40, file.packed(record(1.0, 1, 0x10, b"1").ljust(23, b"\0") * n, columns))
    (tmp_path / "a.mf4").write_bytes(bytes(file))
    assert len(file.raw) < n / 10
    tracemalloc.start()
    try:
        with open_log(tmp_path / "a.mf4") as log:
            assert sum(len(table) for table in log.tables()) == n
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 25e6


def test_a_block_that_cannot_be_as_long_as_it_says_is_refused(read):
    made = plain(40)
    file, link = simple(made)
    content = b"".join(records(made))
    file.patch(link, file.packed(content))
    at = bytes(file).index(b"##DZ") + 24 + 8
    for absurd in (2**63, 2**40, 10**7):
        file.patch(at, absurd)
        account, frames = read(file)
        assert not account.whole
        assert len(frames) in (0, 40)


# -- mutants ---------------------------------------------------------------------------------------------------------


WAYS = (0, 0, 0, 1, 1, 1, 2, 3, 4, 5, 6, 6, 6)  # what moves all that stands behind is rarer: no link is right then


def mutant(rng, raw):
    """One to four small damages."""
    raw = bytearray(raw)
    for _ in range(int(rng.integers(1, 5))):
        at, way = int(rng.integers(0, len(raw))), int(rng.choice(WAYS))
        span = int(rng.integers(1, 64))
        if way == 0:
            raw[at] ^= 1 << int(rng.integers(0, 8))
        elif way == 1:
            raw[at] = int(rng.integers(0, 256))
        elif way == 2:
            del raw[at:]
        elif way == 3:
            raw[at:at] = rng.integers(0, 256, span, np.uint8).tobytes()
        elif way == 4:
            del raw[at : at + span]
        elif way == 5:
            raw[at:at] = raw[at : at + span]
        else:
            at &= ~7
            values = (0, 1, 24, 0xFFFF_FFFF, 2**40, 2**63, 2**64 - 1, len(raw), len(raw) // 2 & ~7)
            raw[at : at + 8] = struct.pack("<Q", values[int(rng.integers(0, len(values)))])
        if len(raw) < 100:
            break
    return bytes(raw)


def seeds(tmp_path):
    write(some_frames(60, "fd remote error"), tmp_path / "seed.mf4")
    yield (tmp_path / "seed.mf4").read_bytes()
    made = plain(40)
    for way in ("plain", "deflate", "transposed"):
        file, link = simple(made)
        file.patch(link, file.data(b"".join(records(made)), 200, way, 23))
        yield bytes(file)
    yield bytes(unsorted(n=20, piece=300)[0])
    yield bytes(unsorted(n=20, unfinalised=ALL_OPEN | 0x40)[0])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_mutants(tmp_path, read, seed, monkeypatch):
    monkeypatch.setattr(mdf_unsorted, "BLOCK_BYTES", 512)
    monkeypatch.setattr(mf4, "MERGED_ROWS", 24)
    monkeypatch.setattr(mf4, "LEAST_ROWS", 8)
    raw = list(seeds(tmp_path))[seed]
    rng = np.random.default_rng(seed)
    for _ in range(350):
        content = mutant(rng, raw)
        results = []
        for fast in (False, True):
            try:
                account, frames = read(content, fast=fast)
            except LogError as error:
                results.append(str(error))
                continue
            assert account.rejected >= len(account.first_rejected)
            assert account.truncated_at is None or 0 <= account.truncated_at <= len(content)
            assert (frames.can_id <= np.where(frames.extended | (frames.flags & 2 > 0), 0x1FFF_FFFF, 0x7FF)).all()
            fd = (frames.flags & FrameFlag.FD) != 0
            assert np.isin(frames.length[fd], FD_CODES).all()
            assert (frames.length[~fd] <= 8).all()
            results.append((rows(frames), account.rejected, account.truncated_at, account.notes))
        assert results[0] == results[1]
