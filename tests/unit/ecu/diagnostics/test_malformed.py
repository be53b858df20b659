"""Requests without sense or manners: no exception, nothing answered twice, no actuator moved outside its conditions."""

import random
from collections import Counter

import pytest

from dbc.diagnostic_ids import REQUEST, REQUEST_FUNCTIONAL, RESPONSE
from dbc.frame import BusName, Frame
from dbc.isotp import Link, PduKind, flow_control, parse, segment
from dbc.isotp_log import Reassembler
from ecu.diagnostics.identifiers import IDENTIFIERS
from ecu.diagnostics.protocol import MOST_REQUEST
from ecu.diagnostics.security import key_of
from ecu.diagnostics.services import SERVICES

TICK_NS = 10_000_000


def made_up(rng: random.Random) -> bytes:
    """A request: any bytes, or one that begins as a real one does."""
    kind = rng.random()
    if kind < 0.2:
        return rng.randbytes(rng.choice((1, 2, 3, 7, 8, 20, 300, 600)))
    sid = rng.choice(tuple(SERVICES))
    if kind < 0.3:
        return bytes((sid,)) + rng.randbytes(rng.randrange(12))
    did = rng.choice((*IDENTIFIERS, 0x4000, 0x4011)).to_bytes(2, "big")
    sub = bytes((rng.choice((0, 1, 2, 3, 4, 6, 0x0A, 0x80, 0x81, 0x83)),))
    tail = rng.randbytes(rng.randrange(10))
    if sid in (0x22, 0x2E):
        return bytes((sid,)) + did * rng.choice((1, 1, 2, 100)) + tail * rng.randrange(2)
    if sid == 0x2F:
        return bytes((sid,)) + did + sub + rng.choice((b"", bytes.fromhex("4a000000"), tail))
    if sid == 0x31:
        return bytes((sid,)) + sub + bytes((2, rng.choice((1, 2, 3, 9)))) + tail * rng.randrange(2)
    if sid == 0x14:
        return b"\x14" + rng.choice((b"\xff\xff\xff", rng.randbytes(3)))
    return bytes((sid,)) + sub + tail * rng.randrange(2)


class Mob:
    """Testers without manners on both addresses; they know the key."""

    def __init__(self, seed: int) -> None:
        self.rng, self.waiting, self.sent = random.Random(seed), [], 0

    def ask(self) -> None:
        """Queue the frames of one more request, spoilt in one way or another."""
        rng = self.rng
        self.sent += 1
        if rng.random() < 0.05:
            self.waiting.append(frame_of(REQUEST, bytes.fromhex(rng.choice(("021003", "022701")))))
            return
        out = segment(made_up(rng))
        spoil = rng.random()
        if spoil < 0.1:
            del out[rng.randrange(len(out))]
        elif spoil < 0.2:
            rng.shuffle(out)
        elif spoil < 0.3:
            out.insert(rng.randrange(len(out) + 1), rng.randbytes(rng.randrange(9)))
        elif spoil < 0.5:
            out.append(flow_control(rng.choice((0, 0, 0, 1, 2, 9)), rng.randrange(3), rng.choice((0, 5, 0xF3, 0x90))))
        which = REQUEST if rng.random() < 0.75 else REQUEST_FUNCTIONAL
        self.waiting += [frame_of(which if rng.random() < 0.95 else REQUEST, data) for data in out]

    def unlock(self, seed: bytes) -> None:
        """Send the key before all else, and ask for an actuator behind it."""
        demand = self.rng.choice(("2f 40 02 03 4a 00 00 00", "31 01 02 02", "2f 40 10 03 c1 a0 00 00"))
        out = [b"\x06\x27\x02" + key_of(seed), *segment(bytes.fromhex(demand))]
        self.waiting[:0] = [frame_of(REQUEST, data) for data in out]

    def now(self) -> list[Frame]:
        """What goes out at this tick: some of what waits, others' requests in between."""
        rng, count = self.rng, self.rng.choice((0, 1, 1, 1, 2, 9))
        out, self.waiting = self.waiting[:count], self.waiting[count:]
        if rng.random() < 0.02 and out:
            rng.shuffle(out)
        return out


def frame_of(can_id, data):
    return Frame(BusName.VEHICLE, can_id, data)


@pytest.mark.parametrize("number", [500, pytest.param(10_000, marks=pytest.mark.slow)])
def test_malformed_requests(bench, number):
    rig, node, mob = bench.rig, bench.rig.node, Mob(2)
    told, shadow = Reassembler(), Link(most_bytes=MOST_REQUEST)
    requests, answers, pending = Counter(), Counter(), Counter()
    tick = moved = since_change = 0
    while mob.sent < number or mob.waiting:
        if len(mob.waiting) < 20 and mob.sent < number:
            mob.ask()
        since_change += 1
        if tick % 400 == 0:
            rig.car.wheel_speed = mob.rng.choice((0.0, 0.0, 65.0))
            rig.car.pedal = mob.rng.choice(((0.0, 0.0), (0.0, 0.0), (0.5, 0.5)))
            since_change = 0
        out = mob.now()
        for frame in out:
            if frame.can_id == REQUEST:
                request = shadow.take(rig.tick * TICK_NS, frame.data)
            else:
                pdu = parse(frame.data)
                request = pdu.data if pdu is not None and pdu.kind == PduKind.SINGLE else None
            if request is not None:
                requests[request[0]] += 1
        shadow.frames(rig.tick * TICK_NS)
        sent = rig.step(1, out)
        tick += 1
        for frame in sent:
            if frame.can_id == RESPONSE:
                assert len(frame.data) == 8
                for message in told.take(tick * TICK_NS, RESPONSE, frame.data):
                    if message.error:
                        continue
                    sid = message.data[1] if message.data[0] == 0x7F else message.data[0] - 0x40
                    (pending if message.data[2:] == b"\x78" else answers)[sid] += 1
                    if message.data[:2] == b"\x67\x01":
                        mob.unlock(message.data[2:6])
        assert answers <= requests, answers - requests
        assert pending <= requests
        pressure, motor = node.outputs.pressure_demand_pa, node.outputs.motor_demand_nm
        if rig.car.pedal[0] == 0.0 and since_change > 3:  # the law itself asks for nothing
            taken = any(p > 0.0 for p in pressure) or any(t < 0.0 for t in motor)
            moved += taken
            assert not taken or rig.car.wheel_speed == 0.0
            assert not max(pressure) > 60e5
            assert not min(motor) < -50.0
        elif since_change > 3:
            assert not max(pressure) <= 0.0  # the driver's demand stands
    assert answers.total() > number / 10
    assert len(answers) > 20
    assert moved > number / 100
