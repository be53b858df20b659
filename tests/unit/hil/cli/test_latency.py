"""`latency --bus`: what was lost on the way here is said, and what listening to a real bus means."""

import uuid

import pytest

from dbc.frame import BusName, Frame
from hil.bus.open import open_bus
from hil.bus.transmit import ListeningBus
from hil.cli.latency import _hear

VEHICLE = BusName.VEHICLE


@pytest.fixture
def channel():
    return f"loopback:l{uuid.uuid4().hex[:10]}"


def rounds(count, between):
    """Ask to go on so many times; ``between`` them something happens."""
    for left in range(count, -1, -1):
        between()
        yield left > 0


def test_frames_lost_on_the_way_here_are_said(channel, capsys):
    with open_bus(channel, VEHICLE) as other, open_bus(channel, VEHICLE) as bus:
        frames = [Frame(VEHICLE, 0xA0, bytes(8))] * 50
        refused = sent = 0
        while not refused:
            other.send(frames)
            sent += len(frames)
            refused = sum(event.number for event in other.receive())
        go_on = rounds(3, other.receive)  # it tells of the loss as soon as there is room
        heard, lost = _hear(bus, lambda: next(go_on))
    assert (len(heard), lost) == (sent - refused, refused)
    assert capsys.readouterr().err == (
        f"{refused} frames were lost on the way here: cycles missed and jitter are partly this machine's\n"
    )


def test_a_bus_that_loses_nothing_is_heard_in_silence(channel, capsys):
    with open_bus(channel, VEHICLE) as other, open_bus(channel, VEHICLE) as bus:
        other.send([Frame(VEHICLE, 0xA0, bytes(8))])
        go_on = rounds(1, lambda: None)
        heard, lost = _hear(bus, lambda: next(go_on))
        assert (len(heard), lost) == (1, 0)
    assert capsys.readouterr().err == ""


def test_what_listening_to_a_real_bus_means_is_said(channel, capsys):
    with ListeningBus(open_bus(channel, VEHICLE), optional=False) as bus:
        assert "--transmit" not in bus.words  # it has no such option
        assert _hear(bus, lambda: False) == ([], 0)
        assert capsys.readouterr().err == f"{bus.words}\n"
