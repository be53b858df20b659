"""Rest-bus: cycle times, start values, counters and check values; edited live."""

import cantools
import numpy as np
import pytest
from any_dbc import TEXT
from e2e import p01, p05

from dbc.contract import database_text, spec_of
from dbc.exchange import Receiver
from dbc.frame import BusName
from dbc.messages import BatteryStatus
from hil.gateway.database import load
from hil.gateway.error import GatewayError
from hil.gateway.restbus import RestBus, sendings, unprotected

ORACLE = cantools.database.load_string(TEXT, "dbc")
SETTINGS = """
[send.COUNTED]
protection = { profile = 5, data_id = 0x1234, offset = 2 }
counter = { signal = "COUNTER", modulus = 15 }
start.STATE = "OFF"
[send.MIXED]
cycle_ms = 5
protection = { sum = "toyota" }
"""


@pytest.fixture
def make(tmp_path):
    def restbus(*nodes, settings=None, text=TEXT):
        (tmp_path / "any.dbc").write_text(text)
        if settings is not None:
            (tmp_path / "set.toml").write_text(settings)
        chosen = sendings(load(tmp_path / "any.dbc"), nodes, None if settings is None else tmp_path / "set.toml")
        return RestBus(chosen), chosen

    return restbus


def run(restbus, milliseconds, first_ms=0):
    """(time in ms, frame) of all that is sent."""
    return [
        (ms, frame) for ms in range(first_ms, first_ms + milliseconds) for frame in restbus.step(ms * 1_000_000, [])
    ]


def test_cycle_times_and_start_values_of_the_database(make):
    restbus, chosen = make("ABS", "PCM")
    sent = run(restbus, 200)
    for message in ORACLE.messages:
        times = [ms for ms, frame in sent if frame.can_id == message.frame_id]
        if not message.cycle_time or message.length > 8:
            assert times == []
            continue
        assert set(np.diff(times)) == {message.cycle_time}
        frame = next(f for _, f in sent if f.can_id == message.frame_id)
        assert frame.extended == message.is_extended_frame
        values = message.decode(frame.data, scaling=False, decode_choices=False)
        assert values == {name: message.get_signal_by_name(name).raw_initial or 0 for name in values}
    assert unprotected(chosen) == ["COUNTED.COUNTER"]


def test_counters_check_values_and_settings(make):
    restbus, chosen = make("ABS", settings=SETTINGS)
    sent = run(restbus, 500)
    counted = [frame.data for _, frame in sent if frame.can_id == 102]
    assert [data[1] & 0x0F for data in counted] == [k % 15 for k in range(20)]
    assert [data[4] for data in counted] == list(range(20))
    assert all(p05.e2e_p05_check(data, 0x1234, offset=2) for data in counted)
    assert all(ORACLE.get_message_by_name("COUNTED").decode(data)["STATE"] == "OFF" for data in counted)
    mixed = [(ms, frame.data) for ms, frame in sent if frame.can_id == 100]
    assert set(np.diff([ms for ms, _ in mixed])) == {5}
    assert all(data[-1] == (8 + 100 + sum(data[:-1])) & 0xFF for _, data in mixed)
    assert unprotected(chosen) == []


def test_our_own_database_needs_no_settings(make):
    restbus, _ = make("BATTERY", text=database_text(BusName.VEHICLE))
    assert restbus.edit("BATTERY_STATUS.STATE_OF_CHARGE=55") == "BATTERY_STATUS.STATE_OF_CHARGE = 55 %"
    restbus.edit("BATTERY_STATUS.CHARGE_POWER_LIMIT=80")
    receiver = Receiver([BatteryStatus])
    for ms, frame in run(restbus, 1000):
        assert p01.e2e_p01_check(bytearray(frame.data), spec_of(BatteryStatus).data_id)
        receiver.accept(ms * 1_000_000, [frame])
    assert receiver.latest(BatteryStatus) == (0.55, 80e3)
    assert (receiver.lost, receiver.corrupt) == (0, 0)


def test_edits(make):
    restbus, _ = make("ABS", "PCM")
    message = ORACLE.get_message_by_name("MIXED")

    def latest(can_id, first_ms):
        return [frame.data for _, frame in run(restbus, 100, first_ms) if frame.can_id == can_id]

    assert restbus.edit(" MIXED.BIG = -50.5 ") == "MIXED.BIG = -50.5 km/h"
    assert message.decode(latest(100, 0)[-1])["BIG"] == pytest.approx(-50.5)
    restbus.edit("COUNTED.STATE=READY")
    assert ORACLE.get_message_by_name("COUNTED").decode(latest(102, 100)[-1])["STATE"] == "READY"
    assert latest(103, 200) == []
    restbus.edit("EVENT.DOOR=2")
    assert latest(103, 300) == [b"\x02\x00"]
    restbus.edit("MUXED.PAGE=1")
    restbus.edit("MUXED.ON_1=1.25")
    muxed = ORACLE.get_message_by_name("MUXED")
    assert muxed.decode(latest(muxed.frame_id, 400)[-1]) == {"PAGE": 1, "ALWAYS": 0, "ON_1": 1.25}
    assert restbus.edit("MIXED=off") == "MIXED off"
    assert latest(100, 500) == []
    restbus.edit("MIXED=on")
    assert len(latest(100, 600)) == 10


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("MIXED.BIG", "expected MESSAGE.SIGNAL=VALUE"),
        ("MIXED.BIG=", "expected MESSAGE.SIGNAL=VALUE"),
        ("=1", "expected MESSAGE.SIGNAL=VALUE"),
        ("OTHER.BIG=1", "OTHER is not sent here; sent are MIXED, "),
        ("MIXED.SMALL=1", "MIXED has no signal SMALL; it has "),
        ("MIXED.BIG=1e9", "holds -67.67 to -26.72 km/h"),
        ("MIXED.BIG=nan", "expected a number"),
        ("COUNTED.STATE=LATE", "the database has OFF, READY"),
        ("MIXED=7", "switched on or off"),
    ],
)
def test_edits_that_say_what_is_wrong(make, line, message):
    restbus, _ = make("ABS")
    before = run(restbus, 100)
    with pytest.raises(GatewayError, match=message):
        restbus.edit(line)
    assert [frame for _, frame in run(restbus, 100, 100)] == [frame for _, frame in before]


@pytest.mark.parametrize(
    ("nodes", "settings", "message"),
    [
        (("RADIO",), None, "no messages of a node RADIO; ABS, PCM"),
        (("ABS",), "[send.MUXED]", "sent by PCM, not by ABS"),
        (("ABS",), "[send.NONE]", "unknown key 'NONE'"),
        (("ABS",), "[send.EVENT]\nspeed = 1", "unknown key 'speed'; known here: cycle_ms, counter, protection, start"),
        (("ABS",), "[send.EVENT]\ncycle_ms = 0.1", "expected 0 .* or at least 1, got 0.1"),
        (("ABS",), "[send.EVENT]\nprotection = 3", "expected {profile = 1, 2, 5 or 11"),
        (("ABS",), "[send.EVENT]\nprotection = {profile = 7}", "expected one of 1, 2, 5, 11, got 7"),
        (("ABS",), "[send.EVENT]\nprotection = {profile = 5, data_id = 1}", "needs 3 bytes, EVENT has 2"),
        (("ABS",), "[send.MIXED]\nprotection = {profile = 2, data_ids = [1]}", "expected 16 numbers"),
        (("ABS",), "[send.MIXED]\nprotection = {profile = 11, data_id = 1, data_id_mode = 'low'}", "both, nibble"),
        (("ABS",), "[send.MIXED]\nprotection = {sum = 'ford'}", "expected \"toyota\", got 'ford'"),
        (("ABS",), "[send.MIXED]\ncounter = {signal = 'TAIL', modulus = 70000}", "from 2 to 65536, got 70000"),
        (("ABS",), "send = 1", "expected a table"),
        (("ABS",), "[send.MIXED\n", "cannot be read as TOML"),
    ],
)
def test_refuses_what_it_cannot_send(make, nodes, settings, message):
    with pytest.raises(GatewayError, match=message):
        make(*nodes, settings=settings)
