"""Every format: what is written reads back, python-can agrees both ways, damage is reported."""

import contextlib
import re
import struct
import zlib

import can
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil.log.frames import FrameBuilder, FrameFlag, LogError
from hil.log.read import READERS, read_log
from hil.log.write import channel_numbers, write_log

START_NS = 1_700_000_000_123_456_000
FD = FrameFlag.FD


def some_frames(kinds="classical remote error fd", channels=("can0", "can3"), start_ns=START_NS):
    """One frame of each kind, several times over."""
    builder = FrameBuilder()
    for i in range(12):
        time_ns, channel = start_ns + i * 1_234_000, channels[i % len(channels)]
        if "classical" in kinds:
            builder.add(time_ns, channel, 0x100 + i, False, bytes(range(i % 9)), FrameFlag(0), 0)
            builder.add(time_ns + 1000, channel, 0x1FFFFF00 + i, True, bytes([255 - i] * 8), FrameFlag(0), 0)
            builder.add(time_ns + 1000, channel, i, True, b"\x7f", FrameFlag(0), 0)
        if "remote" in kinds:
            builder.add(time_ns + 2000, channel, 0x200, False, b"", FrameFlag.REMOTE, i % 9)
        if "error" in kinds:
            builder.add(time_ns + 3000, channel, 0x80, False, bytes(range(8)), FrameFlag.ERROR, 0)
        if "fd" in kinds:
            builder.add(time_ns + 4000, channel, 0x300, False, bytes(range(5)), FD, 0)
            flags = FD | FrameFlag.BIT_RATE_SWITCH | (FrameFlag.ERROR_STATE if i % 2 else FrameFlag(0))
            builder.add(time_ns + 5000, channel, 0x1234567, True, bytes(range(64)), flags, 0)
    assert builder.rejected == 0
    return builder.recording(None, "made").frames


def rows(frames, error_content=True):
    """Frames as comparable tuples."""
    found = []
    for i in range(len(frames)):
        error = bool(frames.flags[i] & FrameFlag.ERROR) and not error_content
        found.append(
            (
                int(frames.time_ns[i]),
                frames.channels[frames.channel[i]],
                0 if error else int(frames.can_id[i]),
                bool(frames.extended[i]),
                int(frames.flags[i]),
                0 if error else int(frames.length[i]),
                b"" if error else frames.data[i].tobytes().rstrip(b"\0"),
            )
        )
    return found


@pytest.mark.parametrize("suffix", sorted(READERS))
def test_what_is_written_reads_back(tmp_path, suffix):
    kinds = "classical remote fd" if suffix == ".trc" else "classical remote error fd"
    frames = some_frames(kinds)
    path = tmp_path / f"a{suffix}"
    write_log(frames, path)
    log = read_log(path)
    assert (log.rejected, log.truncated_at) == (0, None)
    expected, got = rows(frames, suffix != ".asc"), rows(log.frames, suffix != ".asc")
    if suffix == ".mf4":  # its stamps are float64 seconds
        expected, got = sorted((*r[1:], r[0]) for r in expected), sorted((*r[1:], round(r[0], -3)) for r in got)
    assert got == expected


@pytest.mark.parametrize("suffix", sorted(READERS))
@pytest.mark.parametrize("start_ns", [0, 46408_000_000_000, 4_102_444_800_999_999_000])
def test_any_start_time_is_kept(tmp_path, suffix, start_ns):
    frames = some_frames("classical", start_ns=start_ns)
    path = tmp_path / f"a{suffix}"
    write_log(frames, path)
    np.testing.assert_allclose(read_log(path).frames.time_ns, frames.time_ns, rtol=0, atol=500)


@pytest.mark.parametrize("suffix", sorted(READERS))
def test_a_log_without_a_frame(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_log(FrameBuilder().recording(path, "none").frames, path)
    log = read_log(path)
    assert (len(log.frames), log.rejected, log.truncated_at) == (0, 0, None)


def of_python_can(messages):
    return [
        (m.timestamp, m.arbitration_id, m.is_extended_id, m.is_remote_frame, m.is_error_frame, m.is_fd, bytes(m.data))
        for m in messages
    ]


def of_ours(frames):
    found = []
    for k, (t, _, i, x, f, _, _) in enumerate(rows(frames)):
        remote = bool(f & FrameFlag.REMOTE)
        data = frames.data[k, : 0 if remote else frames.length[k]].tobytes()
        found.append((t / 1e9, i, x, remote, bool(f & FrameFlag.ERROR), bool(f & FD), data))
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
    (".mf4", "classical fd"),
]


@pytest.mark.parametrize(("suffix", "kinds"), CASES)
def test_python_can_reads_what_we_write(tmp_path, suffix, kinds):
    frames = some_frames(kinds)
    path = tmp_path / f"a{suffix}"
    write_log(frames, path)
    with can.LogReader(path) as reader:
        theirs = of_python_can(reader)
    assert_same(theirs, of_ours(frames))


@pytest.mark.parametrize(
    ("suffix", "kinds"),
    [*CASES[:3], (".trc", "classical"), (".mf4", "classical fd"), (".csv", "classical remote error")],
)
def test_we_read_what_python_can_writes(tmp_path, suffix, kinds):  # fmt: skip
    path = tmp_path / f"a{suffix}"
    messages = []
    for (t, i, x, remote, error, fd, data), length in zip(
        of_ours(some_frames(kinds)), some_frames(kinds).length.tolist(), strict=True
    ):
        messages.append(
            can.Message(
                timestamp=t, arbitration_id=i, is_extended_id=x, is_remote_frame=remote, is_error_frame=error,
                is_fd=fd, data=None if remote else data, dlc=length, channel=1, check=True,
            )
        )  # fmt: skip
    writer = can.Logger(path)
    for message in messages:
        writer(message)
    writer.stop()
    log = read_log(path)
    assert (log.rejected, log.truncated_at) == (0, None)
    assert_same(of_python_can(messages), of_ours(log.frames))


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".trc", ".csv"])
@pytest.mark.parametrize("part", [0.35, 0.6, 0.93])
def test_a_cut_file_is_reported_and_the_rest_read(tmp_path, suffix, part):
    frames = some_frames("classical")
    path = tmp_path / f"a{suffix}"
    write_log(frames, path)
    content = path.read_bytes()
    cut = int(len(content) * part)
    while content[cut - 1 : cut] == b"\n" or content[cut : cut + 1] in (b"\n", b"\r"):
        cut -= 1
    path.write_bytes(content[:cut])
    log = read_log(path)
    assert log.truncated_at is not None
    assert 0 <= log.truncated_at <= cut
    assert rows(log.frames)[:-1] == rows(frames)[: max(0, len(log.frames) - 1)]
    if part > 0.5:
        assert len(log.frames) > 5


def test_trc_refuses_error_frames(tmp_path):
    with pytest.raises(LogError, match="12 error frames"):
        write_log(some_frames(), tmp_path / "a.trc")


def test_an_unknown_suffix_is_refused(tmp_path):
    with pytest.raises(LogError, match=r"unknown suffix '\.xyz'"):
        write_log(some_frames(), tmp_path / "a.xyz")


@pytest.mark.parametrize("suffix", sorted(READERS))
@pytest.mark.parametrize("content", [b"hello\nworld\n", b"\0\1\2\n" * 50, b"(1.0) can0 123#xx\n" * 3])
def test_what_is_no_log_is_refused_or_empty(tmp_path, suffix, content):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    if suffix == ".asc":  # most of an ASC log's lines are no frames
        assert len(read_log(path).frames) == 0
        return
    with pytest.raises(LogError, match=re.escape(str(path))):
        read_log(path)


def test_a_missing_file_is_refused_with_its_name(tmp_path):
    with pytest.raises(LogError, match=r"nowhere\.log: cannot be opened"):
        read_log(tmp_path / "nowhere.log")


@pytest.mark.parametrize(
    ("channels", "numbers"),
    [(("can0", "can3"), [0, 3]), (("vehicle", "bench"), [0, 1]), (("can1", "x1"), [0, 1]), (("can1", "x"), [0, 1])],
)
def test_channel_numbers(channels, numbers):
    assert channel_numbers(channels) == numbers


ASC_HEAD = "date Tue Nov 14 10:13:20.123 pm 2023\nbase dec  timestamps relative\n// comment\n"


def test_asc_relative_stamps_in_decimal(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(
        ASC_HEAD + "0.100000 1  291             Rx   d 2 16 255  Length = 1 BitCount = 2 ID = 291\n"
        "0.050000 2  291x            Tx   d 0\n0.1 1  Statistic: D 0 R 0\n0.2 1 J1939TP FEE3p 6 0 0 - Rx d 23\n"
    )
    frames = read_log(path).frames
    assert np.diff(frames.time_ns).tolist() == [50_000_000]
    assert (frames.can_id.tolist(), frames.extended.tolist()) == ([291, 291], [False, True])
    assert frames.data[0, :2].tolist() == [16, 255]
    assert frames.channels == ("can0", "can1")


@pytest.mark.parametrize(
    "line",
    [
        "0.1 1  123             Rx   d 3 11 22",
        "0.1 1  3FFFFFFFx       Rx   d 1 11",
        "0.1 1  800             Rx   d 1 11",
        "0.1 1  123             Rx   d 1 GG",
        "0.1 1  123             Rx   d 1 1FF",
        "0.1 1  123             Rx   q 1 11",
        "0.1 CANFD 1 Rx 123 1 0 f 64 11 22",
    ],
)
def test_asc_rejects_what_is_no_frame(tmp_path, line):
    path = tmp_path / "a.asc"
    head = "base hex  timestamps absolute\n"
    good = "0.1 1  123             Rx   d 1 11\n"
    path.write_text(head + line + "\n" + good)
    log = read_log(path)
    assert (len(log.frames), log.rejected) == (1, 1)
    assert log.first_rejected[0].offset == len(head)


@pytest.mark.parametrize(
    ("head", "line"),
    [
        ("", "     1)     1059     0123  2  11 22\n"),
        (";$FILEVERSION=1.1\n;$STARTTIME=43474.5\n", "     1)     1059.9  Rx         0123  2  11 22\n"),
        (";$FILEVERSION=1.3\n;$STARTTIME=43474.5\n", "     1)     1059.90 1  Rx        0123 -  2    11 22\n"),
        (
            ";$FILEVERSION=2.0\n;$STARTTIME=43474.5\n;$COLUMNS=N,O,T,I,d,l,D\n",
            "     1      1059.900 DT     0123 Rx 2  11 22\n     2   1060.0 ST     Rx    00 00 00 00\n",
        ),
    ],
)
def test_trc_versions(tmp_path, head, line):
    path = tmp_path / "a.trc"
    path.write_text(head + line)
    log = read_log(path)
    assert log.rejected == 0
    assert log.frames.can_id.tolist() == [0x123]
    assert log.frames.data[0, :2].tolist() == [0x11, 0x22]
    start_ns = (43474.5 - 25569) * 86400e9 if head else 0
    assert int(log.frames.time_ns[0]) == pytest.approx(start_ns + 1.0599e9, abs=1e6)


def blf_of(*objects, method=2, stated=None):
    """A BLF file of one container with the given objects."""
    content = b"".join(objects)
    packed = zlib.compress(content) if method == 2 else content
    size = 32 + len(packed)
    container = struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10)
    container += struct.pack("<H6xL4x", method, len(content) if stated is None else stated) + packed + bytes(size % 4)
    head = struct.pack("<4sL8xQQLL16H", b"LOGG", 144, 144 + len(container), 0, 0, 0, *[0] * 16).ljust(144, b"\0")
    return head + container


BODY = struct.pack("<HBBL8s", 1, 0, 8, 0x123, b"12345678")


def blf_object(kind=1, size=48, body=BODY):
    return struct.pack("<4sHHLL", b"LOBJ", 32, 1, size, kind) + struct.pack("<LHHQ", 2, 0, 0, 5) + body


@pytest.mark.parametrize(
    ("content", "frames", "rejected"),
    [
        (blf_of(blf_object(), blf_object()), 2, 0),
        (blf_of(blf_object(), blf_object(), method=0), 2, 0),
        (blf_of(blf_object(), blf_object(size=0), blf_object()), 2, 1),
        (blf_of(blf_object(), b"garbage!" * 3, blf_object()), 2, 1),
        (blf_of(blf_object(), blf_object(kind=65)), 1, 0),
        (blf_of(blf_object(), blf_object(size=40, body=b"\1\0\0\0\1\1\1\1")), 1, 1),
        (blf_of(blf_object(), method=7), 0, 1),
        (blf_of(blf_object(), stated=10), 0, 1),
    ],
)
def test_blf_accounts_for_every_object(tmp_path, content, frames, rejected):
    path = tmp_path / "a.blf"
    path.write_bytes(content + blf_of(blf_object())[144:])  # and a sound container behind it
    log = read_log(path)
    assert (len(log.frames), log.rejected) == (frames + 1, rejected)


def test_blf_is_followed_behind_damage_between_its_containers(tmp_path):
    path = tmp_path / "a.blf"
    container = blf_of(blf_object())[144:]
    path.write_bytes(blf_of(blf_object()) + b"damage" + container + b"LOBJ" + b"\0" * 12 + container)
    log = read_log(path)
    assert (len(log.frames), log.rejected) == (3, 2)
    assert len(blf_of(blf_object())) - log.first_rejected[0].offset <= 3  # padding before it


@pytest.mark.parametrize("content", [b"", b"LOGG", blf_of(blf_object(), stated=2**31)])
def test_blf_that_cannot_be_followed_is_refused(tmp_path, content):
    path = tmp_path / "a.blf"
    path.write_bytes(content)
    with pytest.raises(LogError, match="at byte"):
        read_log(path)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    suffix=st.sampled_from([".log", ".asc", ".blf", ".trc", ".csv", ".parquet"]),
    where=st.floats(0, 1),
    new=st.binary(min_size=0, max_size=6),
    cut=st.integers(0, 6),
)
def test_a_damaged_log_is_read_or_refused(tmp_path, suffix, where, new, cut):
    path = tmp_path / f"a{suffix}"
    write_log(some_frames("classical remote fd"), path)
    content = path.read_bytes()
    at = int(len(content) * where)
    path.write_bytes(content[:at] + new + content[at + cut :])
    with contextlib.suppress(LogError):
        read_log(path)
