from dataclasses import replace
from datetime import UTC
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_ways import assert_equal, check_mutants, read_both, read_bytes

from hil.log.account import FIRST_REJECTED
from hil.log.builder import FrameBuilder
from hil.log.formats import BY_NAME
from hil.log.frames import FrameFlag, LogError, LogFacts
from hil.log.read import open_log
from hil.log.text import lines
from hil.log.text.candump import candump_names
from hil.log.write import kept, losses

LOGS = Path(__file__).parents[4] / "data" / "logs"
FD, BRS, ESI = FrameFlag.FD, FrameFlag.BIT_RATE_SWITCH, FrameFlag.ERROR_STATE
REMOTE, ERROR, SENT = FrameFlag.REMOTE, FrameFlag.ERROR, FrameFlag.SENT
GOOD = "(1436509052.249713) vcan0 044#2A366C2BBA\n"


@pytest.fixture
def read(tmp_path):
    return lambda content: read_both(tmp_path / "a.log", content, "candump")


def written(table, facts=None):
    """Text of a table."""
    import io

    file = io.BytesIO()
    BY_NAME["candump"].write(file, [table], facts or LogFacts.of([table]), UTC)
    return file.getvalue().decode()


LINES = [
    ("(1.5) can0 7FF#", 0x7FF, False, 0, 0, 1_500_000_000),
    ("(1) can0 000#00", 0, False, 1, 0, 1_000_000_000),
    ("(0000000001.000000001) can0 1FFFFFFF#1122334455667788", 0x1FFFFFFF, True, 8, 0, 1_000_000_001),
    ("(0000000001.000001) can0 7ff#1122334455667788", 0x7FF, False, 8, 0, 1_000_001_000),
    ("(1.5) can0 00000123#aAbB", 0x123, True, 2, 0, 1_500_000_000),
    ("(1.5) can0 123#R", 0x123, False, 0, REMOTE, 1_500_000_000),
    ("(1.5) can0 123#R8", 0x123, False, 8, REMOTE, 1_500_000_000),
    ("(1.5) can0 20000080#0000000000000000", 0x80, False, 8, ERROR, 1_500_000_000),
    ("(1.5) can0 123##1112233", 0x123, False, 3, FD | BRS, 1_500_000_000),
    ("(1.5) can0 123##2" + "00" * 64, 0x123, False, 64, FD | ESI, 1_500_000_000),
    ("(1.5) can0 123##41122334455667788", 0x123, False, 8, FD, 1_500_000_000),
    ("(1.5) can0 123#11 R", 0x123, False, 1, 0, 1_500_000_000),
    ("(1.5) can0 123#11 T", 0x123, False, 1, SENT, 1_500_000_000),
    ("(9000000000.999999) can0 123#1122334455667788 T", 0x123, False, 8, SENT, 9_000_000_000_999_999_000),
    ("(1.5) can0 123#1122334455667788_F", 0x123, False, 8, 0, 1_500_000_000),
    ("(1.5)  can0  123#11\r", 0x123, False, 1, 0, 1_500_000_000),
]


@pytest.mark.parametrize(("line", "can_id", "extended", "length", "flags", "time_ns"), LINES)
def test_each_kind_of_line(read, line, can_id, extended, length, flags, time_ns):
    log, account = read((line + "\n") * 3)
    assert (len(log.frames), account.rejected, account.truncated_at) == (3, 0, None)
    for row in (0, 2):
        assert log.frames.can_id[row] == can_id
        assert log.frames.extended[row] == extended
        assert log.frames.length[row] == length
        assert log.frames.flags[row] == flags
        assert log.frames.time_ns[row] == time_ns
    assert log.frames.channels == ("can0",)


BAD = [
    "nonsense",
    "(1.5) can0 800#00",
    "(1.5) can0 123#0",
    "(1.5) can0 123#112233445566778899",
    "(1.5) can0 123#11223344556677GG",
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
    "(9000000001.000000) can0 123#1122334455667788",
    "(143650905x.249713) can0 123#1122334455667788",
    "(1436509052.24971x) can0 123#1122334455667788",
    "(1.0000000000) can0 123#00",
    "(1.5)can0 123#00",
    "(1.5) can0 123 #00",
    "(1.5) can0 123#00 X",
    "(1.5) c\xe4n0 123#00#",
    "(1.5) can0 123#" + "0" * 5000,
]


@pytest.mark.parametrize("line", BAD)
@pytest.mark.parametrize("copies", [1, 40])
def test_a_bad_line_is_counted_and_ends_nothing(read, line, copies):
    log, account = read(GOOD + (line + "\n") * copies + GOOD)
    assert (len(log.frames), account.rejected, account.truncated_at) == (2, copies, None)
    assert account.first_rejected[0].offset == len(GOOD)
    assert account.first_rejected[0].text.startswith(line[:6])
    assert len(account.first_rejected) == min(copies, FIRST_REJECTED)


@pytest.mark.parametrize("cut", range(1, len(GOOD)))
def test_a_cut_last_line_is_reported(read, cut):
    log, account = read(GOOD * 3 + GOOD[:cut])
    assert len(log.frames) + account.rejected == 4
    assert account.truncated_at == 3 * len(GOOD)


@pytest.mark.parametrize("last", ["123#1122334455667788", "123##0" + "00" * 64, "123#R4"])
def test_a_last_line_that_cannot_go_on_is_whole(read, last):
    log, account = read(GOOD + "(1.5) can0 " + last)
    assert (len(log.frames), account.rejected, account.truncated_at) == (2, 0, None)


def test_an_endless_last_line_is_a_cut_one(read):
    log, account = read(GOOD + "x" * 10_000)
    assert (len(log.frames), account.rejected, account.truncated_at) == (1, 1, len(GOOD))


def test_blank_lines_are_no_frames(read):
    log, account = read("\n" + GOOD + "  \n\r\n" + GOOD + "\n")
    assert (len(log.frames), account.rejected, account.truncated_at) == (2, 0, None)


def test_frames_that_candump_missed_are_said(read):
    log, account = read(GOOD + "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n" + GOOD)
    assert (len(log.frames), account.rejected, dict(account.passed_over)) == (2, 0, {"dropped frames": 1})
    assert "missed frames" in account.notes[0]


def test_channels_keep_their_names(read):
    log, _ = read("(1.0) vehicle 001#00\n(1.0) bench 001#00\n" * 30)
    assert [log.frames.channels[c] for c in log.frames.channel] == ["vehicle", "bench"] * 30
    names = [f"can{k}" for k in range(200)] + ["c\xe4n", "x" * 32, "can"]
    log, account = read("".join(f"(1.0) {name} 001#00\n" for name in names * 2))
    assert (len(log.frames.channels), account.rejected) == (203, 0)
    assert log.frames.channel.tolist() == list(range(203)) * 2


def test_blocks_meet_without_loss(tmp_path, monkeypatch):
    text = "".join(f"({i}.25) can{i % 3} {i % 0x800:03X}#{i:016X}\n" for i in range(700)).encode()
    whole, _ = read_both(tmp_path / "a.log", text, "candump")
    monkeypatch.setattr(lines, "BLOCK_BYTES", 97)
    parts, _ = read_both(tmp_path / "a.log", text, "candump")
    assert len(whole.frames) == 700
    assert_equal(whole.frames, parts.frames)


def test_a_long_log_is_read_in_bounded_tables(tmp_path):
    content = b"(1436509052.249713) can0 044#2A366C2BBA112233\n" * 70_000
    tables, account = read_bytes(tmp_path / "a.log", content, "candump", True)
    assert ([len(table) for table in tables], account.rejected) == ([65_536, 4464], 0)


def test_cases(read):
    def case(name):
        return read((LOGS / name).read_bytes())

    log, _ = case("rx-tx.log")
    assert log.frames.flags.tolist() == [0, SENT]
    log, _ = case("fd.log")
    assert (log.frames.flags.tolist(), log.frames.length.tolist()) == ([FD | BRS, 0], [12, 1])
    assert case("dlc-over-8.log")[0].frames.length.tolist() == [8]
    log, account = case("rtr.log")
    assert (len(log.frames), account.truncated_at) == (1, None)
    log, account = case("cut.log")
    assert (len(log.frames), account.rejected, account.truncated_at) == (200, 0, 9154)  # shorter than it was, perhaps


def test_control_characters_are_escaped(read):
    log, account = read((LOGS / "esc.log").read_bytes())
    assert (len(log.frames), account.first_rejected[0].text) == (1, r"\x1b[31mRED\x1b]0;title\x07 line")
    log, _ = read((LOGS / "chan.log").read_bytes())
    assert log.frames.channels == (r"\x1b[2J\x1b[31mcan0",)


def test_rubbish_is_no_log():
    for name in ("rubbish.log", "empty.log"):
        with pytest.raises(LogError), open_log(LOGS / name):
            pass


TEXT = (
    "(0000000001.500000) can0 123#11\n(0000000001.600000) can1 1FFFFFFF#1122334455667788\n"
    "(0000000001.700000) can0 123##3112233\n(0000000001.800000) can0 123#R4\n"
    "(0000000001.900000) can0 20000004#0011000000000000\n"
)


def test_written_lines_read_back(read):
    assert written(read(TEXT)[0].frames) == TEXT
    directed = TEXT.replace("\n", " R\n", 4)[:-1] + " T\n"
    assert written(read(directed)[0].frames) == directed
    fine = TEXT.replace("00) ", "00123) ")
    assert written(read(fine)[0].frames) == fine


def test_names_that_candump_cannot_hold_are_replaced_and_said(read):
    names = ("my bus", "my_bus", "b\xfcs", "x" * 40, "x" * 41, "", "can0")
    assert candump_names(names) == ("my_bus", "my_bus_2", "b\xfcs", "x" * 32, "x" * 24 + "_2", "_", "can0")
    builder = FrameBuilder()
    for name in names:
        builder.add(1_000_000_000, name, 1, False, b"\1", 0, 0)
    table, form = builder.take(), BY_NAME["candump"]
    facts = LogFacts.of([table])
    assert_equal(read(written(table).encode())[0].frames, kept(table, facts, form))
    assert "'my bus' is my_bus" in " ".join(losses(facts, form))
    assert losses(replace(facts, channels=("can0", "vehicle")), form) == []


def test_channel_names_are_utf_8(read):
    text = "(0000000001.000000) b\xfcs\u65e5 123#11\n"
    frames = read(text.encode())[0].frames
    assert frames.channels == ("b\xfcs\u65e5",)
    assert written(frames) == text
    assert candump_names(("\u65e5" * 11, "\u65e5" * 12)) == ("\u65e5" * 10, "\u65e5" * 8 + "_2")
    assert read(b"(1.5) b\xfcs 123#11\n")[0].frames.channels == ("b\\xfcs",)


def test_many_channels_of_one_name_are_told_apart():
    names = candump_names(tuple(chr(0x4E00 + k) for k in range(5000)))
    assert len(set(names)) == 5000


PIECES = (
    "(1.5)|(12.000001)|(1436509052.249713)| |  |can0|can1|123|7FF|1FFFFFFF|FFFFFFFF|#|##1|R|00|11|A|\r|\t|\xff|(|)| R"
    "|_F|1122334455667788"
)
LINE_PIECES = st.sampled_from(PIECES.split("|"))


@settings(max_examples=150)
@given(st.lists(st.tuples(st.lists(LINE_PIECES, max_size=9).map("".join), st.sampled_from([1, 17])), max_size=8))
def test_both_ways_take_the_same_lines(tmp_path_factory, lines):
    shaped = ["(1.5) can0 123#" + text if i % 2 else text for i, (text, _) in enumerate(lines)]
    many = "".join((text + "\n") * n for text, (_, n) in zip(shaped, lines, strict=True))
    read_both(tmp_path_factory.getbasetemp() / "lines.log", many, "candump")


@settings(max_examples=120)
@given(st.binary(max_size=300).filter(lambda content: content[:2] != b"\x1f\x8b"))  # gzip
def test_any_bytes_are_read(tmp_path_factory, content):
    log, account = read_both(tmp_path_factory.getbasetemp() / "bytes.log", content, "candump")
    assert len(log.frames) + account.rejected == sum(1 for line in content.split(b"\n") if line.strip())


HOSTILE = {
    "line": b"(1.0) can0 123#" + b"11" * 500_000,
    "ends": b"\n" * 1_000_000,
    "returns": b"(1.0) can0 123#11\r" * 60_000,
    "number": b"(" + b"9" * 1_000_000,
    "nul": b"\0" * 1_000_000,
    "blanks": b" " * 1_000_000,
    "short": b"(\n" * 500_000,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_is_answered(tmp_path, name):
    """Each takes a second or two at most; what is quadratic takes minutes."""
    tables, _ = read_bytes(tmp_path / "a.log", HOSTILE[name], "candump", True)
    assert sum(len(table) for table in tables) == 0


MIXED = "".join(line[0] + "\n" for line in LINES) * 2


@pytest.mark.slow
def test_mutants(tmp_path, monkeypatch):
    check_mutants(tmp_path / "a.log", MIXED.encode(), "candump", 2000, 3, monkeypatch)


def test_a_table_of_frames_of_64_bytes_is_written_in_pieces(read):
    builder = FrameBuilder(rows=12_000)
    for i in range(12_000):
        builder.add(i, "can0", i, True, bytes((i + k) % 256 for k in range(64)), FD, 0)
    table = builder.take()
    log, _ = read(written(table))
    np.testing.assert_array_equal(log.frames.data, table.data)
