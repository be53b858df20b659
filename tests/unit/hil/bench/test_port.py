"""The port: both buses in a defined order; and no frame that a role does not own."""

import uuid

import pytest

from dbc.contract import encode, spec_of
from dbc.frame import BusName, Frame
from dbc.messages import BrakePedal, EhbDemandFront
from hil.bench.port import OwnedNode, Port
from hil.bus import bench_channel, open_bus

DEMAND = spec_of(EhbDemandFront).can_id
PEDAL = spec_of(BrakePedal).can_id


@pytest.fixture
def spec():
    return f"loopback:p{uuid.uuid4().hex[:10]}"


@pytest.fixture
def port(spec):
    with Port.open(spec) as joined:
        yield joined


@pytest.fixture
def others(spec, port):
    with open_bus(spec, BusName.VEHICLE) as vehicle, open_bus(bench_channel(spec), BusName.BENCH) as bench:
        yield vehicle, bench


def test_own_frames_reach_their_bus(port, others):
    vehicle, bench = others
    demand = Frame(BusName.VEHICLE, DEMAND, encode(EhbDemandFront(1e5, 1e5), 3))
    reception = Frame(BusName.BENCH, 0x38, bytes(8))
    port.send([demand, reception])
    assert [(f.can_id, f.data) for f in vehicle.receive(1.0)] == [(DEMAND, demand.data)]
    assert [f.can_id for f in bench.receive(1.0)] == [0x38]


def test_the_vehicle_bus_comes_first(port, others):
    vehicle, bench = others
    bench.send([Frame(BusName.BENCH, 0x20, bytes(8))])
    vehicle.send([Frame(BusName.VEHICLE, PEDAL, bytes(8))])
    received = []
    while len(received) < 2:
        received += port.receive()
    assert {(f.bus, f.can_id) for f in received} == {(BusName.VEHICLE, PEDAL), (BusName.BENCH, 0x20)}
    vehicle.send([Frame(BusName.VEHICLE, PEDAL, bytes(8))])
    bench.send([Frame(BusName.BENCH, 0x20, bytes(8))])
    assert [f.bus for f in port.receive()] == [BusName.VEHICLE, BusName.BENCH]


@pytest.mark.parametrize(
    "frame",
    [
        Frame(BusName.VEHICLE, PEDAL, bytes(8)),  # the driver's
        Frame(BusName.VEHICLE, DEMAND, bytes(7)),  # wrong length
        Frame(BusName.BENCH, DEMAND, bytes(8)),  # wrong bus
        Frame(BusName.VEHICLE, DEMAND, bytes(8), extended=True),
        Frame(BusName.VEHICLE, 0x000, bytes(8)),
    ],
)
def test_a_node_that_sends_what_is_not_its_own_is_refused(frame):
    class Sends:
        def step(self, now_ns, inbox):
            return [frame]

    with pytest.raises(ValueError, match="not this role's to send"):
        OwnedNode(Sends(), ["ECU"]).step(0, [])
