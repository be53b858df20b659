"""The compiled passes, numpy, and the same log in pieces: one result."""

import sys

import numpy as np
import pytest
from decoding import as_j1939, assert_same, assert_same_counts, database_of, joined_columns, recording, table_of
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.log.frames import FrameFlag
from hil.log.signals import decode, unknown_ids
from hil.log.signals.decode import Decoder, decode_log

from .test_decode import signal

LENGTHS = (0, 1, 2, 3, 5, 7, 8, 8, 8, 8, 12, 16, 48, 64)


@st.composite
def branches(draw, can_id, n_bytes):
    """SG_ lines of a message: plain signals, a multiplexer with branches, a nested one; then SG_MUL_VAL_ and so on."""
    lines, after = [], []

    def add(name, marker, first_byte):
        kind, text = draw(signal(n_bytes, first_byte))
        low, high = draw(st.sampled_from([("0", "0"), ("-10", "10"), ("0", "100"), ("0.5", "3.25"), ("5", "1e9")]))
        lines.append(f" SG_ {name}{marker} : {text.replace('[0|0]', f'[{low}|{high}]')}")
        if kind != "int":
            after.append(f"SIG_VALTYPE_ {can_id} {name} : {1 if kind == 'f32' else 2};")
        elif draw(st.booleans()):
            values = draw(st.sets(st.sampled_from([0, 1, 2, 3, 7, 15, 255, -1]), min_size=1, max_size=2))
            listed = " ".join(f'{v} "SNA"' for v in values)
            after.append(f'VAL_ {can_id} {name} {listed} 4 "four" ;')

    for number in range(draw(st.integers(0, 3))):
        add(f"S{number}", "", 0)
    if n_bytes > 2 and draw(st.booleans()):
        lines.append(' SG_ MUX M : 0|3@1+ (1,0) [0|0] "" A')
        for i in draw(st.sets(st.integers(0, 7), min_size=1, max_size=3)):
            add(f"B{i}", f" m{i}", 1)
        if draw(st.booleans()):
            lines.append(' SG_ SUB m1M : 8|2@1+ (1,0) [0|0] "" A')
            after.append(f"SG_MUL_VAL_ {can_id} SUB MUX 1-2, 4-4;")
            add("DEEP", " m1", 2)
            after.append(f"SG_MUL_VAL_ {can_id} DEEP SUB 1-2;")
    if not lines:
        add("S", "", 0)
    return lines, after


@st.composite
def databases(draw, groups=False):
    lines, after = [], []
    ids = draw(st.lists(st.sampled_from([1, 2, 0x123, 0x7FF]), max_size=3, unique=True))
    wide = [0x18FEF100, 0x18FEF103, 0x0CF004FE, 0x18EA00FE, 0x18EBFF21, 0x1FFFFFFF]
    ids += [0x80000000 | i for i in draw(st.lists(st.sampled_from(wide), max_size=3, unique=True))]
    for number, can_id in enumerate(ids or [1]):
        n_bytes = draw(st.sampled_from([1, 2, 3, 5, 8, 8, 8, 12, 48, 64]))
        signals, more = draw(branches(can_id, n_bytes))
        lines += [f"BO_ {can_id} M{number}: {n_bytes} A", *signals]
        after += more
    database = database_of(*lines, *after, source=draw(st.sampled_from(["a.dbc", "b.dbc"])))
    return as_j1939(database) if draw(st.booleans()) else database


@st.composite
def frames(draw):
    ids = [1, 2, 3, 0x123, 0x7FF, 0x18FEF100, 0x0CFEF117, 0x0CF00403, 0x18EA2100, 0x18ECFF21, 0x18EBFF21, 0x1FFFFFFF]
    flags = [0] * 12 + [FrameFlag.REMOTE, FrameFlag.ERROR, FrameFlag.ERROR | FrameFlag.REMOTE]
    length = st.sampled_from(LENGTHS[: draw(st.sampled_from([10, 14]))])
    return [
        (
            draw(st.sampled_from(ids)),
            draw(length.flatmap(lambda n: st.binary(min_size=n, max_size=n))),
            draw(st.sampled_from(flags)),
            draw(st.integers(0, 2)),
            draw(st.integers(-5, 5)) * 10**9,
        )
        for _ in range(draw(st.integers(0, 25)))
    ]


CHANNELS = ("can0", "vehicle", "x")


def by_channel(draw):
    several = st.lists(databases(), min_size=1, max_size=2)
    return draw(st.one_of(databases(), several, st.dictionaries(st.sampled_from(CHANNELS), several, max_size=3)))


@settings(max_examples=30, deadline=None)
@given(st.data())
def test_all_ways_agree(data):
    ways_agree(data)


@pytest.mark.slow
@settings(max_examples=700, deadline=None)
@given(st.data())
def test_all_ways_agree_on_many(data):
    ways_agree(data)


def ways_agree(data):
    known = by_channel(data.draw)
    given_frames = data.draw(frames())
    made = recording(given_frames, CHANNELS)
    fast = decode_log(made, known, fast=True)
    assert_same(fast, decode_log(made, known, fast=False))
    assert fast.frames == fast.decoded + fast.unknown + fast.rejected
    assert fast.unknown == sum(fast.unknown_ids.values())
    assert fast.rejected == sum(fast.reasons.values())
    cut = data.draw(st.integers(0, len(given_frames)), "cut")
    pieces = [made.frames.take(slice(0, cut)), made.frames.take(slice(cut, None))]
    for ways in ((True, True), (False, False), (False, True)):
        decoder = Decoder(known)
        logs = []
        for fast_now, piece in zip(ways, pieces, strict=True):
            decoder._fast = fast_now  # as after `FEW_FRAMES`
            logs.append(decoder.add(piece))
        assert_same_counts(decoder.totals, fast)
        whole = joined_columns(logs)
        assert set(whole) == set(fast.columns)
        for name, (rows, values) in whole.items():
            np.testing.assert_array_equal(rows, fast.columns[name].rows)
            np.testing.assert_array_equal(values.view(np.uint64), fast.columns[name].values.view(np.uint64))


DBC = [
    "BO_ 1 M: 8 A",
    ' SG_ S : 0|16@1+ (0.1,0) [0|0] "m" A',
    ' SG_ G : 16|4@1+ (1,0) [0|3] "" A',
    'VAL_ 1 G 0 "P" 1 "D" 4 "fault" 15 "SNA" ;',
    "BO_ 2 N: 8 A",
    ' SG_ S : 0|16@1- (1,0) [0|0] "" A',
]


def test_a_long_log_takes_the_compiled_way_by_itself(monkeypatch):
    monkeypatch.setattr(decode, "FEW_FRAMES", 20_000)
    monkeypatch.delitem(sys.modules, "hil.log.signals.decode_pass", raising=False)
    table = table_of([(1 + i % 3, bytes([i & 255, i >> 8 & 255, i % 16, 0, 0, 0, 0, 0])) for i in range(30_000)])
    decoder = Decoder(database_of(*DBC))
    for begin in range(0, 30_000, 7_000):
        decoder.add(table.take(slice(begin, begin + 7_000)))
        assert ("hil.log.signals.decode_pass" in sys.modules) == (begin >= 14_000)
    careful = Decoder(database_of(*DBC), fast=False)
    careful.add(table)
    assert_same_counts(decoder.totals, careful.totals)
    assert decoder.totals.unknown_ids == {"can0 0x003": 10_000}


def test_a_database_of_many_signals_is_streamed_in_small_pieces(monkeypatch):
    monkeypatch.setattr(decode, "MAX_CELLS", 7)
    table = table_of([(1, bytes([i, 0, i % 3, 0, 0, 0, 0, 0])) for i in range(10)])
    decoder = Decoder(database_of(*DBC))
    logs = list(decoder.stream([table, table.take(slice(0, 0)), table.take(slice(0, 3))]))
    assert [len(log.time_s) for log in logs] == [3, 3, 3, 1, 0, 3]
    np.testing.assert_array_equal(joined_columns(logs[:4])["M.S"][1], np.arange(10) * 0.1)
    assert decoder.totals.messages["M"].count == 13


@pytest.mark.parametrize("fast", [False, True])
def test_only_what_is_wanted_becomes_a_column(fast):
    made = recording([(1, b"\1\0\1\0\0\0\0\0"), (2, b"\2\0\0\0\0\0\0\0")])
    known = database_of(*DBC)
    for wanted, columns in (
        (["M.S"], {"M.S"}),
        (["M"], {"M.S", "M.G"}),
        (["*.S"], {"M.S", "N.S"}),
        ([], set()),
        (["N.?", "M.X"], {"N.S"}),
    ):
        log = decode_log(made, known, wanted, fast)
        assert set(log.columns) == columns
        assert set(log.messages) == set(log.rows) == {"M", "N"}
        assert log.decoded == 2
    assert Decoder(known, ["N.?", "M.X", "M", "Q*"]).unmatched == ("M.X", "Q*")


def test_a_multiplexer_that_is_not_wanted_still_selects():
    known = database_of("BO_ 1 M: 2 A", ' SG_ X M : 0|8@1+ (1,0) [0|0] "" A', ' SG_ Y m1 : 8|8@1+ (1,0) [0|0] "" A')
    log = decode_log(recording([(1, b"\1\5"), (1, b"\2\6")]), known, ["M.Y"])
    assert set(log.columns) == {"M.Y"}
    assert log.columns["M.Y"].values.tolist() == [5]


@pytest.mark.parametrize("fast", [False, True])
def test_distinct_unknown_identifiers_are_bounded(fast, monkeypatch):
    monkeypatch.setattr(unknown_ids, "KEPT", 5)
    decoder = Decoder(database_of(*DBC), fast=fast)
    for begin in (100, 103):
        decoder.add(table_of([(begin + i % 8, b"", 0, 0) for i in range(16)]))
    ids = decoder.totals.unknown_ids
    assert ids == {"can0 0x064": 2, "can0 0x065": 2, "can0 0x066": 2, "can0 0x067": 4, "can0 0x068": 4} | {
        unknown_ids.OTHERS: 18
    }


@pytest.mark.parametrize("fast", [False, True])
def test_a_frame_on_no_channel_is_refused(fast):
    table = table_of([(1, b"\0" * 8), (1, b"\0" * 8, 0, 1)])
    with pytest.raises(ValueError, match=r"frame 1 has channel 1; the table names 1 channels"):
        Decoder(database_of(*DBC), fast=fast).add(table)


@pytest.mark.parametrize("fast", [False, True])
def test_counts_of_a_signal(fast):
    made = recording([(1, bytes([1, 0, g, 0, 0, 0, 0, 0])) for g in (0, 1, 3, 4, 7, 15, 15)])
    log = decode_log(made, database_of(*DBC), fast=fast)
    assert (log.signals["M.G"].n, log.signals["M.G"].sna, log.signals["M.G"].out_of_range) == (7, 2, 1)
    assert (log.signals["M.S"].n, log.signals["M.S"].sna, log.signals["M.S"].out_of_range) == (7, 0, 0)
    assert log.columns["M.G"].names().tolist() == ["P", "D", None, "fault", None]


@pytest.mark.parametrize("fast", [False, True])
def test_rounding_is_not_out_of_range(fast):
    # 3 * 0.1 is 0.30000000000000004
    known = database_of("BO_ 1 M: 1 A", ' SG_ S : 0|8@1+ (0.1,0) [0|0.3] "" A')
    log = decode_log(recording([(1, b"\3"), (1, b"\4")]), known, fast=fast)
    assert log.signals["M.S"].out_of_range == 1


def test_stamps_that_run_back_do_not_change_the_rate():
    known = database_of(*DBC)
    log = decode_log(recording([(1, b"\0" * 8, 0, 0, t) for t in (2 * 10**9, 0, 10**9)]), known, fast=True)
    assert log.messages["M"].rate_hz == pytest.approx(1.0)
