import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.log import candump
from hil.log.candump import candump_lines, read_candump
from hil.log.frames import FrameFlag


@pytest.fixture
def read(tmp_path):
    def read(text):
        path = tmp_path / "a.log"
        path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
        return read_candump(path)

    return read


GOOD = "(1436509052.249713) vcan0 044#2A366C2BBA\n"


@pytest.mark.parametrize(
    ("line", "can_id", "extended", "length", "flags", "time_ns"),
    [
        ("(1.5) can0 7FF#", 0x7FF, False, 0, 0, 1_500_000_000),
        ("(1) can0 000#00", 0, False, 1, 0, 1_000_000_000),
        ("(0000000001.000000001) can0 1FFFFFFF#1122334455667788", 0x1FFFFFFF, True, 8, 0, 1_000_000_001),
        ("(1.5) can0 00000123#aAbB", 0x123, True, 2, 0, 1_500_000_000),
        ("(1.5) can0 123#R", 0x123, False, 0, FrameFlag.REMOTE, 1_500_000_000),
        ("(1.5) can0 123#R8", 0x123, False, 8, FrameFlag.REMOTE, 1_500_000_000),
        ("(1.5) can0 20000080#0000000000000000", 0x80, False, 8, FrameFlag.ERROR, 1_500_000_000),
        ("(1.5) can0 123##1112233", 0x123, False, 3, FrameFlag.FD | FrameFlag.BIT_RATE_SWITCH, 1_500_000_000),
        ("(1.5) can0 123##2" + "00" * 64, 0x123, False, 64, FrameFlag.FD | FrameFlag.ERROR_STATE, 1_500_000_000),
        ("(1.5) can0 123#11 R", 0x123, False, 1, 0, 1_500_000_000),
        ("(1.5) can0 123#11 T", 0x123, False, 1, 0, 1_500_000_000),
        ("(1.5) can0 123#1122334455667788_F", 0x123, False, 8, 0, 1_500_000_000),
        ("(1.5)  can0  123#11\r", 0x123, False, 1, 0, 1_500_000_000),
    ],
)
@pytest.mark.parametrize("copies", [1, 40], ids=["alone", "many"])  # the line by line path and the array path
def test_each_kind_of_line(read, line, can_id, extended, length, flags, time_ns, copies):
    log = read((line + "\n") * copies)
    assert len(log.frames) == copies
    assert log.rejected == 0
    assert log.truncated_at is None
    for row in (0, copies - 1):
        assert log.frames.can_id[row] == can_id
        assert log.frames.extended[row] == extended
        assert log.frames.length[row] == length
        assert log.frames.flags[row] == flags
        assert log.frames.time_ns[row] == time_ns
    assert log.frames.channels == ("can0",)


@pytest.mark.parametrize(
    "line",
    [
        "nonsense",
        "(1.5) can0 800#00",
        "(1.5) can0 123#0",
        "(1.5) can0 123#112233445566778899",
        "(1.5) can0 123#GG",
        "(1.5) can0 12#00",
        "(1.5) can0 1234#00",
        "(1.5) can0 F0000123#00",
        "(1.5) can0 123##0" + "00" * 9,
        "(1.5) can0 123##0" + "00" * 65,
        "(1.5) can0 123#R9",
        "(-1.5) can0 123#00",
        "(1,5) can0 123#00",
        "(9999999999.0) can0 123#00",
        "(1.0000000000) can0 123#00",
        "(1.5)can0 123#00",
        "(1.5) can0 123 #00",
        "(1.5) can0 123#00 X",
        "(1.5) c\xe4n0 123#00#",
        "(1.5) can0 123#" + "0" * 5000,
    ],
)
@pytest.mark.parametrize("copies", [1, 40], ids=["alone", "many"])
def test_a_bad_line_is_counted_and_ends_nothing(read, line, copies):
    log = read(GOOD + (line + "\n") * copies + GOOD)
    assert len(log.frames) == 2
    assert log.rejected == copies
    assert log.first_rejected[0].offset == len(GOOD)
    assert log.first_rejected[0].text.startswith(line[:6].encode("latin-1").decode("ascii", "backslashreplace")[:6])
    assert len(log.first_rejected) == min(copies, candump.FIRST_REJECTED)
    assert log.truncated_at is None


@pytest.mark.parametrize("cut", range(1, len(GOOD)))
def test_a_cut_last_line_is_reported(read, cut):
    log = read(GOOD * 3 + GOOD[:cut])
    assert len(log.frames) + log.rejected == 4
    assert log.truncated_at == 3 * len(GOOD)


def test_a_last_line_that_cannot_go_on_is_whole(read):
    log = read(GOOD + "(1.5) can0 123#1122334455667788")
    assert (len(log.frames), log.rejected, log.truncated_at) == (2, 0, None)


def test_an_endless_last_line_is_a_cut_one(read):
    log = read(GOOD + "x" * 10_000)
    assert (len(log.frames), log.rejected, log.truncated_at) == (1, 1, len(GOOD))


def test_blank_lines_are_no_frames(read):
    log = read("\n" + GOOD + "  \n\r\n" + GOOD + "\n")
    assert (len(log.frames), log.rejected, log.truncated_at) == (2, 0, None)


def test_channels_keep_their_names(read):
    log = read("(1.0) vehicle 001#00\n(1.0) bench 001#00\n" * 30)
    names = [log.frames.channels[c] for c in log.frames.channel]
    assert names == ["vehicle", "bench"] * 30


def test_blocks_meet_without_loss(read, monkeypatch):
    lines = [f"({i}.25) can{i % 3} {i % 0x800:03X}#{i:016X}\n" for i in range(700)]
    whole = read("".join(lines)).frames
    monkeypatch.setattr(candump, "BLOCK_BYTES", 97)
    parts = read("".join(lines)).frames
    assert len(whole) == len(parts) == 700
    np.testing.assert_array_equal(whole.data, parts.data)
    np.testing.assert_array_equal(whole.time_ns, parts.time_ns)
    assert list(candump_lines(whole)) == list(candump_lines(parts))


PIECES = (
    "(1.5)|(12.000001)| |  |can0|can1|123|7FF|1FFFFFFF|FFFFFFFF|#|##1|R|00|11|A|\r|\t|\xff|(|)| R|_F|1122334455667788"
)
LINE_PIECES = st.sampled_from(PIECES.split("|"))


@settings(max_examples=150)
@given(st.lists(st.tuples(st.lists(LINE_PIECES, max_size=9).map("".join), st.sampled_from([1, 17])), max_size=8))
def test_the_array_path_takes_just_what_the_line_definition_takes(tmp_path_factory, lines):
    folder = tmp_path_factory.getbasetemp()
    path = folder / "lines.log"
    shaped = ["(1.5) can0 123#" + text if i % 2 else text for i, (text, _) in enumerate(lines)]
    many = "".join((text + "\n") * n for text, (_, n) in zip(shaped, lines, strict=True))
    path.write_bytes(many.encode("latin-1"))
    fast = read_candump(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(candump, "SMALL_GROUP", 10**9)  # every line by the definition
        slow = read_candump(path)
    assert list(candump_lines(fast.frames)) == list(candump_lines(slow.frames))
    assert (fast.rejected, fast.first_rejected) == (slow.rejected, slow.first_rejected)


@settings(max_examples=120)
@given(st.binary(max_size=300))
def test_any_bytes_are_read(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "bytes.log"
    path.write_bytes(content)
    log = read_candump(path)
    assert len(log.frames) + log.rejected == sum(1 for line in content.split(b"\n") if line.strip())


def test_written_lines_read_back(read):
    text = (
        "(0000000001.500000) can0 123#11\n(0000000001.600000) can1 1FFFFFFF#1122334455667788\n"
        "(0000000001.700000) can0 123##3112233\n(0000000001.800000) can0 123#R4\n"
        "(0000000001.900000) can0 20000004#0011000000000000\n"
    )
    assert "".join(candump_lines(read(text).frames)) == text
