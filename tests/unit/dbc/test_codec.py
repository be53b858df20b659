"""The compiled codec against cantools, message by message."""

import math

import cantools
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dbc.codec import CodecError, compile_decoder, compile_encoder, field_of, sna_of
from dbc.contract import contract, database_text, encode
from dbc.e2e import COUNTER_MODULUS, protect
from dbc.frame import BusName

ORACLES = {bus: cantools.database.load_string(database_text(bus), database_format="dbc") for bus in BusName}
SPECS = [spec for bus in BusName for spec in contract(bus).by_id.values()]
IDS = [spec.name for spec in SPECS]


def protected(spec, payload, counter=0):
    """What the wire carries of a payload without counter and check value."""
    return payload if spec.data_id is None else protect(spec.data_id, bytearray(payload), counter)


@pytest.mark.parametrize("spec", SPECS, ids=IDS)
@given(payload=st.binary(min_size=8, max_size=8))
def test_decode_equals_cantools(spec, payload):
    oracle = ORACLES[spec.bus].get_message_by_name(spec.name)
    raw = oracle.decode(payload, decode_choices=False, scaling=False)
    scaled = oracle.decode(payload, decode_choices=False)
    for field, value in zip(spec.fields, spec.decode(payload), strict=True):
        signal = oracle.get_signal_by_name(field.signal)
        expected = scaled[field.signal]
        margin = abs(signal.scale) * 1e-6
        in_range = signal.minimum - margin <= expected <= signal.maximum + margin
        if raw[field.signal] == sna_of(signal) or not in_range:
            assert value is None
        elif field.si_per_unit == 1.0:
            assert value == expected
        else:
            assert value == expected * field.si_per_unit


@pytest.mark.parametrize("spec", SPECS, ids=IDS)
@given(data=st.data())
def test_encode_equals_cantools(spec, data):
    oracle = ORACLES[spec.bus].get_message_by_name(spec.name)
    values, scaled = [], {"CRC": 0, "ALIVE_COUNTER": 0}
    for field in spec.fields:
        signal = oracle.get_signal_by_name(field.signal)
        if field.enum is not None:
            choice = data.draw(st.sampled_from(list(field.enum)))
            values.append(choice)
            scaled[field.signal] = int(choice)
            continue
        value = data.draw(st.floats(field.minimum, field.maximum)) * field.si_per_unit
        values.append(value)
        clamped = min(max(value / field.si_per_unit, field.minimum), field.maximum)
        integer = signal.scale == 1 and signal.offset == 0
        scaled[field.signal] = round(clamped) if integer else clamped
    wanted = {s.name: scaled[s.name] for s in oracle.signals}
    counter = data.draw(st.integers(0, COUNTER_MODULUS - 1))
    assert spec.encode(tuple(values), counter) == protected(spec, oracle.encode(wanted, strict=False), counter)


@pytest.mark.parametrize("spec", SPECS, ids=IDS)
def test_clamping_and_absence(spec):
    oracle = ORACLES[spec.bus].get_message_by_name(spec.name)
    for huge, end in ((1e12, "maximum"), (-1e12, "minimum")):
        values = tuple(0 if f.enum is not None else huge for f in spec.fields)
        raw = oracle.decode(spec.encode(values), decode_choices=False, scaling=False)
        decoded = oracle.decode(spec.encode(values), decode_choices=False)
        for field in spec.fields:
            if field.enum is None:
                assert raw[field.signal] != field.sna
                assert decoded[field.signal] == pytest.approx(
                    getattr(field, end), abs=oracle.get_signal_by_name(field.signal).scale / 2
                )
    for absent in (None, math.nan, math.inf, -math.inf):
        for i, field in enumerate(spec.fields):
            values = [0] * len(spec.fields)
            values[i] = absent
            if field.sna is None:
                with pytest.raises(CodecError, match=field.signal):
                    spec.encode(tuple(values))
            else:
                assert spec.decode(spec.encode(tuple(values)))[i] is None


def test_half_way_values_round_to_even():
    spec = next(s for s in SPECS if s.name == "BATTERY_STATUS")
    oracle = ORACLES[spec.bus].get_message_by_name(spec.name)
    for raw in range(200):
        power_kw = (raw + 0.5) * 0.01
        ours = spec.encode((0.0, power_kw * 1e3))
        theirs = oracle.encode(
            {"CRC": 0, "ALIVE_COUNTER": 0, "STATE_OF_CHARGE": 0.0, "CHARGE_POWER_LIMIT": power_kw * 1e3 / 1e3}
        )
        assert ours == protected(spec, theirs)


def test_motorola_byte_order_round_trip():
    text = (
        'VERSION ""\nBU_: A B\nBO_ 1 M: 8 A\n'
        ' SG_ X : 7|12@0- (0.5,0) [-1000|1000] "" B\n SG_ Y : 11|20@0+ (1,0) [0|1000000] "" B\n'
        ' SG_ Z : 40|9@1+ (1,0) [0|511] "" B\n'
    )
    message = cantools.database.load_string(text, database_format="dbc").get_message_by_name("M")
    fields = [field_of(s) for s in message.signals]
    enc, dec = compile_encoder(message, fields), compile_decoder(message, fields, lambda *v: v)
    for values in ((-512.5, 654321, 300), (0.0, 1, 511), (1000.0, 1000000, 0)):
        payload = enc(values)
        wanted = dict(zip([s.name for s in message.signals], values, strict=True))
        assert payload == message.encode(wanted)
        assert dec(payload) == values


@st.composite
def databases(draw):
    """A message of both byte orders (little-endian bytes first) with signals of any length, sign, factor and offset."""
    split = draw(st.integers(0, 8))
    lines = ['VERSION ""', "BU_: A B", "BO_ 1 M: 8 A"]
    for order, first, last in (("1", 0, 8 * split), ("0", 8 * split, 64)):
        at = first
        while at < last:
            at += draw(st.integers(0, 5))
            length = min(draw(st.integers(1, 33)), last - at)
            if length < 1:
                break
            sign = draw(st.sampled_from("+-"))
            factor = draw(st.sampled_from((1, 2, 0.5, 0.1, 0.01, 3.7e-5, -0.25)))
            offset = draw(st.sampled_from((0, -40, 273.15, -0.5)))
            raw = (-(1 << length - 1), (1 << length - 1) - 1) if sign == "-" else (0, (1 << length) - 1)
            low, high = sorted(value * factor + offset for value in raw)
            start = at if order == "1" else 8 * (at // 8) + 7 - at % 8
            lines.append(f' SG_ S{len(lines)} : {start}|{length}@{order}{sign} ({factor},{offset}) [{low}|{high}] "" B')
            at += length
    return "\n".join(lines) + "\n"


@given(databases(), st.data())
def test_any_layout_equals_cantools(text, data):
    message = cantools.database.load_string(text, database_format="dbc").get_message_by_name("M")
    assume(message.signals)
    fields = [field_of(s) for s in message.signals]
    enc, dec = compile_encoder(message, fields), compile_decoder(message, fields, lambda *v: v)
    payload = data.draw(st.binary(min_size=8, max_size=8))
    assert dec(payload) == tuple(message.decode(payload).values())
    values = [data.draw(st.floats(field.minimum, field.maximum)) for field in fields]
    wanted = {s.name: v for s, v in zip(message.signals, values, strict=True)}
    assert enc(values) == message.encode(wanted, strict=False)


def test_encode_protects_only_protected_messages():
    for spec in SPECS:
        payload = encode(spec.type(*(0 for _ in spec.fields)), 7)
        assert (payload[1] & 0xF == 7) == (spec.data_id is not None)


def test_field_refuses_what_the_wire_cannot_hold():
    text = (
        'VERSION ""\nBU_: A\nBO_ 1 M: 8 A\n'
        ' SG_ X : 0|12@1+ (1,0) [0|10] "furlong" A\n SG_ Y : 12|4@1+ (1,0) [0|0] "" A\n'
    )
    x, y = cantools.database.load_string(text, database_format="dbc").get_message_by_name("M").signals
    with pytest.raises(CodecError, match="furlong"):
        field_of(x)
    with pytest.raises(CodecError, match="range"):
        field_of(y)
