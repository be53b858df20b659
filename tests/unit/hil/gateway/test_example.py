"""The example: our plant in a RAV4's messages, braked by a controller that knows that database alone (cantools)."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from dbc.bench_messages import TruthMotion
from dbc.contract import spec_of
from dbc.frame import BusName, Frame
from hil.gateway.gateway import BehindGateway
from hil.gateway.map import load_map
from hil.rt.lockstep import Member, lockstep
from hil.scenario.scenario import load_scenario
from plant.node import PlantNode

EXAMPLES = Path(__file__).parents[4] / "examples"
TRUTH = spec_of(TruthMotion)
RADIUS_M = 0.308
END_NS = 9_500_000_000


@pytest.fixture(scope="module")
def rav4_ecu():
    spec = importlib.util.spec_from_file_location("rav4_ecu", EXAMPLES / "rav4_ecu.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class TheirEcu:
    """The example's controller as a node; ``silent_ns`` is when it dies."""

    def __init__(self, example, silent_ns=END_NS):
        self.example, self.silent_ns, self.brake = example, silent_ns, None

    def step(self, now_ns, inbox):
        for frame in inbox:
            if frame.bus is BusName.VEHICLE and frame.can_id == self.example.BRAKE.frame_id:
                self.brake = frame.data
        if now_ns >= self.silent_ns:
            return []
        return [Frame(BusName.VEHICLE, self.example.ACC.frame_id, self.example.command(self.brake))]


class Listened:
    """Our plant, with the tick at which a frame of our vehicle bus last came."""

    def __init__(self, node):
        self.node, self.last_ns = node, 0

    def step(self, now_ns, inbox):
        self.last_ns = now_ns if inbox else self.last_ns
        return self.node.step(now_ns, inbox)


def drive(example, silent_ns=END_NS):
    """Frames on their bus (time, frame), and the true motion by time."""
    scenario = load_scenario("stop72")
    listened = Listened(PlantNode(scenario.plant, scenario.manoeuvre, 1, **scenario.effects.for_node()))
    plant = BehindGateway(listened, load_map(EXAMPLES / "rav4_gateway.toml"))
    wire, motion = [], {}
    for step in lockstep([Member(plant, 1_000_000), Member(TheirEcu(example, silent_ns), 20_000_000, 5_000_000)]):
        if step.now_ns > END_NS:
            return wire, motion, listened
        for frame in step.frames:
            if frame.bus is BusName.VEHICLE:
                wire.append((step.now_ns, frame))
            elif frame.can_id == TRUTH.can_id:
                motion[step.now_ns] = TRUTH.decode(frame.data)
    return None


@pytest.fixture(scope="module")
def stop(rav4_ecu):
    return drive(rav4_ecu)


def test_their_database_alone_reads_a_stop(rav4_ecu, stop):
    wire, motion, _ = stop
    names = {message.frame_id: message for message in rav4_ecu.DATABASE.messages}
    times = {name: [] for name in (message.name for message in names.values())}
    errors = {"wheel": [], "acceleration": []}
    braked = 0.0
    for now_ns, frame in wire:
        message = names[frame.can_id]  # nothing else is on their bus
        assert len(frame.data) == message.length
        values = message.decode(frame.data)
        times[message.name].append(now_ns)
        true = motion[now_ns // 10_000_000 * 10_000_000]
        if message.name == "WHEEL_SPEEDS":
            errors["wheel"].append(values["WHEEL_SPEED_RL"] / 3.6 - true.speed_mps)
        if message.name == "KINEMATICS":
            errors["acceleration"].append(values["ACCEL_X"] - true.acceleration_mps2)
        if message.name == "BRAKE":
            braked = max(braked, values["BRAKE_FORCE"])
        if message.name in ("SPEED", "KINEMATICS", "ACC_CONTROL"):
            assert frame.data[-1] == rav4_ecu.toyota_sum(frame.can_id, frame.data)
    last = max(motion)
    off = max(map(abs, errors["wheel"]))
    print(f"stopped within {motion[last].distance_m:.1f} m; wheel speed off by at most {off:.2f} m/s")
    assert motion[last].speed_mps == pytest.approx(0.0, abs=0.05)
    assert 60.0 < motion[last].distance_m < 85.0
    assert np.percentile(np.abs(errors["wheel"]), 90) < 0.6  # slip and a tick
    assert abs(np.median(errors["acceleration"])) < 0.3
    assert 2000.0 < braked < 10_200.0
    for name, cycle_ms in {"WHEEL_SPEEDS": 12, "KINEMATICS": 12, "SPEED": 24, "BRAKE": 12, "BRAKE_2": 24}.items():
        assert set(np.diff(times[name])) == {cycle_ms * 1_000_000}, name


def test_a_dead_controller_of_theirs_is_dead_on_our_bus_too(rav4_ecu):
    """Its last demand is passed on for 2.5 of its cycles, then our car helps itself."""
    silent_ns = 3_000_000_000
    wire, motion, plant = drive(rav4_ecu, silent_ns)
    age_ns = plant.last_ns - max(now for now, f in wire if f.can_id == rav4_ecu.ACC.frame_id)
    print(f"last demand reaches our plant {age_ns / 1e6:g} ms after theirs was sent")
    assert 0 < age_ns <= 60_000_000  # 50, and a tick of the plant
    assert motion[max(motion)].speed_mps == pytest.approx(0.0, abs=0.05)  # by the brake's own pedal map
