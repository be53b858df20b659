"""Payloads of any database: cantools is the oracle."""

import random

import cantools
import pytest
from any_dbc import TEXT

from hil.gateway.database import load
from hil.gateway.error import GatewayError
from hil.gateway.settings import raw_value
from hil.gateway.signals import assemble, physical, present, raw_of, raw_range, read, selected


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    path = tmp_path_factory.mktemp("dbc") / "any.dbc"
    path.write_text(TEXT)
    return load(path)


ORACLE = cantools.database.load_string(TEXT, "dbc")


@pytest.mark.parametrize("name", ["MIXED", "FLOATS", "MUXED", "COUNTED", "EVENT"])
def test_payloads_are_cantools(database, name):
    draw, message, oracle = random.Random(name), database.messages[name], ORACLE.get_message_by_name(name)
    for _ in range(50):
        values = {s.name: draw.uniform(-9, 9) if s.is_float else draw.randint(*raw_range(s)) for s in message.signals}
        values |= {s.name: draw.randint(1, 2) for s in message.signals if s.name == "PAGE"}
        mine = assemble(message, values)
        there = {s.name for s in message.signals if present(message, s, values)}
        assert mine == oracle.encode({n: values[n] for n in there}, scaling=False, strict=False)
        decoded = oracle.decode(bytes(mine), decode_choices=False)
        assert set(decoded) == there
        for signal in message.signals:
            assert selected(message, signal, mine) == (signal.name in there)
            if signal.name in there:
                raw = read(signal, mine)
                assert physical(signal, raw) == pytest.approx(decoded[signal.name])
                assert raw_of(signal, decoded[signal.name]) == pytest.approx(raw)


def test_start_values_are_the_databases(database):
    for name, starts in database.start.items():
        for signal in ORACLE.get_message_by_name(name).signals:
            assert starts[signal.name] == (signal.raw_initial or 0), (name, signal.name)
    assert database.start["MUXED"]["ON_2"] == -7
    assert database.left_out == ("LONG",)
    assert database.nodes == {"ABS", "PCM"}


def test_values_beyond_the_bits_are_held_or_refused(database):
    signal = next(s for s in database.messages["MIXED"].signals if s.name == "BIG")
    assert raw_of(signal, 1e9) == 4095
    assert raw_of(signal, -1e9) == 0
    with pytest.raises(GatewayError, match=r"here: BIG holds -67.67 to -26.72 km/h, got 0"):
        raw_value(signal, 0, "here")
    assert raw_of(signal, float("inf")) == 4095
    with pytest.raises(ValueError, match="no raw value"):
        raw_of(signal, float("nan"))
    single = next(s for s in database.messages["FLOATS"].signals if s.name == "F_BIG")
    data = assemble(database.messages["FLOATS"], {"F_BIG": raw_of(single, -1e300)})
    assert read(single, data) == pytest.approx(-3.4028e38, rel=1e-4)
