"""The bytes of profile 1A: autosar-e2e is the oracle, and a changed definition does not pass it."""

import random
from importlib import resources
from types import SimpleNamespace

import cantools
import numpy as np
import pytest
from e2e.p01 import e2e_p01_check, e2e_p01_protect

from dbc import e2e
from dbc.codec import CodecError
from dbc.contract import contract, database_text
from dbc.frame import BusName
from hil.log.signals.integrity import Integrity, check_frames

PROTECTED = [spec for bus in BusName for spec in contract(bus).by_id.values() if spec.data_id is not None]


def oracle(data_id, payload, counter):
    data = bytearray(payload)
    data[1] = (data[1] & 0xF0) | counter
    e2e_p01_protect(data, data_id, increment_counter=False)
    return bytes(data)


def samples(seed=1, each=12):
    """Random payloads of 2..8 bytes and random data ids, with every counter."""
    draw = random.Random(seed)
    for length in range(2, 9):
        for counter in range(15):
            for _ in range(each):
                yield draw.randrange(0x10000), draw.randbytes(length), counter


def differing(module):
    """How many samples ``module.protect`` answers otherwise than the oracle does, of how many."""
    wrong = [
        module.protect(data_id, bytearray(body), counter) != oracle(data_id, body, counter)
        for data_id, body, counter in samples()
    ]
    return sum(wrong), len(wrong)


def test_known_bytes():
    """Data id 0x123 and zeros, as autosar-e2e 1.0.0 and crccheck give them."""
    assert e2e.protect(0x123, bytearray(8), 0) == bytes.fromhex("CC00000000000000")
    assert e2e.protect(0x123, bytearray(8), 1) == bytes.fromhex("9101000000000000")


def test_crc_against_the_catalogue_values():
    """CRC-8/GSM-A and CRC-8/SAE-J1850 of "123456789" (CRC RevEng catalogue): one polynomial, two starts and XORs."""
    assert e2e.crc8(b"123456789") == 0x37
    assert e2e.crc8(b"123456789", 0xFF) ^ 0xFF == 0x4B


def test_protect_equals_the_oracle():
    assert differing(e2e) == (0, 7 * 15 * 12)


def test_the_oracle_counts_as_we_do():
    data = bytearray(8)
    for counter in (*range(1, 15), 0, 1):
        e2e_p01_protect(data, 0x123)
        assert bytes(data) == e2e.protect(0x123, bytearray(8), counter)


def test_the_checker_accepts_what_the_oracle_accepts():
    for data_id, body, counter in samples(2):
        good = oracle(data_id, body, counter)
        for data in (good, bytes([good[0] ^ 0x40]) + good[1:]):
            accepted = e2e.Checker(data_id, len(data)).check(data) is not e2e.Status.WRONG_CRC
            assert accepted == e2e_p01_check(bytearray(data), data_id)


@pytest.mark.parametrize("length", range(2, 9))
def test_the_check_in_columns_accepts_what_the_oracle_accepts(length):
    for data_id, body, counter in samples(3, 2):
        if len(body) == length:
            data = np.zeros((1, 8), np.uint8)
            data[0, :length] = list(oracle(data_id, body, counter))
            assert check_frames(data, np.array([length], np.uint8), data_id, length) == Integrity(1, 0, 0, 0)
            data[0, 0] ^= 1
            assert check_frames(data, np.array([length], np.uint8), data_id, length) == Integrity(1, 1, 0, 0)


@pytest.mark.parametrize("spec", PROTECTED, ids=lambda spec: spec.name)
def test_generated_encoders_make_what_the_oracle_accepts(spec):
    values = spec.decode(bytes(8))
    for counter in range(15):
        data = spec.encode(values, counter)
        assert data[1] & 0x0F == counter
        assert e2e_p01_check(bytearray(data), spec.data_id)


@pytest.mark.parametrize("length", range(2, 9))
def test_legacy_check_value(length):
    """Start and final XOR 0xFF, bit by bit."""
    for data_id, body, _ in samples(4, 2):
        if len(body) == length:
            crc = 0xFF
            for byte in (data_id & 0xFF, data_id >> 8, *body[1:]):
                crc ^= byte
                for _ in range(8):
                    crc = (crc << 1 ^ 0x1D) & 0xFF if crc & 0x80 else crc << 1
            assert e2e.check_value(data_id, body, legacy=True) == crc ^ 0xFF
            assert e2e.check_value(data_id, body) == crc ^ 0xFF ^ e2e.legacy_difference(length)


def test_the_two_check_values_differ_at_every_length():
    assert all(e2e.legacy_difference(length) for length in range(2, 65))


MUTANTS = {
    "polynomial": ("_table(0x1D)", "_table(0x2F)"),
    "start": ("LEGACY if legacy else 0)\n\n\ndef check", "LEGACY if legacy else 1)\n\n\ndef check"),
    "final XOR": ("payload) ^ (LEGACY if legacy else 0)", "payload) ^ (LEGACY if legacy else 1)"),
    "start and final XOR of the legacy value": ("legacy: bool = False", "legacy: bool = True"),
    "order of the data id": ("(data_id & 0xFF, data_id >> 8)", "(data_id >> 8, data_id & 0xFF)"),
    "counter in the high nibble": (
        "(payload[1] & 0xF0) | (counter % COUNTER_MODULUS)",
        "(payload[1] & 0x0F) | (counter % COUNTER_MODULUS << 4)",
    ),
    "counter in the third byte": ("payload[1] = (payload[1] & 0xF0)", "payload[-1] = (payload[-1] & 0xF0)"),
    "counter modulus": ("COUNTER_MODULUS = 15", "COUNTER_MODULUS = 14"),
    "check value over the first byte": ("for byte in payload[1:]", "for byte in payload"),
    "order of the payload": ("_, a, b, c, d, e, f, g = payload", "_, a, b, c, d, e, g, f = payload"),
    "check value in the last byte": ("payload[0] = check_value", "payload[-1] = check_value"),
}


@pytest.mark.parametrize("mutant", MUTANTS)
def test_a_changed_definition_differs_from_the_oracle(mutant):
    source = resources.files("dbc").joinpath("e2e.py").read_text(encoding="utf-8")
    old, new = MUTANTS[mutant]
    assert old in source, "the definition has changed: bring the mutant up to it"
    names = {"__name__": "mutant"}
    exec(compile(source.replace(old, new), mutant, "exec"), names)  # noqa: S102 - our own source
    assert differing(SimpleNamespace(**names))[0] > 0


def test_the_databases_say_which_profile():
    for bus in BusName:
        for message in cantools.database.load_string(database_text(bus), "dbc").messages:
            attributes = {name: attribute.value for name, attribute in message.dbc.attributes.items()}
            protected = "E2EDataID" in attributes
            assert attributes.get("E2EProfile") == (e2e.PROFILE if protected else None), message.name


def test_a_database_of_another_profile_is_refused(monkeypatch):
    text = database_text(BusName.VEHICLE).replace('BO_ 160 "AUTOSAR profile 1A"', 'BO_ 160 "AUTOSAR profile 2"')
    monkeypatch.setattr("dbc.contract.database_text", lambda bus: text)
    with pytest.raises(CodecError, match="BRAKE_PEDAL: E2EProfile is 'AUTOSAR profile 2'; expected"):
        contract.__wrapped__(BusName.VEHICLE)
