"""Both ways through a map: values, freshness, protection; and what a map must not say."""

import pytest
from any_dbc import TEXT
from e2e import p02

from dbc.exchange import Receiver, Transmitter
from dbc.frame import BusName, Frame, LinkEvent, LinkState
from dbc.messages import EhbPressureFront, EhbState, WheelSpeedFront
from hil.gateway.error import GatewayError
from hil.gateway.gateway import OurSide, TheirSide
from hil.gateway.map import load_map
from hil.gateway.signals import read

IDS = list(range(100, 116))
MAP = f"""
dbc = "any.dbc"
[send.MUXED]
cycle_ms = 10
protection = {{ profile = 1, data_id = 7, offset = 4 }}
[send.MUXED.signals]
PAGE = 2
ON_2 = {{ from = "wheel_speed_fl_rad_s", sign = -1, unit = "rpm", none = -999 }}

[receive.COUNTED]
protection = {{ profile = 2, data_ids = {IDS} }}
[ours.WHEEL_SPEED_FRONT]
wheel_speed_fl_rad_s = {{ from = "COUNTED.STATE", scale = 2.0, offset = 1.0, none = 5 }}
wheel_speed_fr_rad_s = 3.0
[receive.MIXED]
counter = {{ signal = "TAIL" }}
[ours.EHB_PRESSURE_FRONT]
pressure_fl_pa = {{ from = "MIXED.LITTLE", unit = "bar" }}
ehb_state_front = 0
"""
MS = 1_000_000


@pytest.fixture
def load(tmp_path):
    def make(text=MAP):
        (tmp_path / "any.dbc").write_text(TEXT)
        (tmp_path / "map.toml").write_text(text)
        return load_map(tmp_path / "map.toml")

    return make


def their_frame(counter, state):
    data = bytearray([0, state << 4 | counter, 0, 0, 0, 0, 0, 0])
    p02.e2e_p02_protect(data, bytes(IDS), increment_counter=False)
    return Frame(BusName.VEHICLE, 102, bytes(data))


def test_ours_to_theirs(load):
    gateway_map, said = load(), []
    side, sender = TheirSide(gateway_map, said.append), Transmitter()
    signal = next(s for s in gateway_map.database.messages["MUXED"].signals if s.name == "ON_2")

    def step(ms, *values):
        sent = sender.frames(ms * MS, [WheelSpeedFront(*values)]) if values else []
        return side.step(ms * MS, [LinkEvent(BusName.VEHICLE, LinkState.BUS_ERROR), *sent])

    assert step(0, 10.0, 10.0) == []  # the first frame only begins a sequence
    (frame,) = step(10, 10.0, 10.0)
    assert (frame.can_id, frame.extended, frame.data[0]) == (352, True, 2)
    assert read(signal, frame.data) == round(-10.0 / 0.10471975511965977)
    assert step(15) == []  # not due
    (again,) = step(20, None, 10.0)
    assert (read(signal, again.data), again.data[5]) == (-999, 1)
    assert len(step(40)) == 1
    assert step(50) == []  # 30 ms old: more than two and a half cycles
    assert len(step(60, 1e9, 0.0)) == 1  # held to what our own bits hold, then to theirs
    assert said == [
        "MUXED: held back, WHEEL_SPEED_FRONT has not come yet",
        "MUXED: sent",
        "MUXED: held back, WHEEL_SPEED_FRONT is silent",
        "MUXED: sent",
    ]


def test_theirs_to_ours(load):
    said = []
    side, receiver = OurSide(load(), said.append), Receiver([WheelSpeedFront])

    def step(ms, *frames):
        sent = side.step(ms * MS, list(frames))
        receiver.accept(ms * MS, sent)
        return [frame.can_id for frame in sent]

    assert step(0, their_frame(14, 1)) == []
    assert step(10, their_frame(15, 1)) == [192]
    assert step(20, their_frame(0, 3)) == [192]
    assert receiver.latest(WheelSpeedFront) == (7.0, 3.0)
    step(30, their_frame(1, 5))
    assert receiver.latest(WheelSpeedFront) == (None, 3.0)
    damaged = their_frame(2, 0)._replace(data=bytes(8))
    for k, frame in enumerate((damaged, their_frame(1, 2), their_frame(9, 2), damaged._replace(data=b""))):
        assert step(40 + 10 * k, frame) == [192]
    assert side.rejected == 5  # with the first of all
    assert step(90) == [192]
    assert step(100) == []  # 70 ms after the last usable one, of 25 ms each
    assert step(110, their_frame(10, 4)) == [192]
    assert step(115) == []
    assert said[-2:] == ["WHEEL_SPEED_FRONT: held back, COUNTED is silent or rejected", "WHEEL_SPEED_FRONT: sent"]
    assert side.sent == 9


def test_a_plain_counter_and_a_constant(load):
    side, receiver = OurSide(load()), Receiver([EhbPressureFront])
    for k, tail in enumerate((65534, 65535, 0, 0, 1)):
        data = bytearray(8)
        data[0:2] = (100 << 4).to_bytes(2, "little")
        data[6:8] = tail.to_bytes(2, "little")
        receiver.accept(k * 10 * MS, side.step(k * 10 * MS, [Frame(BusName.VEHICLE, 100, bytes(data))]))
    assert receiver.latest(EhbPressureFront) == (pytest.approx(47e5, abs=1000.0), None, EhbState.DEMAND)
    assert side.rejected == 2


HEAD = 'dbc = "any.dbc"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "dbc: expected the path of a DBC, got None"),
        ('dbc = "none.dbc"', "none.dbc"),
        (HEAD, "nothing to translate"),
        (HEAD + "speed = 1", "unknown key 'speed'; known here: dbc, send, receive, ours"),
        (HEAD + "[send.RADIO]", "send: unknown key 'RADIO'"),
        (HEAD + "[send.EVENT]", "states no cycle time; expected cycle_ms"),
        (HEAD + "[send.LONG]", "unknown key 'LONG'"),
        (HEAD + '[send.MIXED]\nsignals.BIG = {from = "speed"}', "expected a value, or a field of our messages"),
        (HEAD + '[send.MIXED]\nsignals.BIG = {from = "yaw_rate_rad_s", unit = "furlong"}', "unknown unit 'furlong'"),
        (HEAD + '[send.MIXED]\nsignals.BIG = {from = "yaw_rate_rad_s", scale = 0}', "cannot be turned round"),
        (HEAD + '[send.MIXED]\nsignals.BIG = {from = "yaw_rate_rad_s", sign = 2}', "expected 1 or -1, got 2"),
        (HEAD + '[send.MIXED]\nsignals.BIG = {from = "yaw_rate_rad_s", above = 1, scale = 2}', "a switch has no unit"),
        (HEAD + '[send.MIXED]\nsignals.BIG = {from = "yaw_rate_rad_s", none = 4096}', "from 0 to 4095, got 4096"),
        (HEAD + "[send.MIXED]\nsignals.BIG = 0", "holds -67.67 to -26.72 km/h, got 0"),
        (HEAD + "[send.MIXED]\nsignals.SMALL = 0", "unknown key 'SMALL'; known here: .*LITTLE"),
        (HEAD + '[send.MIXED]\nmax_age_ms = 0\nsignals.BIG = {from = "yaw_rate_rad_s"}', "expected more than 0, got 0"),
        (HEAD + "[ours.BRAKE]", "ours: unknown key 'BRAKE'; known here: "),
        (HEAD + "[ours.BODY_MOTION]\nyaw_rate_rad_s = 1.0", "no field comes from them"),
        (HEAD + '[ours.BODY_MOTION]\nyaw_rate_rad_s = {from = "MIXED"}', "MIXED has no signal"),
        (HEAD + '[ours.BODY_MOTION]\nyaw_rate_rad_s = {from = "LONG.FAR"}', "LONG is no frame of classical CAN"),
        (
            HEAD + '[ours.BODY_MOTION]\nyaw_rate_rad_s = {from = "EVENT.DOOR"}',
            "receive.EVENT: .* or max_age_ms",
        ),
        (HEAD + '[ours.BODY_MOTION]\nyaw = {from = "MIXED.BIG"}', "unknown key 'yaw'; known here: .*longitudinal_acc"),
        (HEAD + '[ours.EHB_PRESSURE_FRONT]\npressure_fl_pa = {from = "MIXED.BIG"}', "no value for not available"),
        (HEAD + "[send.MIXED]\n[receive.MIXED]", "the gateway sends it; expected one way"),
        (HEAD + "[send.MIXED]\n[receive.FLOATS]", "nothing under `ours` reads it"),
        (HEAD + '[send.MIXED]\n[ours.BODY_MOTION]\nyaw_rate_rad_s = {from = "MIXED.BIG"}', "sends and reads it"),
    ],
)
def test_a_map_that_says_what_is_wrong(load, text, message):
    with pytest.raises(GatewayError, match=message):
        load(text)
