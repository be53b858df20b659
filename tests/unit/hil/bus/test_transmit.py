"""Buses with hardware are listened to; who sends there says so."""

import inspect
import uuid

import pytest
from can.interfaces import BACKENDS
from can.interfaces.cantact import CantactBus
from can.interfaces.seeedstudio import SeeedBus
from can.interfaces.slcan import slcanBus

from dbc.frame import BusName, Frame
from hil.bus.adapters import buses
from hil.bus.bus import BusError
from hil.bus.listen import OtherSenderError, refuse_others
from hil.bus.open import open_bus
from hil.bus.python_can_driver import LISTEN_ONLY
from hil.bus.transmit import ListeningBus, check_transmit, has_hardware, open_for_role

VEHICLE = BusName.VEHICLE


@pytest.fixture
def channel():
    return f"loopback:t{uuid.uuid4().hex[:10]}"


@pytest.mark.parametrize(
    "spec", ["loopback:a", "auto", "socketcan:vcan0", "socketcan:vxcan1", "virtual:a", "timed:500000"]
)
def test_a_bus_without_hardware_needs_no_word(spec):
    assert not has_hardware(spec)
    check_transmit(spec, transmit=False, why="it sends")


@pytest.mark.parametrize(
    "spec", ["socketcan:can0", "kvaser:0", "slcan:/dev/ttyACM0", "udp_multicast:239.0.0.1", "new:0"]
)
def test_any_other_needs_it(spec):
    assert has_hardware(spec)
    with pytest.raises(BusError, match=f"bus {spec}: it sends, .*; add --transmit"):
        check_transmit(spec, transmit=False, why="it sends")
    check_transmit(spec, transmit=True, why="it sends")


def test_a_loopback_is_sent_to_and_contradictions_are_refused(channel):
    with pytest.raises(BusError, match="contradict each other"):
        open_for_role("slcan:/dev/null,listen_only=true", VEHICLE, transmit=True)
    with open_for_role(channel, VEHICLE, transmit=False) as bus:
        assert not isinstance(bus, ListeningBus)


def test_a_listening_bus_hears_and_does_not_send(channel):
    frame = Frame(VEHICLE, 0x123, b"\x01")
    with open_bus(channel, VEHICLE) as other, ListeningBus(open_bus(channel, VEHICLE)) as bus:
        bus.send([frame, frame])
        other.send([frame])
        assert [heard.can_id for heard in bus.receive(1.0)] == [0x123]
        assert (other.receive(0.0), bus.withheld) == ([], 2)
        with pytest.raises(ValueError, match="cannot send"):
            bus.send([frame._replace(can_id=1 << 30)])


def test_listen_only_options_are_those_of_the_drivers():
    assert set(LISTEN_ONLY) <= set(BACKENDS)
    for kind, driver in (("cantact", CantactBus), ("seeedstudio", SeeedBus), ("slcan", slcanBus)):
        assert LISTEN_ONLY[kind][0] in inspect.signature(driver.__init__).parameters


def test_who_already_sends_is_named(channel):
    with open_bus(channel, VEHICLE) as other, open_bus(channel, VEHICLE) as bus:
        ours = {(VEHICLE, 0x123, False): "0x123 DEMAND of ECU", (VEHICLE, 0x124, False): "0x124"}
        other.send([Frame(VEHICLE, 0x124, b"", 0, True)])  # 29 bits: another one
        other.send([Frame(VEHICLE, 0x123, b"")])
        with pytest.raises(OtherSenderError, match=r"already sends 0x123 DEMAND of ECU, which this test would send; "):
            refuse_others([bus], ours, lambda: False, "this test", "use --force")
        other.send([Frame(VEHICLE, 0x124, b"", 0, True)])
        refuse_others([bus], ours, lambda: False, "this test", "use --force")


def test_adapters_found_are_named_as_buses():
    found = [
        ("serial", "/dev/ttyS0"),
        ("serial", "/dev/ttyACM0"),
        ("kvaser", "0"),
        ("virtual", "a"),
        ("socketcan", "can0"),
    ]
    assert buses(found) == ["slcan:/dev/ttyACM0", "kvaser:0"]
