"""J1939: messages by parameter group, and those that transport frames carry."""

from pathlib import Path

import numpy as np
import pytest
from decoding import as_j1939, assert_same, assert_same_counts, database_of, joined_columns, recording, table_of
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc.database import parse_database
from hil.log.read import read_log
from hil.log.signals import j1939, sources
from hil.log.signals.decode import Decoder, decode_log

DATA = Path(__file__).parents[4] / "data" / "logs"
MS = 10**6


def known(name):
    return as_j1939(parse_database((DATA / name).read_bytes(), name))


@pytest.mark.parametrize("fast", [False, True])
def test_a_group_has_any_source_address(fast):
    log = decode_log(read_log(DATA / "j1939.log"), known("j1939.dbc"), fast=fast)
    assert (log.messages["EEC1"].count, log.decoded, log.unknown) == (3, 3, 0)
    assert {name: column.values.tolist() for name, column in log.columns.items()} == {
        "EEC1.EngineSpeed": [499.375],
        "EEC1@17.EngineSpeed": [1000.0],
        "EEC1@FE.EngineSpeed": [499.375],
    }
    assert [column.source for column in log.columns.values()] == [0x00, 0x17, 0xFE]
    assert log.notes == ("EEC1 comes from the source addresses 00, 17, FE; EEC1 is that of 00",)
    assert log.table("EEC1@17").column("EngineSpeed").to_pylist() == [1000.0]


@pytest.mark.parametrize("fast", [False, True])
def test_a_broadcast_message_is_joined(fast):
    log = decode_log(read_log(DATA / "tp.log"), known("tp.dbc"), fast=fast)
    assert (log.frames, log.decoded, log.unknown, log.rejected) == (4, 4, 0, 0)
    assert (log.messages["DM1"].count, log.messages["DM1"].transported) == (1, 1)
    assert (log.transport.frames, log.transport.joined, log.transport.open) == (4, 1, 0)
    t_s, last = log.series("DM1.Last")
    assert t_s.tolist() == [1.15]
    assert last.tolist() == [0x13]
    assert log.columns["DM1.Lamp"].values.tolist() == [0x40]


LONG = as_j1939(
    database_of(
        "BO_ 2566834942 DM1: 20 A",  # 0x18FECAFE
        ' SG_ First : 0|8@1+ (1,0) [0|0] "" A',
        ' SG_ Last : 152|8@1+ (1,0) [0|0] "" A',
        "BO_ 2565800190 REQUESTED: 9 A",  # 0x18EF00FE: below PDU format 240
        ' SG_ First : 0|8@1+ (1,0) [0|0] "" A',
    )
)
PAYLOAD = bytes(range(20))


def transfer(payload=PAYLOAD, group=0xFECA, source=0, to=0xFF, begin_ms=0, step_ms=50, channel=0):
    """Frames of one transfer, for `table_of`."""
    size, packets = len(payload), -(-len(payload) // 7)
    kind = 0x20 if to == 0xFF else 0x10
    control, data = 0x18EC0000 | to << 8 | source, 0x18EB0000 | to << 8 | source
    opening = bytes([kind, size & 255, size >> 8, packets, 0xFF]) + group.to_bytes(3, "little")
    frames = [(control, opening, 0, channel, begin_ms * MS)]
    for i in range(packets):
        piece = payload[7 * i : 7 * i + 7].ljust(7, b"\xff")
        frames.append((data, bytes([i + 1]) + piece, 0, channel, (begin_ms + (i + 1) * step_ms) * MS))
    return frames


def decoded(frames, database=LONG):
    return decode_log(recording(sorted(frames, key=lambda f: f[4]), ("can0", "can1")), database)


def test_a_message_to_one_node_is_joined_and_matches_whatever_the_destination():
    frames = transfer(PAYLOAD[:9], 0xEF00, source=3, to=0x27)
    cts = (0x18EC0327, bytes([0x11, 2, 1, 0xFF, 0xFF, 0, 0xEF, 0]), 0, 0, 20 * MS)
    end = (0x18EC0327, bytes([0x13, 9, 0, 2, 0xFF, 0, 0xEF, 0]), 0, 0, 120 * MS)
    log = decoded([*frames, cts, end])
    assert log.messages["REQUESTED"].transported == 1
    assert (log.transport.joined, log.transport.frames, log.transport.broken) == (1, 5, {})


def test_transfers_side_by_side_do_not_disturb_one_another():
    frames = [
        *transfer(source=1),
        *transfer(PAYLOAD[::-1], source=2),
        *transfer(PAYLOAD[:9], 0xEF00, source=1, to=2),
        *transfer(PAYLOAD[:9], 0xEF00, source=2, to=1),
        *transfer(PAYLOAD[5:] + PAYLOAD[:5], source=1, channel=1),
    ]
    log = decoded(frames)
    assert (log.transport.joined, log.transport.broken) == (5, {})
    assert log.columns["DM1.First"].values.tolist() == [0, 5]
    assert log.columns["DM1@02.First"].values.tolist() == [19]
    assert log.messages["REQUESTED"].count == 2
    assert log.several_channels


def test_packets_may_come_out_of_order_and_twice():
    opening, one, two, three = transfer()
    log = decoded([opening, (*three[:4], 10 * MS), (*one[:4], 20 * MS), (*one[:4], 30 * MS), (*two[:4], 40 * MS)])
    assert (log.transport.joined, log.transport.broken) == (1, {})
    assert log.columns["DM1.Last"].values.tolist() == [19]


def test_what_breaks_a_transfer_is_counted():
    opening, one, two, three = transfer()
    again = transfer(begin_ms=2000)
    abort = (0x18EC0127, bytes([0xFF, 3, 0xFF, 0xFF, 0xFF, 0, 0xEF, 0]), 0, 0, 60 * MS)
    end = (0x18EC0127, bytes([0x13, 9, 0, 2, 0xFF, 0, 0xEF, 0]), 0, 0, 160 * MS)
    to_one = transfer(PAYLOAD[:9], 0xEF00, source=1, to=0x27)
    for frames, broken, joined in (
        ([opening, one, three], {}, 0),  # still open
        ([opening, one, three, *again], {j1939.LATE: 1}, 1),
        ([opening, one, *transfer(begin_ms=400)], {j1939.REPLACED: 1}, 1),
        ([opening, one, (*two[:4], 801 * MS), (*three[:4], 802 * MS)], {j1939.LATE: 1, j1939.NO_TRANSFER: 2}, 0),
        ([opening, one, (*two[:4], 800 * MS), (*three[:4], 1550 * MS)], {}, 1),
        ([one], {j1939.NO_TRANSFER: 1}, 0),
        ([*to_one[:2], abort, to_one[2]], {j1939.ABORTED: 1, j1939.NO_TRANSFER: 1}, 0),
        ([*to_one[:2], end], {j1939.MISSING: 1}, 0),
        ([*to_one[:2], (*to_one[2][:4], 1300 * MS)], {}, 1),
        ([*to_one[:2], (*to_one[2][:4], 1301 * MS)], {j1939.LATE: 1, j1939.NO_TRANSFER: 1}, 0),
        ([opening, (one[0], b"\0" + one[1][1:], 0, 0, 50 * MS)], {j1939.NO_PACKET: 1}, 0),
        ([opening, (one[0], b"\4" + one[1][1:], 0, 0, 50 * MS)], {j1939.NO_PACKET: 1}, 0),
        ([opening, (one[0], b"\1\1", 0, 0, 50 * MS), one, two, three], {j1939.NO_PACKET: 1}, 1),
        ([(opening[0], opening[1][:7], 0, 0, 0)], {j1939.NO_ANNOUNCEMENT: 1}, 0),
        ([(opening[0], b"\x20\x08\0\2\xff\xca\xfe\0", 0, 0, 0)], {j1939.NO_ANNOUNCEMENT: 1}, 0),
        ([(opening[0], b"\x20\xfa\x06\xff\xff\xca\xfe\0", 0, 0, 0)], {j1939.NO_ANNOUNCEMENT: 1}, 0),
        ([(opening[0], b"\x10\x14\0\3\xff\xca\xfe\0", 0, 0, 0)], {j1939.NO_ANNOUNCEMENT: 1}, 0),
    ):
        log = decoded(frames)
        assert (dict(log.transport.broken), log.transport.joined) == (broken, joined), frames
        assert log.decoded == log.frames


def test_the_last_packet_may_be_no_longer_than_its_share():
    *frames, last = transfer()
    log = decoded([*frames, (last[0], last[1][:7], 0, 0, last[4])])
    assert log.columns["DM1.Last"].values.tolist() == [19]


def test_the_longest_message_is_joined():
    log = decoded(transfer(bytes(i % 251 for i in range(1785)), step_ms=1))
    assert log.columns["DM1.Last"].values.tolist() == [19]
    assert log.messages["DM1"].longer == 1


def test_a_short_frame_and_a_joined_message_are_one_message():
    log = decoded([(0x18FECA00, b"\x40\0\0\0\0\0\xff\xff", 0, 0, 10 * MS), *transfer(begin_ms=100)])
    assert (log.messages["DM1"].count, log.messages["DM1"].short) == (2, 1)
    assert log.columns["DM1.First"].values.tolist() == [0x40, 0]
    assert log.columns["DM1.First"].rows.tolist() == [0, 4]
    assert log.columns["DM1.Last"].values.tolist() == [19]
    assert log.table("DM1").column("Last").to_pylist() == [None, 19]


def test_a_joined_message_that_no_database_has_is_counted():
    log = decoded(transfer(group=0xFEDA))
    assert (log.transport.joined, log.transport.unknown) == (1, {"can0 PGN 0xfeda": 1})
    assert (log.decoded, log.unknown) == (4, 0)


def test_without_a_j1939_message_transport_frames_are_unknown():
    plain = database_of("BO_ 2566834942 DM1: 20 A", ' SG_ First : 0|8@1+ (1,0) [0|0] "" A')
    log = decode_log(recording(transfer()), plain)
    assert (log.decoded, log.unknown, log.transport.frames) == (0, 4, 0)


def test_transfers_under_way_are_bounded(monkeypatch):
    monkeypatch.setattr(j1939, "MAX_TRANSFERS", 3)
    log = decoded([transfer(source=i, begin_ms=i)[0] for i in range(5)])
    assert log.transport.open == 3
    assert log.transport.broken == {j1939.TOO_MANY: 2}


def test_sources_told_apart_are_bounded(monkeypatch):
    monkeypatch.setattr(sources, "MAX_SOURCES", 1)
    log = decoded([(0x18FECA00 | i, bytes([i, 0, 0, 0, 0, 0, 0, 0]), 0, 0, i) for i in range(4)])
    log.columns = {name: column for name, column in log.columns.items() if name.endswith("First")}
    assert {name: column.values.tolist() for name, column in log.columns.items()} == {
        "DM1.First": [0], "DM1@01.First": [1], "DM1@other.First": [2, 3],
    }  # fmt: skip
    assert log.columns["DM1@other.First"].source is None


def test_a_wanted_source_is_the_only_column():
    made = read_log(DATA / "j1939.log")
    assert set(decode_log(made, known("j1939.dbc"), ["EEC1@17.EngineSpeed"]).columns) == {"EEC1@17.EngineSpeed"}
    assert len(decode_log(made, known("j1939.dbc"), ["EEC1.EngineSpeed"]).columns) == 3
    assert Decoder(known("j1939.dbc"), ["EEC1@17.EngineSpeed", "EEC2@17.*"]).unmatched == ("EEC2@17.*",)


def test_the_own_identifier_of_a_message_goes_before_its_group():
    database = as_j1939(
        database_of(
            "BO_ 2566834688 FROM_0: 8 A",  # 0x18FECA00
            ' SG_ S : 0|8@1+ (1,0) [0|0] "" A',
            "BO_ 2566834691 FROM_3: 8 A",
            ' SG_ S : 0|8@1+ (2,0) [0|0] "" A',
        )
    )
    base = 2566834688 & 0x1FFFFFFF
    frames = [(base, b"\1" * 8), (base + 3, b"\1" * 8), (base + 3 & 0x3FFFFFF, b"\2" * 8), (base + 9, b"\3" * 8)]
    log = decode_log(recording(frames), database)
    assert log.messages["FROM_0"].count == 2  # source 9 has no message of its own
    assert log.columns["FROM_3.S"].values.tolist() == [2, 4]


@st.composite
def control(draw):
    kind = draw(st.sampled_from([0x10, 0x11, 0x13, 0x20, 0xFF, 0x55]))
    size = draw(st.sampled_from([8, 9, 14, 20, 1785, 1786]))
    packets = draw(st.sampled_from([-(-size // 7) & 255, 1, 0, 255]))
    group = draw(st.sampled_from([b"\xca\xfe\0", b"\0\xef\0", b"\xff\xff\xff"]))
    return bytes([kind, size & 255, size >> 8, packets, 0xFF]) + group


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_any_frames_are_accounted_for_in_one_piece_or_in_several(data):
    address = st.sampled_from([0, 1, 0xFF])
    frames, now = [], 0
    for _ in range(data.draw(st.integers(0, 40), "frames")):
        now += data.draw(st.sampled_from([0, 10, 10, 10, 751, 1251, -20]))
        ends = data.draw(address) << 8 | data.draw(address)
        if data.draw(st.integers(0, 3)) == 0:
            payload, can_id = data.draw(control()), 0x18EC0000 | ends
        else:
            payload = bytes([data.draw(st.integers(0, 3))]) + data.draw(st.binary(min_size=1, max_size=7))
            can_id = 0x1CEB0000 | ends
        frames.append((can_id, payload, 0, data.draw(st.integers(0, 1)), now * MS))
    frames += transfer(source=9, begin_ms=now)
    table = table_of(frames, ("can0", "can1"))
    whole = decode_log(recording(frames, ("can0", "can1")), LONG, fast=True)
    assert_same(whole, decode_log(recording(frames, ("can0", "can1")), LONG, fast=False))
    assert whole.decoded == whole.frames == whole.transport.frames
    cut = data.draw(st.integers(0, len(frames)))
    decoder = Decoder(LONG, fast=True)
    logs = [decoder.add(table.take(slice(0, cut))), decoder.add(table.take(slice(cut, None)))]
    assert_same_counts(decoder.totals, whole)
    for name, (rows, values) in joined_columns(logs).items():
        np.testing.assert_array_equal(rows, whole.columns[name].rows)
        np.testing.assert_array_equal(values, whole.columns[name].values)


def test_the_group_of_a_message_to_one_address_has_no_address():
    log = decoded(transfer(bytes(20), 0xEE00, to=0x33))
    assert log.transport.unknown == {"can0 PGN 0xee00": 1}


def test_a_table_without_frames_leaves_open_transfers_open():
    frames = transfer()[:2]
    table = table_of(frames)
    decoder = Decoder(LONG)
    decoder.add(table)
    assert decoder.totals.transport.open == 1
    decoder.add(table.take(slice(2, None)))
    assert decoder.totals.transport.open == 1
