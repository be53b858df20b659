"""Nodes on hardware listen until told to send; they look who is there first; their last word is the safe state."""

import signal

import pytest
from processes import RUN_LIMIT_S, wait_until
from slcan_device import SlcanDevice, SlcanFrame

from dbc.contract import contract, spec_of
from dbc.frame import BusName, Frame
from dbc.messages import BrakePedal, EhbDemandFront, EhbDemandRear, MotorDemandFront, MotorDemandRear
from hil.bench.node_process import ECU, serve
from hil.bus.channel import bench_channel
from hil.bus.open import open_bus

pytest.importorskip("serial", reason="python-can's slcan needs pyserial")
BENCH, VEHICLE = BusName.BENCH, BusName.VEHICLE
DEMANDS = [spec_of(kind) for kind in (EhbDemandFront, EhbDemandRear, MotorDemandFront, MotorDemandRear)]


@pytest.fixture
def device():
    with SlcanDevice() as device:
        yield device


def ticks(bus, count):
    """Wait for so many reports of a node's ticks."""
    heard = []
    wait_until(lambda: heard.extend(bus.receive(0.05)) or len(heard) >= count, f"{count} frames of the bench bus", 60)


@pytest.mark.slow
@pytest.mark.parametrize("role", ["plant", "ecu"])
def test_without_a_word_nothing_leaves_for_hardware(start, device, role):
    spec = f"slcan:{device.port},sleep_after_open=0"
    with open_bus(bench_channel(spec), BENCH) as bench:
        node = start(role, "--bus", spec)
        device.wait_open(timeout_s=RUN_LIMIT_S)
        assert device.listen_only
        ticks(bench, 50)
        node.send_signal(signal.SIGINT)
        _, words = node.communicate(timeout=RUN_LIMIT_S)
    assert node.returncode == 0, words
    assert not [line for line in device.commands if line[:1] in ("t", "T", "r", "R")]
    assert f"{role}: listens only: nothing is sent on slcan:{device.port} without --transmit" in words
    held = int(words.partition("nothing was sent on ")[2].partition("; ")[2].split()[0])
    assert held > 20


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [("run",), ("replay", "any.log"), ("compare",), ("run", "--without", "plant")], ids=" ".join
)
def test_what_only_sends_is_refused_without(brakebench, device, words):
    spec = f"slcan:{device.port},sleep_after_open=0"
    done = brakebench(*words, "--bus", spec, check=2)
    assert "on real hardware that reaches a real ECU or a real brake; add --transmit" in done.stderr
    assert not device.commands


@pytest.mark.slow
def test_a_role_that_somebody_plays_is_not_played_again(start, device):
    spec = f"slcan:{device.port},sleep_after_open=0"
    pedal = spec_of(BrakePedal)
    plant = start("plant", "--bus", spec, "--transmit")
    device.wait_open(timeout_s=RUN_LIMIT_S)
    assert not device.listen_only
    device.send(SlcanFrame(pedal.can_id, bytes(pedal.length)))
    _, words = plant.communicate(timeout=RUN_LIMIT_S)
    assert plant.returncode == 2
    assert f"already sends 0x{pedal.can_id:X} BRAKE_PEDAL of DRIVER, which this plant would send" in words
    assert not [line for line in device.commands if line[:1] == "t"]


class Raises:
    """A controller of somebody's own that falls over in its 50th step; its last word is ours."""

    def __init__(self):
        from ecu.node import EcuNode
        from hil.scenario.scenario import load_scenario

        self.node, self.steps = EcuNode(load_scenario("stop72").ecu), 0

    def step(self, now_ns, inbox):
        self.steps += 1
        if self.steps == 50:
            raise ArithmeticError("of its own")
        return self.node.step(now_ns, inbox)

    def farewell(self, now_ns):
        return self.node.farewell(now_ns)


def last_words(frames):
    """The last frame of each demand, decoded, and whether nothing but these came last."""
    own = {spec.can_id for spec in contract(VEHICLE).sent_by("ECU")}
    mine = [f for f in frames if isinstance(f, Frame) and f.can_id in own]
    assert [f.can_id for f in mine[-4:]] == [spec.can_id for spec in DEMANDS]
    return [tuple(spec.decode(frame.data)) for spec, frame in zip(DEMANDS, mine[-4:], strict=True)]


SAFE = [(None, None), (None, None), (0.0, 0.0), (0.0, 0.0)]


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_the_last_word_of_a_controller_is_the_safe_state(start, channel, short, end):
    with open_bus(channel, VEHICLE) as bus:
        heard = []
        start("plant", short, "--bus", channel)
        ecu = start("ecu", short, "--bus", channel)
        spec = DEMANDS[0]

        def brakes():
            heard.extend(bus.receive(0.05))
            demands = [spec.decode(f.data) for f in heard if isinstance(f, Frame) and f.can_id == spec.can_id]
            return demands and (demands[-1][0] or 0.0) > 1e5

        wait_until(brakes, "pressure")
        ecu.send_signal(end)
        assert ecu.wait(RUN_LIMIT_S) == 0
        heard += bus.receive(0.2)
    assert last_words(heard) == SAFE


def test_so_it_is_of_one_that_falls_over(channel):
    with open_bus(channel, VEHICLE) as bus:
        with pytest.raises(ArithmeticError):
            serve(ECU, Raises, channel, force=True)
        assert last_words(bus.receive(0.0)) == SAFE
