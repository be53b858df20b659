"""What the viewer makes of frames, held against the typed codec and the decoder of logs."""

import json
import math

import numpy as np
import pytest

from dbc.contract import contract
from dbc.database import parse_database
from dbc.e2e import COUNTER_MODULUS, protect
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bench.wire_timing import table_of
from hil.live.feed import MOST_MESSAGES, MOST_ROWS, Feed
from hil.log.signals.databases import Databases
from hil.log.signals.decode import Decoder, own_databases

STRANGE = """VERSION ""
BU_: A
BO_ 256 MIXED: 8 A
 SG_ MUX M : 0|4@1+ (1,0) [0|15] "" A
 SG_ ONE m1 : 8|12@1- (0.5,-3) [0|0] "V" A
 SG_ TWO m2 : 15|16@0- (0.25,1) [0|0] "A" A
 SG_ BIG : 39|16@0+ (1,0) [0|0] "" A
BO_ 257 FLOAT: 4 A
 SG_ REAL : 0|32@1- (2,1) [0|0] "" A
SIG_VALTYPE_ 257 REAL : 1;
"""


def feed_of(text=None):
    own = Databases.own()
    return Feed(own if text is None else Databases.joined([parse_database(text)], {}), own)


def rows_of(feed):
    """Values by message name, row by row, of the news."""
    news = feed.news()
    found = {} if news is None else json.loads(news)["rows"]
    return {feed.messages[int(number)].name: rows for number, rows in found.items()}


@pytest.mark.parametrize("bus", list(BusName))
def test_our_messages_read_as_the_decoder_of_logs_reads_them(bus):
    random = np.random.default_rng(54)
    specs = contract(bus).by_id.values()
    frames = [
        Frame(bus, spec.can_id, random.bytes(spec.length), 1_000_000 * n)
        for n, spec in enumerate([one for one in specs for _ in range(MOST_ROWS)])
    ]
    frames = [
        f if contract(bus).by_id[f.can_id].data_id is None else f._replace(data=_protected(bus, f, n))
        for n, f in enumerate(frames)
    ]
    feed = feed_of()
    feed.hear(frames)
    got = rows_of(feed)
    log = Decoder(own_databases()).add(table_of(frames))
    compared = 0
    for live in feed.messages:
        if live.bus != bus.value or live.name not in got:
            continue
        for place, signal in enumerate(live.signals):
            column = log.columns.get(f"{live.name}.{signal.name}")
            expected = [] if column is None else np.asarray(column.values, float).tolist()
            values = [row[place + 1] for row in got[live.name]]
            numbers = [math.nan if v is None else v for v in values]
            if column is not None and len(expected) == len(numbers):
                np.testing.assert_allclose(numbers, expected, rtol=1e-6)
                compared += len(numbers)
    assert compared > 200


def _protected(bus, frame, number):
    spec = contract(bus).by_id[frame.can_id]
    return protect(spec.data_id, bytearray(frame.data), number % COUNTER_MODULUS)


def test_a_strangers_database_is_read_with_its_multiplexer_byte_orders_and_floats():
    feed = feed_of(STRANGE)
    payloads = [bytes([1, 0xFE, 0x0F, 0, 0x12, 0x34, 0, 0]), bytes([2, 0xFF, 0xFC, 0, 0, 7, 0, 0])]
    frames = [Frame(BusName.VEHICLE, 256, data, 1000 * n) for n, data in enumerate(payloads)]
    frames.append(Frame(BusName.VEHICLE, 257, bytes.fromhex("0000c03f"), 3000))
    frames.append(Frame(BusName.VEHICLE, 257, bytes.fromhex("0000c07f"), 4000))  # not a number
    feed.hear(frames)
    rows = rows_of(feed)
    names = [signal.name for signal in feed.messages[0].signals]
    mixed = [dict(zip(names, row[1:], strict=True)) for row in rows["MIXED"]]
    assert mixed == [
        {"MUX": 1, "ONE": 0.5 * -2 - 3, "TWO": None, "BIG": 0x1234},
        {"MUX": 2, "ONE": None, "TWO": 0.25 * -4 + 1, "BIG": 7},
    ]
    assert [row[1] for row in rows["FLOAT"]] == [4.0, None]


def test_a_frame_that_fails_its_check_or_is_short_gives_no_values_and_shows():
    feed = feed_of()
    good = [_pedal(counter) for counter in range(3)]
    feed.hear(good)
    assert len(rows_of(feed)["BRAKE_PEDAL"]) == 3
    feed.hear([good[0]._replace(data=b"\0" + good[0].data[1:]), good[0]._replace(data=good[0].data[:5])])
    assert rows_of(feed) == {}
    state = json.loads(feed.state(10_000_000_000, {}))
    row = next(row for row in state["rows"] if feed.messages[row[0]].name == "BRAKE_PEDAL")
    assert row[1] == 5
    assert row[5:] == ["WRONG_CRC", False, 0, 2]


def test_between_two_updates_the_newest_of_a_message_are_kept():
    feed = feed_of()
    feed.hear([_pedal(n) for n in range(40)])
    rows = rows_of(feed)["BRAKE_PEDAL"]
    assert len(rows) == MOST_ROWS
    assert rows[-1][0] == pytest.approx(0.39)
    assert feed.news() is None


def test_cycle_load_and_link_events():
    feed = feed_of()
    feed.state(0, {})
    feed.hear([_pedal(n) for n in range(100)])
    feed.hear([LinkEvent(BusName.VEHICLE, LinkState.BUS_OFF, 5, 1, "by itself")])
    state = json.loads(feed.state(1_000_000_000, {"armed": []}))
    row = next(row for row in state["rows"] if feed.messages[row[0]].name == "BRAKE_PEDAL")
    assert row[2] == pytest.approx(10.0)
    assert state["load"] == pytest.approx(100 * 135 / 500_000, abs=1e-4)  # 135 bits with all stuff bits
    assert state["events"] == ["vehicle: bus_off by itself"]
    assert not state["bench"]


def test_a_bus_full_of_noise_fills_no_memory():
    feed = feed_of()
    feed.hear([Frame(BusName.VEHICLE, n, b"", 0, True) for n in range(2 * MOST_MESSAGES)])
    assert len(feed.messages) == MOST_MESSAGES
    assert feed.further > 0


def _pedal(number):
    spec = next(one for one in contract(BusName.VEHICLE).by_id.values() if one.name == "BRAKE_PEDAL")
    return Frame(BusName.VEHICLE, spec.can_id, spec.encode((0.5, 0.5), number % 15), 10_000_000 * number)
