import shutil
import subprocess
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import can
import numpy as np
import pytest
from blf_bytes import FILE_HEADER

from hil.log.blf import write as blf_write
from hil.log.blf.blf import write_blf
from hil.log.convert import convert
from hil.log.formats import BY_NAME
from hil.log.frames import FD_CODES, FrameFlag, FrameTable, LogError, LogFacts
from hil.log.read import open_log
from hil.log.source import ReadOptions
from hil.log.write import kept

DATA = Path(__file__).parents[4] / "data" / "logs"
F = FrameFlag
SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
BERLIN = ZoneInfo("Europe/Berlin")


def table_of(rows, channels=("can0",)):
    """Frames of (time_ns, channel, id, extended, length, data, flags)."""
    table = FrameTable.empty(len(rows), 64 if any(len(row[5]) > 8 for row in rows) else 8, channels)
    for i, (time_ns, channel, can_id, extended, length, data, flags) in enumerate(rows):
        table.time_ns[i], table.channel[i], table.can_id[i], table.extended[i] = time_ns, channel, can_id, extended
        table.length[i], table.flags[i] = length, int(flags)
        table.data[i, : len(data)] = np.frombuffer(data, np.uint8)
    return table


def drawn(n, seed=3, wide=True):
    """Frames of all kinds, over 5 channels, stamps running about."""
    rng = np.random.default_rng(seed)
    kinds = [F(0), F.REMOTE, F.FD, F.FD | F.BIT_RATE_SWITCH | F.ERROR_STATE, F.FD | F.REMOTE, F.ERROR, F.ERROR | F.FD]
    rows = []
    for _ in range(n):
        flags = kinds[rng.integers(len(kinds) if wide else 2)] | (F.SENT if rng.integers(2) else F(0))
        error = bool(flags & F.ERROR)
        extended = bool(rng.integers(2)) and not error
        length = FD_CODES[rng.integers(16)] if flags & F.FD else int(rng.integers(9))
        data = b"" if flags & F.REMOTE else rng.bytes(length)
        can_id = int(rng.integers(2**29 if extended or error else 2**11))
        rows.append(
            (START + int(rng.integers(-(10**9), 10**12)), int(rng.integers(5)), can_id, extended, length, data, flags)
        )
    return table_of(rows, ("can0", "can1", "can7", "can254", "can3"))


def written(path, tables, zone=UTC, **facts):
    with path.open("w+b") as file:
        write_blf(file, iter(tables), replace(LogFacts.of(tables), **facts), zone)
    return path


def columns(table):
    names = np.array(table.channels, dtype=object)[table.channel].tolist()
    lists = (table.time_ns, table.can_id, table.extended, table.length, table.widened(64).data, table.flags)
    return [names, *(column.tolist() for column in lists)]


def read_back(path, **options):
    with open_log(path, options=ReadOptions(**options)) as log:
        recording = log.recording()
    assert recording.rejected == 0
    assert recording.truncated_at is None
    return recording


@pytest.mark.parametrize("n", [1, 2, 700, 3000])
@pytest.mark.parametrize("wide", [True, False])
def test_all_kinds_read_back_equal(tmp_path, n, wide):
    table = drawn(n, wide=wide)
    parts = [table.take(slice(0, n // 3)), table.take(slice(n // 3, n))]
    path = written(tmp_path / "a.blf", parts)
    facts = LogFacts.of(parts)
    recording = read_back(path)
    assert columns(recording.frames) == columns(kept(table, facts, BY_NAME["blf"]))
    assert recording.start_ns == facts.least_ns // 10**6 * 10**6


def test_no_frame_at_all(tmp_path):
    path = written(tmp_path / "a.blf", [])
    with open_log(path) as log:
        assert len(log.frames()) == 0
        assert log.account.whole


def test_header_states_what_the_file_is(tmp_path):
    table = drawn(5000)
    path = written(tmp_path / "a.blf", [table], start_ns=START + 5_700_000)
    header = FILE_HEADER.unpack_from(path.read_bytes())
    assert header[:7] == (b"LOGG", 144, blf_write.API_NUMBER, 0, blf_write.LEVEL, 0, 1)
    assert header[7] == path.stat().st_size
    assert header[9:11] == (5000, 0)
    start, last = datetime.fromtimestamp(START / SECOND, UTC), int(table.time_ns.max()) // 10**6
    assert header[11:19] == (start.year, start.month, 2, start.day, start.hour, start.minute, start.second, 5)
    assert header[26] == last % 1000
    assert read_back(path).start_ns == START + 5_000_000


def test_containers_hold_128_kib(tmp_path):
    path = written(tmp_path / "a.blf", [drawn(4000)])
    content, at, sizes = path.read_bytes(), 144, []
    while at < len(content):
        assert content[at : at + 4] == b"LOBJ"
        size = int.from_bytes(content[at + 8 : at + 12], "little")
        sizes.append(int.from_bytes(content[at + 24 : at + 28], "little"))
        at += size + size % 4
    assert set(sizes[:-1]) == {128 * 1024}
    assert int.from_bytes(content[24:32], "little") == 144 + sum(sizes) + 32 * len(sizes)


@pytest.mark.parametrize("zone", [UTC, BERLIN, ZoneInfo("Asia/Kathmandu"), ZoneInfo("America/St_Johns")])
@pytest.mark.parametrize("hour", range(8))
def test_start_is_a_wall_clock_also_when_clocks_are_put_back(tmp_path, zone, hour):
    night = int(datetime(2024, 10, 26, 22, tzinfo=UTC).timestamp()) * SECOND
    rows = [(night + hour * 1800 * SECOND + k, 0, 1, False, 1, b"\1", 0) for k in (1, 20)]
    path = written(tmp_path / "a.blf", [table_of(rows)], zone)
    recording = read_back(path, timezone=zone)
    assert recording.frames.time_ns.tolist() == [row[0] for row in rows]


@pytest.mark.parametrize(
    "stamps", [(0, 1), (-5, 7), (-(2**62), 2**61), (2**63 - 2, 2**63 - 1), (-(2**63), -(2**63) + 1)]
)
def test_stamps_at_the_limits(tmp_path, stamps):
    table = table_of([(stamp, 0, 1, False, 1, b"\1", 0) for stamp in stamps])
    assert read_back(written(tmp_path / "a.blf", [table])).frames.time_ns.tolist() == list(stamps)


def test_stamps_too_far_apart_are_refused(tmp_path):
    table = table_of([(stamp, 0, 1, False, 1, b"\1", 0) for stamp in (-(2**62), 2**62)])
    with pytest.raises(LogError, match="292 years"):
        written(tmp_path / "a.blf", [table])


def test_python_can_reads_what_is_written(tmp_path):
    table = drawn(300)
    path = written(tmp_path / "a.blf", [table])
    known = table.take((table.flags & (F.ERROR | F.FD)) != F.ERROR | F.FD)  # it passes over CAN_FD_ERROR_64
    messages = list(can.BLFReader(str(path)))
    assert len(messages) == len(known)
    for i, message in enumerate(messages):
        flags, length = F(int(known.flags[i])), int(known.length[i])
        assert message.timestamp == pytest.approx(known.time_ns[i] / 1e9, abs=1e-6)
        assert (message.arbitration_id, message.dlc) == (known.can_id[i], length)
        assert known.channels[known.channel[i]] == f"can{message.channel}"
        if not flags & F.REMOTE:
            assert bytes(message.data) == known.data[i, :length].tobytes()
        assert message.is_error_frame == bool(flags & F.ERROR)
        if not flags & F.ERROR:
            assert message.is_extended_id == known.extended[i]
            assert message.is_rx != bool(flags & F.SENT)
        assert message.is_remote_frame == bool(flags & F.REMOTE)
        assert message.is_fd == bool(flags & F.FD)
        assert message.bitrate_switch == bool(flags & F.BIT_RATE_SWITCH)
        assert message.error_state_indicator == bool(flags & F.ERROR_STATE)


def test_what_python_can_writes_is_read(tmp_path):
    path = tmp_path / "a.blf"
    rng = np.random.default_rng(8)
    messages = []
    for k in range(4000):
        kind = k % 5
        length = FD_CODES[rng.integers(16)] if kind == 1 else int(rng.integers(9))
        messages.append(
            can.Message(
                timestamp=1.7e9 + k / 1000, arbitration_id=int(rng.integers(2**11)), is_extended_id=bool(k % 3 == 0),
                is_fd=kind == 1, bitrate_switch=kind == 1 and k % 2 == 0, is_remote_frame=kind == 2, is_rx=k % 7 > 0,
                is_error_frame=kind == 3, dlc=length, data=b"" if kind == 2 else rng.bytes(length), channel=k % 4,
            )
        )  # fmt: skip
    with can.BLFWriter(str(path)) as writer:
        for message in messages:
            writer.on_message_received(message)
    frames = read_back(path).frames
    assert len(frames) == len(messages)
    for i, message in enumerate(messages):
        error = message.is_error_frame
        assert frames.time_ns[i] == pytest.approx(message.timestamp * 1e9, abs=1000)
        assert (frames.can_id[i], frames.length[i]) == (message.arbitration_id, message.dlc)
        assert frames.extended[i] == (message.is_extended_id and not error)
        assert frames.data[i, : len(message.data)].tobytes() == message.data
        assert frames.channels[frames.channel[i]] == f"can{message.channel}"
        flags = F(int(frames.flags[i]))
        assert bool(flags & F.ERROR) == error
        assert bool(flags & F.REMOTE) == message.is_remote_frame
        assert bool(flags & F.FD) == message.is_fd
        assert bool(flags & F.BIT_RATE_SWITCH) == message.bitrate_switch
        assert bool(flags & F.SENT) == (not message.is_rx and not error)


def test_vblf_reads_what_is_written(tmp_path):
    reader = pytest.importorskip("vblf.reader")
    vblf = pytest.importorskip("vblf.can")
    table = drawn(400)
    path = written(tmp_path / "a.blf", [table])
    with reader.BlfReader(path) as log:
        objects = list(log)
        start = log.file_statistics.measurement_start_time.to_datetime().replace(tzinfo=UTC)
    start_ns = round(start.timestamp() * 1000) * 10**6
    assert len(objects) == len(table)
    for i, one in enumerate(objects):
        flags, length = F(int(table.flags[i])), int(table.length[i])
        kinds = {F(0): vblf.CanMessage, F.FD: vblf.CanFdMessage, F.ERROR: vblf.CanErrorFrameExt}
        assert type(one) is kinds.get(flags & (F.FD | F.ERROR), vblf.CanFdErrorFrame64)
        assert one.header.object_time_stamp == (int(table.time_ns[i]) - start_ns) % 2**64
        assert one.frame_id & 0x1FFF_FFFF == table.can_id[i]
        assert one.dlc == FD_CODES.index(length)
        assert f"can{one.channel - 1}" == table.channels[table.channel[i]]
        held = 0 if flags & F.REMOTE else length
        assert one.data[:held] == table.data[i, :held].tobytes()
        if flags & F.FD:
            assert one.valid_data_bytes == held
        if not flags & F.ERROR:
            assert one.flags == (0x80 if flags & F.REMOTE else 0) + (1 if flags & F.SENT else 0)
            assert bool(one.frame_id & 0x8000_0000) == table.extended[i]


@pytest.mark.parametrize("level", ["NONE", "DEFAULT"])
def test_what_vblf_writes_is_read(tmp_path, level):
    writer = pytest.importorskip("vblf.writer")
    vblf = pytest.importorskip("vblf.can")
    constants = pytest.importorskip("vblf.constants")
    path, nanoseconds = tmp_path / "a.blf", constants.ObjFlags.TIME_ONE_NANS
    with writer.BlfWriter(path, constants.Compression[level]) as log:
        for k in range(3000):
            if k % 2:
                log.write(vblf.CanMessage.new(nanoseconds, k, 2, k % 4 == 1, k % 9, k % 2048, bytes([k % 256] * 8)))
            else:
                log.write(vblf.CanFdMessage.new(nanoseconds, k, 1, 0, 15, k % 2048, 0, 0, 0x1, bytes(range(64))))
    with open_log(path) as log:
        frames = log.frames()
        assert log.account.rejected == 0
        assert (frames.time_ns - log.account.start_ns).tolist() == list(range(3000))
    assert frames.length[:4].tolist() == [64, 1, 64, 3]
    assert frames.data[3, :3].tolist() == [3, 3, 3]


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_wireshark_reads_what_is_written(tmp_path):
    table = drawn(100)
    table = table.take((table.flags & F.ERROR) == 0)
    path = written(tmp_path / "a.blf", [table])
    fields = ["-e", "frame.time_epoch", "-e", "can.id", "-e", "can.len", "-e", "can.flags.xtd"]
    shown = subprocess.run(["tshark", "-r", path, "-T", "fields", *fields], capture_output=True, text=True, check=True)
    lines = [line.split("\t") for line in shown.stdout.splitlines()]
    assert [int(line[0].replace(".", "")) for line in lines] == table.time_ns.tolist()
    assert [int(line[1]) for line in lines] == table.can_id.tolist()
    assert [int(line[2]) for line in lines] == table.length.tolist()
    assert [line[3] == "1" for line in lines] == table.extended.tolist()


@pytest.mark.parametrize("name", ["errkinds.blf", "dlc13.blf", "e.blf", "error-frames.blf", "nanoseconds.blf"])
@pytest.mark.parametrize("suffix", [".log", ".blf"])
def test_other_tools_logs_convert(tmp_path, name, suffix):
    done = convert(DATA / name, tmp_path / f"o{suffix}")
    assert done.frames_read == done.frames_written > 0


def test_an_extended_error_frame_becomes_a_candump_line(tmp_path):
    convert(DATA / "e.blf", tmp_path / "o.log")
    assert (tmp_path / "o.log").read_text() == "(1746165600.001000) can0 20000123#\n"


def test_candump_with_fd_frames_becomes_blf_that_vblf_reads(tmp_path):
    reader = pytest.importorskip("vblf.reader")
    convert(DATA / "fd.log", tmp_path / "o.blf")
    with reader.BlfReader(tmp_path / "o.blf") as log:
        one, other = list(log)
    assert (one.header.base.object_size, one.frame_id, one.valid_data_bytes, one.data[:12]) == (
        120,
        0x100,
        12,
        b"\x11" * 12,
    )
    assert (other.header.base.object_size, other.frame_id, other.data[:1]) == (48, 0x101, b"\1")
