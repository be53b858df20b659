"""What every log format must do: what is written reads back, both ways of reading, and other tools agree."""

import os
from pathlib import Path

import can
import numpy as np
import pytest

from hil.log.builder import FrameBuilder
from hil.log.convert import aligned, convert
from hil.log.formats import WRITABLE
from hil.log.frames import FrameFlag, FrameTable, LogError, LogFacts
from hil.log.read import open_log, read_log
from hil.log.source import ReadOptions
from hil.log.write import channel_numbers, kept, write_log

START_NS = 1_700_000_000_123_456_000
FD, SENT, REMOTE, ERROR = FrameFlag.FD, FrameFlag.SENT, FrameFlag.REMOTE, FrameFlag.ERROR
SUFFIXES = sorted(suffix for suffix, form in WRITABLE.items() if suffix == form.suffixes[0])
KINDS = "classical remote error fd sent"
LOGS = ("rav4/bus0.log", "motec/can_sample.log", "mustang/hs.log")


def some_frames(kinds=KINDS, channels=("can0", "can3"), start_ns=START_NS, step_ns=1000):
    """One frame of each kind, several times over."""
    builder = FrameBuilder()
    sent = SENT if "sent" in kinds else FrameFlag(0)
    for i in range(12):
        time_ns, channel = start_ns + i * 1234 * step_ns, channels[i % len(channels)]
        if "classical" in kinds:
            builder.add(time_ns, channel, 0x100 + i, False, bytes(range(i % 9)), sent, 0)
            builder.add(time_ns + step_ns, channel, 0x1FFFFF00 + i, True, bytes([255 - i] * 8), FrameFlag(0), 0)
            builder.add(time_ns + step_ns, channel, i, True, b"\x7f", FrameFlag(0), 0)
        if "remote" in kinds:
            builder.add(time_ns + 2 * step_ns, channel, 0x200, False, b"", REMOTE | sent, i % 9)
            builder.add(time_ns + 2 * step_ns, channel, 0x20000, True, b"", REMOTE, 8)
        if "error" in kinds:
            builder.add(time_ns + 3 * step_ns, channel, 0x80, False, bytes(range(8)), ERROR, 0)
        if "fd" in kinds:
            builder.add(time_ns + 4 * step_ns, channel, 0x300, False, bytes(range(5)), FD, 0)
            flags = FD | FrameFlag.BIT_RATE_SWITCH | (FrameFlag.ERROR_STATE if i % 2 else FrameFlag(0))
            builder.add(time_ns + 5 * step_ns, channel, 0x1234567, True, bytes(range(64)), flags | sent, 0)
            builder.add(time_ns + 6 * step_ns, channel, 0x301, False, bytes(range(12)), FD | FrameFlag.ERROR_STATE, 0)
    assert builder.account.whole
    return builder.recording(Path("made"), "made").frames


def rows(table):
    """Frames as comparable tuples, in the order of their kind."""
    names = np.array(table.channels or ("",))[table.channel]
    columns = (table.time_ns, names, table.can_id, table.extended, table.length, table.flags)
    data = [row.tobytes() for row in table.widened(64).data]
    return list(zip(*(c.tolist() for c in columns), data, strict=True))


def by_kind(table):
    return sorted(rows(table), key=lambda row: row[5] & (REMOTE | ERROR))


def writes(kinds, form):
    """The kinds that a format has."""
    lacking = [] if form.errors else ["error"]
    lacking += [] if form.fd else ["fd"]
    return " ".join(kind for kind in kinds.split() if kind not in lacking)


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("step_ns", [1000, 1])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_is_written_reads_back(tmp_path, suffix, step_ns, fast):
    form = WRITABLE[suffix]
    frames = some_frames(writes(KINDS, form), step_ns=step_ns)
    write_log(frames, tmp_path / f"a{suffix}")
    with open_log(tmp_path / f"a{suffix}", options=ReadOptions(fast=fast)) as log:
        assert log.format is form
        back = log.recording()
    assert (back.rejected, back.truncated_at) == (0, None)
    expected = kept(frames, LogFacts.of([frames]), form)
    if form.name == "mf4":  # groups of one kind each
        assert by_kind(back.frames) == by_kind(expected)
    else:
        assert rows(back.frames) == rows(expected)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("start_ns", [0, 46_408_000_000_000, 4_102_444_800_999_999_000])
def test_any_start_time_is_kept(tmp_path, suffix, start_ns):
    frames = some_frames("classical", start_ns=start_ns)
    write_log(frames, tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(read_log(tmp_path / f"a{suffix}").frames.time_ns, frames.time_ns)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_stamps_before_the_start(tmp_path, suffix):
    frames = some_frames("classical", start_ns=-5_000_000)
    if not WRITABLE[suffix].before_start:
        with pytest.raises(LogError, match="before 1970"):
            write_log(frames, tmp_path / f"a{suffix}")
        return
    write_log(frames, tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(read_log(tmp_path / f"a{suffix}").frames.time_ns, frames.time_ns)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_log_without_a_frame(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_log(FrameTable.empty(), path)
    log = read_log(path, WRITABLE[suffix].name)
    assert (len(log.frames), log.rejected, log.truncated_at) == (0, 0, None)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_format_is_told_by_its_content(tmp_path, suffix):
    frames = some_frames(writes(KINDS, WRITABLE[suffix]))
    write_log(frames, tmp_path / f"a{suffix}")
    renamed = (tmp_path / f"a{suffix}").rename(tmp_path / "a.dat")
    assert read_log(renamed).format == WRITABLE[suffix].name


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_there_and_back(tmp_path, suffix):
    """candump to a format and back: the same lines, channels by number where it has no names."""
    form = WRITABLE[suffix]
    channels = ("vehicle", "bench")
    write_log(some_frames(writes("classical remote fd", form), channels), tmp_path / "in.log")
    there = convert(tmp_path / "in.log", tmp_path / f"there{suffix}")
    back = convert(there.path, tmp_path / "back.log")
    assert there.frames_written == back.frames_read == there.frames_read
    text = (tmp_path / "in.log").read_text()
    if not form.channel_names:
        assert any("vehicle is channel 1, bench is channel 2" in note for note in there.notes)
        text = text.replace("vehicle", "can0").replace("bench", "can1")
    assert sorted((tmp_path / "back.log").read_text().splitlines()) == sorted(text.splitlines())


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", LOGS)
def test_measured_logs_keep_every_frame(tmp_path, name, suffix):
    folder = Path(os.environ.get("BRAKEBENCH_DATA", Path(__file__).parents[3] / "shared" / "data"))
    if not (folder / name).exists():
        pytest.skip(f"measured data not found: {folder / name} (set BRAKEBENCH_DATA)")
    there = convert(folder / name, tmp_path / f"there{suffix}")
    back = convert(there.path, tmp_path / "back.log")
    assert there.account.whole
    assert there.frames_read == there.frames_written == back.frames_written > 50_000
    with open_log(folder / name) as log, open_log(tmp_path / "back.log") as read:
        for _, wanted, got in aligned(log.tables(), read.tables()):
            assert rows(wanted) == rows(got)


def of_python_can(messages):
    return [
        (m.timestamp, m.arbitration_id, m.is_extended_id, m.is_remote_frame, m.is_error_frame, m.is_fd, bytes(m.data))
        for m in messages
    ]


def of_ours(frames):
    found = []
    for t, _, i, x, n, f, data in rows(frames):
        remote = bool(f & REMOTE)
        found.append((t / 1e9, i, x, remote, bool(f & ERROR), bool(f & FD), b"" if remote else data[:n]))
    return found


def assert_same(theirs, ours):
    """Equal but for the start of time and 2 us."""
    assert [m[1:] for m in theirs] == [m[1:] for m in ours]
    times = [np.array([m[0] for m in table]) - table[0][0] for table in (theirs, ours)]
    np.testing.assert_allclose(*times, rtol=0, atol=2e-6)


CASES = [
    (".log", "classical remote fd"),  # python-can drops what an error frame holds
    (".asc", "classical remote fd"),
    (".blf", "classical remote error fd"),
    (".trc", "classical remote"),
    (".mf4", "classical remote fd"),
]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("suffix", "kinds"), CASES)
def test_python_can_reads_what_we_write(tmp_path, suffix, kinds):
    frames = some_frames(kinds, channels=("can0",))
    write_log(frames, tmp_path / f"a{suffix}")
    with can.LogReader(tmp_path / f"a{suffix}") as reader:
        theirs = of_python_can(reader)
    ours = of_ours(frames)
    if suffix == ".mf4":
        theirs, ours = sorted(theirs, key=lambda m: (m[3], m[0])), sorted(ours, key=lambda m: (m[3], m[0]))
    assert_same(theirs, ours)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize(
    ("suffix", "kinds"),
    [*[case for case in CASES if case[0] != ".trc"], (".trc", "classical"), (".csv", "classical remote")],
)  # python-can's TRC writer leaves remote frames out
def test_we_read_what_python_can_writes(tmp_path, suffix, kinds, fast):
    frames = some_frames(kinds, channels=("can0",))
    with can.Logger(tmp_path / f"a{suffix}") as writer:
        for t, i, x, remote, error, fd, data in of_ours(frames):
            writer(
                can.Message(
                    timestamp=t, arbitration_id=i, is_extended_id=x, is_remote_frame=remote, is_error_frame=error,
                    is_fd=fd, data=None if remote else data, dlc=0 if remote else None, channel=0,
                )
            )  # fmt: skip
    with open_log(tmp_path / f"a{suffix}", options=ReadOptions(fast=fast)) as log:
        back = log.recording()
    assert (back.rejected, back.truncated_at) == (0, None)
    ours, theirs = of_ours(back.frames), of_ours(frames)
    if suffix == ".mf4":
        theirs, ours = sorted(theirs, key=lambda m: (m[3], m[0])), sorted(ours, key=lambda m: (m[3], m[0]))
    assert_same(theirs, ours)


def test_channels_are_numbered_by_their_names_where_those_tell():
    assert channel_numbers(("can3", "can0")) == [3, 0]
    assert channel_numbers(("vehicle", "bench")) == [0, 1]
    assert channel_numbers(("can1", "vcan1")) == [0, 1]
