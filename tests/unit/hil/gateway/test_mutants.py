"""Damaged databases and maps: each is sent, or refused with one own error."""

import random
from pathlib import Path

from any_dbc import TEXT

from dbc.exchange import Transmitter
from dbc.frame import BusName, Frame
from dbc.messages import BodyMotion, BrakePedal, EhbPressureFront, WheelSpeedFront, WheelSpeedRear
from hil.gateway.database import load
from hil.gateway.error import GatewayError
from hil.gateway.gateway import OurSide, TheirSide
from hil.gateway.map import load_map
from hil.gateway.protection import ToyotaSum
from hil.gateway.restbus import RestBus, sendings

EXAMPLES = Path(__file__).parents[4] / "examples"
OURS = [(BrakePedal, 2), (WheelSpeedFront, 2), (WheelSpeedRear, 2), (BodyMotion, 3), (EhbPressureFront, 3)]
WORDS = ["0", "1", "-1", "64", "8", "1e300", "nan", "m1", "M", '"', ":", "|", "@", "(", "{", "}", "[", "=", "\n", "inf"]


def frame_of(heard, data):
    return Frame(BusName.VEHICLE, heard.message.can_id, bytes(data), 0, heard.message.extended)


def mutants(text, count, seed):
    """Texts with one to three words replaced, left out or doubled."""
    draw = random.Random(seed)
    words = text.split(" ")
    for _ in range(count):
        copy = list(words)
        for _ in range(draw.randint(1, 3)):
            at = draw.randrange(len(copy))
            copy[at : at + 1] = draw.choice([[], [draw.choice(WORDS)], [copy[at], copy[at]], [draw.choice(words)]])
        yield " ".join(copy)


def test_damaged_databases(tmp_path):
    path, sent, refused = tmp_path / "any.dbc", 0, 0
    for text in mutants(TEXT, 100, 1):
        path.write_text(text)
        try:
            database = load(path)
            restbus = RestBus(sendings(database, database.nodes))
        except GatewayError:
            refused += 1
            continue
        for ms in range(0, 200, 10):
            for frame in restbus.step(ms * 1_000_000, []):
                assert len(frame.data) <= 8
                sent += 1
    print(f"{sent} frames sent, {refused} databases refused")
    assert sent > 2000


def test_damaged_maps(tmp_path):
    (tmp_path / "rav4_brake.dbc").write_text((EXAMPLES / "rav4_brake.dbc").read_text())
    path, loaded, refused, draw = tmp_path / "map.toml", 0, 0, random.Random(2)
    for text in mutants((EXAMPLES / "rav4_gateway.toml").read_text(), 60, 3):
        path.write_text(text)
        try:
            gateway_map = load_map(path)
        except GatewayError:
            refused += 1
            continue
        loaded += 1
        theirs, ours, sender = TheirSide(gateway_map), OurSide(gateway_map), Transmitter()
        for now_ns in range(0, 80_000_000, 10_000_000):
            heard = [bytearray(draw.randbytes(8)) for _ in gateway_map.heard]
            for one, data in zip(gateway_map.heard, heard, strict=True):
                ToyotaSum(one.message.can_id).protect(data, 0)
            theirs.step(now_ns, sender.frames(now_ns, [kind(*(draw.uniform(-9, 9),) * n) for kind, n in OURS]))
            ours.step(now_ns, [frame_of(one, data) for one, data in zip(gateway_map.heard, heard, strict=True)])
    print(f"{loaded} maps loaded, {refused} refused")
    assert loaded > 4
    assert refused > 4
