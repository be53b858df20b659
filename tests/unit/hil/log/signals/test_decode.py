import struct
from pathlib import Path

import cantools
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dbc.contract import database_text
from dbc.database import parse_database
from dbc.frame import BusName
from hil.log.frames import FrameFlag, FrameTable, Recording
from hil.log.signals.decode import NOT_A_FRAME, TOO_SHORT, decode_log, own_databases


def recording(frames, channels=("can0",)):
    """frames: (can_id, data) or (can_id, data, flags, channel)."""
    width = 64 if any(len(f[1]) > 8 for f in frames) else 8
    table = FrameTable.empty(len(frames), width, channels)
    for row, (can_id, data, *rest) in enumerate(frames):
        table.time_ns[row] = row * 10_000_000
        table.can_id[row] = can_id & 0x1FFFFFFF
        table.extended[row] = can_id > 0x7FF
        table.length[row] = len(data)
        table.data[row, : len(data)] = list(data)
        table.flags[row] = rest[0] if rest else 0
        table.channel[row] = rest[1] if len(rest) > 1 else 0
    return Recording(Path("memory"), "candump", table)


def dbc_of(*messages):
    return 'VERSION ""\nBU_: A\n' + "\n".join(messages)


@st.composite
def signal(draw, n_bytes, first_byte=0):
    """A signal anywhere in the payload, as the text of its SG_ line behind the name."""
    size = 8 * (n_bytes - first_byte)
    kind = draw(st.sampled_from(["int", "int", "int", "f32", "f64"]))
    length = {"int": draw(st.integers(1, min(64, size))), "f32": 32, "f64": 64}[kind]
    if length > size:
        kind, length = "int", size
    first = draw(st.integers(0, size - length)) + 8 * first_byte
    big = draw(st.booleans())
    start = 8 * (first // 8) + 7 - first % 8 if big else first
    sign = draw(st.sampled_from("+-"))
    factor = draw(st.sampled_from(["1", "2", "0.01", "-0.5", "1.0", "0.0155168902", "1E-05", "1000"]))
    offset = draw(st.sampled_from(["0", "-40", "-67.67", "5"]))
    text = f'{start}|{length}@{0 if big else 1}{sign} ({factor},{offset}) [0|0] "u" A'
    return kind, text


@st.composite
def database_and_frames(draw):
    """Messages of one signal each, or of a multiplexer in byte 0 with one signal a branch."""
    lines, float_types, frames = [], [], []
    for number in range(draw(st.integers(1, 6))):
        n_bytes = draw(st.sampled_from([1, 2, 3, 5, 8, 8, 8, 12, 64]))
        can_id = draw(st.sampled_from([0x100, 0x80000000 | 0x18DA00F1])) + number
        lines.append(f"BO_ {can_id} M{number}: {n_bytes} A")
        parts = [("S", draw(signal(n_bytes)))]
        if n_bytes > 1 and draw(st.booleans()):
            lines.append(' SG_ MUX M : 0|8@1+ (1,0) [0|0] "" A')
            ids = sorted(draw(st.sets(st.integers(0, 255), min_size=1, max_size=4)))
            parts = [(f"S{i} m{i}", draw(signal(n_bytes, 1))) for i in ids]
        for name, (kind, text) in parts:
            lines.append(f" SG_ {name} : {text}")
            if kind != "int":
                float_types.append(f"SIG_VALTYPE_ {can_id} {name.split()[0]} : {1 if kind == 'f32' else 2};")
        frames += [
            (can_id & 0x7FFFFFFF, draw(st.binary(min_size=n_bytes, max_size=n_bytes)))
            for _ in range(draw(st.integers(1, 4)))
        ]
    return dbc_of(*lines, *float_types), frames


def _by_a_whole_factor(signal):
    """Whole numbers times one: cantools multiplies exactly and rounds once, numbers of 64 bits are rounded before."""
    return not signal.is_float and float(signal.scale).is_integer()


@example(case=(
    dbc_of('BO_ 257 M1: 12 A\n SG_ S : 24|57@1+ (1000,-67.67) [0|0] "u" A'),
    [(257, bytes.fromhex("000000050000000000000100"))],
))  # fmt: skip
@pytest.mark.parametrize("fast", [False, True])
@settings(max_examples=120)
@given(case=database_and_frames())
def test_values_equal_cantools(case, fast):
    text, frames = case
    oracle = cantools.database.load_string(text, database_format="dbc", strict=False)
    database = parse_database(text)
    assert not database.warnings
    log = decode_log(recording(frames), database, fast=fast)
    assert log.decoded == len(frames)
    cells = {}
    for name, column in log.columns.items():
        for row, value in zip(column.rows, column.values, strict=True):
            cells.setdefault(int(row), {})[name.split(".")[1]] = value
    for row, (can_id, data) in enumerate(frames):
        message = oracle.get_message_by_frame_id(can_id, force_extended_id=can_id > 0x7FF)
        try:
            expected = message.decode(data, decode_choices=False)
        except cantools.database.DecodeError:  # a multiplexer value without a branch: only the multiplexer is there
            expected = {"MUX": data[0]}
        assert set(cells[row]) == set(expected)
        for name, value in expected.items():
            got = cells[row][name]
            if isinstance(value, int) and not isinstance(got, np.floating):
                assert int(got) == value
            elif isinstance(value, int):  # beyond 64 bits: a float, rounded twice
                np.testing.assert_array_max_ulp(float(got), float(value), 1)
            elif abs(value) > 2**53 and _by_a_whole_factor(message.get_signal_by_name(name)):
                np.testing.assert_array_max_ulp(float(got), float(value), 2)
            else:
                np.testing.assert_array_equal(float(got), float(value))


def test_extended_multiplexing_follows_the_chain():
    text = dbc_of(
        "BO_ 1 M: 8 A",
        ' SG_ PAGE M : 0|8@1+ (1,0) [0|0] "" A',
        ' SG_ SUB m1M : 8|8@1+ (1,0) [0|0] "" A',
        ' SG_ DEEP m5 : 16|8@1+ (1,0) [0|0] "" A',
        "SG_MUL_VAL_ 1 SUB PAGE 1-2, 4-4;",
        "SG_MUL_VAL_ 1 DEEP SUB 5-6;",
    )
    frames = [(1, bytes([page, sub, 9, 0, 0, 0, 0, 0])) for page, sub in ((1, 5), (1, 7), (3, 5), (4, 6))]
    log = decode_log(recording(frames), parse_database(text))
    assert log.columns["M.PAGE"].rows.tolist() == [0, 1, 2, 3]
    assert log.columns["M.SUB"].rows.tolist() == [0, 1, 3]
    assert log.columns["M.DEEP"].rows.tolist() == [0, 3]


def test_whole_numbers_beyond_a_float_stay_exact():
    text = dbc_of(
        "BO_ 1 M: 8 A", ' SG_ S : 0|64@1+ (1,0) [0|0] "" A', "BO_ 2 N: 8 A", ' SG_ S : 0|64@1- (1,0) [0|0] "" A'
    )
    log = decode_log(recording([(1, b"\xff" * 8), (2, struct.pack("<q", -(2**63) + 1))]), parse_database(text))
    assert int(log.columns["M.S"].values[0]) == 2**64 - 1
    assert int(log.columns["N.S"].values[0]) == -(2**63) + 1


def test_every_frame_is_accounted_for():
    text = dbc_of("BO_ 256 M: 4 A", ' SG_ S : 0|8@1+ (1,0) [0|0] "" A')
    frames = [
        (256, b"\1\0\0\0"),
        (256, b"\1\0\0\0\0\0"),  # longer than the DBC says: the message is there
        (256, b"\2\0\0"),  # shorter: what it has is there
        (256, b""),
        (257, b"\1"),
        (0x18000100, b"\1\0\0\0"),
        (256, b"", FrameFlag.REMOTE),
        (4, b"\0" * 8, FrameFlag.ERROR),
    ]
    made = recording(frames)
    log = decode_log(Recording(made.path, made.format, made.frames, rejected=3), parse_database(text))
    assert (log.frames, log.decoded, log.unknown, log.rejected) == (11, 3, 4, 4)
    assert log.reasons == {NOT_A_FRAME: 3, TOO_SHORT: 1}
    assert log.unknown_ids == {"can0 0x101": 1, "can0 0x18000100": 1, "remote frame": 1, "error frame": 1}
    assert (log.messages["M"].count, log.messages["M"].short, log.messages["M"].longer) == (3, 1, 1)
    assert log.messages["M"].rate_hz == pytest.approx(100.0)
    assert log.notes == ("M: frames shorter than the database says", "M: frames longer than the database says")
    t, values = log.series("M.S")
    assert t.tolist() == [0.0, 0.01, 0.02]
    assert values.tolist() == [1, 1, 2]


def test_signal_not_available_is_an_empty_cell():
    text = dbc_of("BO_ 1 M: 2 A", ' SG_ S : 0|16@1- (0.1,0) [0|0] "" A', 'VAL_ 1 S -32768 "SNA" ;')
    log = decode_log(recording([(1, b"\0\0"), (1, b"\0\x80"), (1, b"\x0a\0")]), parse_database(text))
    assert log.columns["M.S"].rows.tolist() == [0, 2]
    assert log.columns["M.S"].values.tolist() == [0.0, 1.0]


def test_each_channel_has_its_database():
    a = parse_database(dbc_of("BO_ 1 M: 1 A", ' SG_ S : 0|8@1+ (1,0) [0|0] "" A'))
    b = parse_database(dbc_of("BO_ 1 N: 1 A", ' SG_ S : 0|8@1+ (2,0) [0|0] "" A'))
    made = recording([(1, b"\1", 0, 0), (1, b"\1", 0, 1), (1, b"\1", 0, 2)], ("vehicle", "bench", "can3"))
    log = decode_log(made, {"vehicle": a, "bench": b})
    assert log.columns["M.S"].rows.tolist() == [0, 2]
    assert log.columns["N.S"].values.tolist() == [2]
    assert log.several_channels
    log = decode_log(made, {"bench": b})
    assert (log.decoded, log.unknown) == (1, 2)


def test_one_name_in_two_databases_stays_apart():
    a = parse_database(dbc_of("BO_ 1 M: 1 A", ' SG_ S : 0|8@1+ (1,0) [0|0] "" A'))
    b = parse_database(dbc_of("BO_ 2 M: 1 A", ' SG_ S : 0|8@1+ (2,0) [0|0] "" A'))
    log = decode_log(recording([(1, b"\1", 0, 0), (2, b"\1", 0, 1)], ("x", "y")), {"x": a, "y": b})
    assert set(log.columns) == {"M.S", "M@y.S"}


def test_our_own_databases_load_without_a_warning():
    for database in own_databases().values():
        assert database.warnings == ()
        assert database.messages


@pytest.mark.slow
@pytest.mark.parametrize("bus", list(BusName))
def test_ten_thousand_payloads_of_each_of_our_messages_equal_cantools(bus):
    text = database_text(bus)
    oracle = cantools.database.load_string(text, database_format="dbc", strict=False)
    database, draw = parse_database(text), np.random.default_rng(1)
    for message in oracle.messages:
        n = 10_000
        table = FrameTable.empty(n, 8, ("can0",))
        table.can_id[:], table.length[:] = message.frame_id, message.length
        edges = draw.choice(np.array([0, 1, 127, 128, 254, 255], np.uint8), (n, message.length))
        noise = draw.integers(0, 256, (n, message.length), np.uint8)
        table.data[:, : message.length] = np.where(draw.random((n, 1)) < 0.3, edges, noise)
        log = decode_log(Recording(Path("memory"), "candump", table), database)
        assert log.decoded == n
        expected = [message.decode(row[: message.length].tobytes()) for row in table.data]
        for signal in message.signals:
            wanted = {
                row: getattr(values[signal.name], "value", values[signal.name])
                for row, values in enumerate(expected)
                if str(values[signal.name]) != "SNA"
            }
            column = log.columns[f"{message.name}.{signal.name}"]
            assert column.rows.tolist() == list(wanted)
            assert column.values.tolist() == list(wanted.values())


def test_an_empty_log_decodes_to_nothing():
    log = decode_log(recording([]))
    assert (log.frames, log.decoded, log.columns) == (0, 0, {})
